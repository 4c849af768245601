"""The judges of registration from nowhere: which pairs, what is given, when an answer is right.

One place for the pair lists and the success criteria that `nowhere.py` runs. A judge whose data is
missing has no pairs.
"""

from __future__ import annotations

import json
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import hmrf_icp
from hmrf_icp import PinholeCamera, PointCloud, datasets, se3
from hmrf_icp.evaluate import protocol

SUBSAMPLE = 4
"""Step of rows and columns of depth maps: 160 x 120 points."""

TARGETS = (6, 18, 31, 43)
"""Places in a sequence of the frames that stay, of fifty."""

LARGEST_RMSE = 0.2
"""Metres: the benchmark's bound on the root mean square error of a pair's true matches."""

SHARE, DEGREES = 0.02, 2.0
"""Tolerance of a pair that names none: this share of its size, and these degrees."""


@dataclass(frozen=True, eq=False)
class Criterion:
    """When a pose is right: by the benchmark's information matrix, or by two bounds.

    Parameters
    ----------
    metres, radians
        Bounds on both parts of the error.
    centre
        (3,) point of the source whose displacement counts as the error of translation; None for
        the difference of the two translations.
    information
        (6, 6) the pair's block of ``gt.info``, used in place of both bounds.
    """

    metres: float = 0.05
    radians: float = 0.05
    centre: np.ndarray | None = None
    information: np.ndarray | None = None

    def errors(self, pose: np.ndarray, truth: np.ndarray) -> tuple[float, float]:
        """Return the two parts of the error, metres (the pair's unit) and radians.

        By the information matrix the first is the root mean square error of the true matches.
        """
        metres, radians = se3.error(pose, truth)
        if self.information is not None:
            e = _error_vector(pose, truth)
            return float(np.sqrt(e @ self.information @ e / self.information[0, 0])), radians
        if self.centre is not None:
            moved = [se3.transform(one, self.centre[None]) for one in (pose, truth)]
            metres = float(np.linalg.norm(moved[0] - moved[1]))
        return metres, radians

    def right(self, pose: np.ndarray, truth: np.ndarray) -> bool:
        """Tell whether a pose counts as the true one."""
        metres, radians = self.errors(pose, truth)
        if self.information is not None:
            return metres <= LARGEST_RMSE
        return metres <= self.metres and radians <= self.radians


def _error_vector(pose: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Return translation and vector part of the quaternion (6,) of what separates two poses."""
    off = se3.inverse(truth) @ pose
    quaternion = Rotation.from_matrix(off[:3, :3]).as_quat(canonical=True)
    return np.concatenate([off[:3, 3], quaternion[:3]])


@dataclass(frozen=True, eq=False)
class JudgedPair:
    """Two clouds with the pose that is known of them.

    Parameters
    ----------
    name, group
        Unique within its judge, and the scene whose recalls are averaged.
    source, target
        Read the clouds as the data gives them (camera and viewpoint where it does).
    truth
        (4, 4) source to target.
    overlap
        Share of the source that the target saw too.
    criterion
        When an answer is right.
    unit
        Length of a metre in the pair's own unit, for the shift of a start.
    voxel
        What peers thin the clouds to.
    bare
        Whether nothing but points is known of the clouds anyway.
    near
        Whether the frames as given are close to the truth already.
    """

    name: str
    group: str
    source: Callable[[], PointCloud]
    target: Callable[[], PointCloud]
    truth: np.ndarray
    overlap: float
    criterion: Criterion
    unit: float = 1.0
    voxel: float = 0.05
    bare: bool = False
    near: bool = False

    def start(self, start: protocol.Start) -> np.ndarray:
        """Turn and shift the true pose; the axis depends on the pair's name alone."""
        centroid = self.source().observed_points.mean(axis=0)
        axes = protocol.Axes.random(1, zlib.crc32(f"{self.group} {self.name}".encode()))
        scaled = replace(start, translation=start.translation * self.unit)
        return protocol.perturbed(self.truth, centroid, axes, 0, scaled)


@dataclass(frozen=True)
class CloudFile:
    """A file with a cloud."""

    path: Path

    def __call__(self) -> PointCloud:
        """Read it."""
        return hmrf_icp.read_cloud(self.path)


@dataclass(frozen=True)
class View:
    """A depth map, thinned."""

    frame: datasets.Frame

    def __call__(self) -> PointCloud:
        """Read it."""
        return self.frame.load().subsample(SUBSAMPLE)


@dataclass(frozen=True)
class Points:
    """An archive with ``points``, and what is known of the sensor."""

    path: Path
    camera: tuple[float, ...] | None
    viewpoint: tuple[float, ...] | None

    def __call__(self) -> PointCloud:
        """Read it."""
        points = np.load(self.path)["points"]
        if self.camera is not None:
            width, height, *rest = self.camera
            return PointCloud(points, PinholeCamera(int(width), int(height), *rest))
        return PointCloud(
            points, None, None if self.viewpoint is None else np.array(self.viewpoint)
        )


# --- the benchmarks of the field ----------------------------------------------------------------


def _blocks(path: Path, rows: int) -> dict[tuple[int, int], np.ndarray]:
    """Matrices of a ``gt.log`` (4 rows) or ``gt.info`` (6 rows) by their two numbers."""
    words = path.read_text(encoding="utf-8").split()
    size = 3 + rows * rows
    found = {}
    for first in range(0, len(words), size):
        block = words[first : first + size]
        matrix = np.array(block[3:], dtype=float).reshape(rows, rows)
        found[int(block[0]), int(block[1])] = matrix
    return found


def benchmark_3dmatch(data: Path, name: str) -> Iterator[JudgedPair]:
    """Yield the pairs of 3DMatch or 3DLoMatch that the benchmark counts: j > i + 1."""
    for scene in sorted(path.parent for path in (data / "3dmatch").glob(f"*/{name}")):
        poses = _blocks(scene / name / "gt.log", 4)
        information = _blocks(scene / name / "gt.info", 6)
        lines = (scene / name / "gt_overlap.log").read_text(encoding="utf-8").split()
        overlaps = {
            (int(i), int(j)): float(share) for i, j, share in (line.split(",") for line in lines)
        }
        for (i, j), pose in poses.items():
            if j > i + 1:
                truth = se3.rigid(se3.nearest_rotation(pose[:3, :3]), pose[:3, 3])
                yield JudgedPair(
                    f"{scene.name}-{i:02d}-{j:02d}",
                    scene.name,
                    CloudFile(scene / f"cloud_bin_{j}.ply"),
                    CloudFile(scene / f"cloud_bin_{i}.ply"),
                    truth,
                    overlaps.get((i, j), float("nan")),
                    Criterion(information=information[i, j]),
                    bare=True,
                )


# --- what was rendered, and the real camera -----------------------------------------------------


def fragments(data: Path) -> Iterator[JudgedPair]:
    """Yield fragments of ``fragments-exact`` that overlap by a tenth or more."""
    files = sorted((data / "fragments-exact").glob("fragment-*.ply"))
    clouds = [CloudFile(file) for file in files]
    poses = [np.loadtxt(file.with_suffix(".pose.txt")) for file in files]
    read = [cloud() for cloud in clouds]
    for i in range(len(files)):
        for j in range(i + 1, len(files)):
            truth = se3.inverse(poses[i]) @ poses[j]
            overlap = protocol.overlap(read[j], read[i], truth)
            if overlap >= 0.1:
                yield JudgedPair(
                    f"{files[i].stem[-2:]}-{files[j].stem[-2:]}",
                    "fragments",
                    clouds[j],
                    clouds[i],
                    truth,
                    overlap,
                    Criterion(),
                    bare=True,
                )


def views(data: Path, name: str, criterion: Criterion, least: float) -> Iterator[JudgedPair]:
    """Yield every source frame that overlaps one of the targets enough."""
    folder = data / name
    if not folder.is_dir():
        return
    frames = datasets.open_sequence(str(folder)).frames
    places = [place for place in TARGETS if place < len(frames)]
    seen = [View(frame)() for frame in frames]
    for place in places:
        target = frames[place]
        for other, source in enumerate(frames):
            truth = protocol.true_transformation(source.pose, target.pose)
            if other == place:
                continue
            overlap = protocol.overlap(seen[other], seen[place], truth)
            if overlap >= least:
                yield JudgedPair(
                    f"{target.index:04d}-{source.index:04d}",
                    name,
                    View(source),
                    View(target),
                    truth,
                    overlap,
                    criterion,
                )


# --- real pairs ---------------------------------------------------------------------------------


def real(data: Path) -> Iterator[JudgedPair]:
    """Yield the pairs of public projects, each with its own size, tolerance and sensor."""
    for folder in sorted(path.parent for path in (data / "real").glob("*/meta.json")):
        about = json.loads((folder / "meta.json").read_text(encoding="utf-8"))
        camera, viewpoint, size = about["camera"], about["viewpoint"], about["size"]
        known = [None if value is None else tuple(value) for value in (camera, viewpoint)]
        source, target = (Points(folder / f"{end}.npz", *known) for end in ("source", "target"))
        truth = np.loadtxt(folder / "gt.txt")
        cloud = source()
        metres, degrees = about["tol"] or (SHARE * size, DEGREES)
        yield JudgedPair(
            folder.name,
            folder.name[0],
            source,
            target,
            truth,
            protocol.overlap(cloud, target(), truth),
            Criterion(metres, np.radians(degrees), cloud.observed_points.mean(axis=0)),
            unit=1.0 if about["room"] else size,
            # 0.05 m for a fragment of 1.25 m.
            voxel=0.04 * size,
            bare=camera is None and viewpoint is None,
            near=about["identity"],
        )


JUDGES: dict[str, Callable[[Path], Iterator[JudgedPair]]] = {
    "3dmatch": lambda data: benchmark_3dmatch(data, "3DMatch"),
    "3dlomatch": lambda data: benchmark_3dmatch(data, "3DLoMatch"),
    "fragments-exact": fragments,
    "kitchen-exact": lambda data: views(data, "kitchen-exact", Criterion(), 0.1),
    "tabletop-exact": lambda data: views(data, "tabletop-exact", Criterion(), 0.1),
    "kitchen-real": lambda data: views(data, "kitchen-real", Criterion(0.075, 0.1), 0.1),
    "real-far": lambda data: (pair for pair in real(data) if not pair.near),
    "real-near": lambda data: (pair for pair in real(data) if pair.near),
}
"""By name; real pairs whose frames are close to the truth as given stand apart."""


def spread(pairs: list[JudgedPair], count: int, seed: int) -> list[JudgedPair]:
    """Choose pairs evenly over overlap and scenes; the first of them do not depend on the count."""
    groups: dict[str, list[JudgedPair]] = defaultdict(list)
    for pair in sorted(pairs, key=lambda pair: (pair.overlap, pair.name)):
        groups[pair.group].append(pair)
    if count <= 0 or count >= len(pairs):
        return pairs
    shift = {group: np.random.default_rng([seed, n]).random() for n, group in enumerate(groups)}
    orders = [
        iter(_low_discrepancy(len(members), shift[group])) for group, members in groups.items()
    ]
    chosen: list[JudgedPair] = []
    members = list(groups.values())
    while len(chosen) < count:
        for mine, order in zip(members, orders, strict=True):
            place = next(order, None)
            if place is not None and len(chosen) < count:
                chosen.append(mine[place])
    return chosen


def _low_discrepancy(count: int, shift: float) -> list[int]:
    """Places 0 to count - 1 in an order whose every beginning is spread (van der Corput)."""
    bits = max(count - 1, 1).bit_length()
    reversed_ = [int(f"{k:0{bits}b}"[::-1], 2) for k in range(2**bits)]
    first = int(shift * count)
    return [(place + first) % count for place in reversed_ if place < count]
