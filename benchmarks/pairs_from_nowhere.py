"""Pairs of clouds in frames that say nothing of each other, and what is right for each."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hmrf_icp import PinholeCamera, PointCloud, datasets, io, se3
from hmrf_icp.clouds.downsample import downsample
from hmrf_icp.evaluate import protocol

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
MOST = 20_000
ANGLE, SHIFT = 0.15, 0.1
"""Radians, and share of the target's size, within which a hypothesis is near the truth."""
RMSE = 0.5
"""Metres: the same for 3DMatch, by its own measure."""

DEVELOP = {
    "tabletop-exact": (0, 12, 27),
    "kitchen-exact": (60, 190, 310),
    "kitchen-real": (60, 310),
    "fragments-exact": (0, 3, 6),
    "3DMatch": ("kitchen",),
    "3DLoMatch": ("kitchen",),
}
HELD_OUT = {
    "tabletop-exact": (5, 20, 34),
    "kitchen-exact": (0, 130, 250, 420),
    "kitchen-real": (0, 130, 420),
    "fragments-exact": (1, 4, 8, 10),
    "3DMatch": ("hotel_uc", "lab"),
    "3DLoMatch": ("hotel_uc", "lab"),
    "real": ("all",),
}


@dataclass(frozen=True, eq=False)
class Pair:
    """Two clouds, the pose (4, 4) from the first to the second, and what they share."""

    name: str
    source: PointCloud
    target: PointCloud
    truth: np.ndarray
    overlap: float
    information: np.ndarray | None = None

    def near(self, poses: np.ndarray, size: float) -> np.ndarray:
        """Tell which poses (K, 4, 4) are near the truth; ``size`` is the target's, metres."""
        left = se3.inverse(self.truth) @ poses
        if self.information is not None:
            return rmse(left, self.information) < RMSE
        angle = np.array([se3.rotation_angle(one) for one in left])
        middle = np.append(self.source.observed_points.mean(axis=0), 1.0)
        apart = np.linalg.norm((poses @ middle - self.truth @ middle)[:, :3], axis=1)
        return (angle < ANGLE) & (apart < SHIFT * size)


def rmse(left: np.ndarray, information: np.ndarray) -> np.ndarray:
    """Error (K,) of what is left (K, 4, 4) of a motion, metres, as 3DMatch measures it."""
    scalar = np.sqrt(np.maximum(1.0 + np.trace(left[:, :3, :3], axis1=1, axis2=2), 1e-12)) / 2.0
    skew = np.stack([left[:, 2, 1], left[:, 0, 2], left[:, 1, 0]], axis=1)
    skew = skew - np.stack([left[:, 1, 2], left[:, 2, 0], left[:, 0, 1]], axis=1)
    error = np.concatenate([left[:, :3, 3], skew / (4.0 * scalar[:, None])], axis=1)
    return np.sqrt(np.einsum("ki,ij,kj->k", error, information, error) / information[0, 0])


def pairs(name: str, held_out: bool, each: int, bare: bool = False) -> Iterator[Pair]:
    """Go through the pairs of one data set, about ``each`` of a target frame or scene.

    ``bare`` leaves out the camera and the viewpoint.
    """
    chosen = (HELD_OUT if held_out else DEVELOP).get(name, ())
    reader: Callable[..., Iterator[Pair]] = {
        "fragments-exact": fragments,
        "3DMatch": matches,
        "3DLoMatch": matches,
        "real": real,
    }.get(name, views)
    yield from reader(name, chosen, each, bare)


def views(name: str, targets: tuple, each: int, bare: bool) -> Iterator[Pair]:
    """Depth maps at stride 4, overlaps from 0.1 up, as many of every tenth."""
    sequence = datasets.open_sequence(DATA / name)
    clouds = {frame.index: frame.load().subsample(4) for frame in sequence.frames}
    pose = {frame.index: frame.pose for frame in sequence.frames}
    for target in targets:
        truth = {i: protocol.true_transformation(pose[i], pose[target]) for i in clouds}
        shares = {i: protocol.overlap(clouds[i], clouds[target], truth[i]) for i in clouds}
        selection = protocol.select(target, shares, max(1, each // 9), 0, 0.1)
        for one in selection.pairs:
            source, fixed = (
                PointCloud(c.points) if bare else c for c in (clouds[one.source], clouds[target])
            )
            yield Pair(one.name, source, fixed, truth[one.source], one.overlap)


def fragments(name: str, targets: tuple, each: int, _bare: bool) -> Iterator[Pair]:
    """Fused fragments in frames of their own, overlaps from 0.1 up."""
    count = len(list((DATA / name).glob("*.ply")))
    stems = [DATA / name / f"fragment-{i:02d}" for i in range(count)]
    clouds = [downsample(PointCloud(io.read_cloud(f"{s}.ply").points), MOST).cloud for s in stems]
    pose = [np.loadtxt(f"{s}.pose.txt") for s in stems]
    for target in targets:
        there = []
        for i in range(count):
            truth = protocol.true_transformation(pose[i], pose[target])
            share = protocol.overlap(clouds[i], clouds[target], truth)
            if i != target and share >= 0.1:
                there.append(Pair(f"{target:02d}-{i:02d}", clouds[i], clouds[target], truth, share))
        yield from there[:each]


def blocks(path: Path, rows: int) -> dict[tuple[int, int], np.ndarray]:
    """Read the matrices of a 3DMatch log by the pair that each belongs to."""
    lines = [line.split() for line in path.read_text().splitlines() if line.strip()]
    return {
        (int(lines[k][0]), int(lines[k][1])): np.array(lines[k + 1 : k + 1 + rows], dtype=float)
        for k in range(0, len(lines), rows + 1)
    }


def matches(name: str, scenes: tuple, each: int, bare: bool) -> Iterator[Pair]:
    """Fragments of 3DMatch; each stands in the frame of its first camera."""
    for scene in scenes:
        folder = DATA / "3dmatch" / scene
        truths, informations = (
            blocks(folder / name / f"gt.{kind}", rows) for kind, rows in (("log", 4), ("info", 6))
        )
        shares = {
            (int(i), int(j)): float(share)
            for i, j, share in (
                line.split(",") for line in (folder / name / "gt_overlap.log").read_text().split()
            )
        }
        counted = [key for key in truths if key[1] > key[0] + 1]
        step = max(1, len(counted) // each)
        for key in counted[step // 2 :: step][:each]:
            target, source = (
                downsample(
                    PointCloud(
                        io.read_cloud(folder / f"cloud_bin_{i}.ply").points,
                        viewpoint=None if bare else np.zeros(3),
                    ),
                    MOST,
                ).cloud
                for i in key
            )
            share = shares.get(key, np.nan)
            title = f"{scene} {key[0]}-{key[1]}"
            yield Pair(title, source, target, truths[key], share, informations[key])


def real(name: str, _chosen: tuple, each: int, bare: bool) -> Iterator[Pair]:
    """Pairs of public projects: depth maps, scans, fragments, objects."""
    for folder in sorted((DATA / name).iterdir())[:each]:
        meta = json.loads((folder / "meta.json").read_text())
        clouds = []
        for side in ("source", "target"):
            points = np.load(folder / f"{side}.npz")["points"].astype(float)
            camera = meta["camera"]
            if camera is not None and points.ndim == 3 and not bare:
                cloud = PointCloud(
                    points, PinholeCamera(int(camera[0]), int(camera[1]), *camera[2:])
                )
            else:
                cloud = PointCloud(points, None, None if bare else meta["viewpoint"])
            clouds.append(downsample(cloud, MOST).cloud)
        truth = se3.as_rigid(np.loadtxt(folder / "gt.txt"))
        share = protocol.overlap(clouds[0], clouds[1], truth)
        yield Pair(folder.name, clouds[0], clouds[1], truth, share)
