"""The pairs of `speed.py`: from the shared data where it is there, rendered where it is not."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

import depth_pairs
import judges
from hmrf_icp import PointCloud, datasets, read_cloud
from hmrf_icp.evaluate import protocol
from hmrf_icp.synthetic import render, scenes
from speed_measure import Left, Setting

START = protocol.Start(math.pi / 30)
DECILES = 10


@dataclass(frozen=True, eq=False)
class Timed:
    """Two clouds in memory.

    Parameters
    ----------
    source, target
        As the sensor gives them.
    truth, init
        (4, 4) source to target, and where it is started from, if anywhere.
    overlap
        Share of the source that the target saw too.
    """

    name: str
    source: PointCloud
    target: PointCloud
    truth: np.ndarray
    init: np.ndarray | None
    overlap: float = math.nan

    def right(self, pose: np.ndarray) -> bool:
        """Tell whether a pose is within 0.05 m and 0.05 rad of the truth."""
        return judges.Bounds().right(pose, self.truth, np.zeros(3))


def fresh(cloud: PointCloud) -> PointCloud:
    """Return a cloud of the same points of which nothing was worked out yet."""
    return PointCloud(cloud.points, cloud.camera, cloud.viewpoint)


def started(
    source: PointCloud, truth: np.ndarray, axis: int = 0, start: protocol.Start = START
) -> np.ndarray:
    """Turn a pose by pi/30 about a random axis through the source's centroid, or otherwise."""
    axes = protocol.Axes.random(axis + 1, seed=0)
    return protocol.perturbed(truth, source.observed_points.mean(axis=0), axes, axis, start)


# --- depth maps ---------------------------------------------------------------------------------


def depth_frames(setting: Setting) -> tuple[str, tuple[datasets.Frame, ...]]:
    """Open the kitchen, or the package's desk."""
    folder = setting.data / "kitchen-exact"
    if folder.is_dir():
        return folder.name, datasets.open_sequence(str(folder)).frames
    return "rendered desk", datasets.open_sequence("synthetic:desk").frames


@cache
def overlaps(setting: Setting) -> tuple[tuple[int, int, float], ...]:
    """Source, target (places of frames) and overlap of pairs with a few targets."""
    _, frames = depth_frames(setting)
    places = [k * len(frames) // 8 for k in ((1, 5) if setting.quick else (1, 3, 5, 7))]
    seen = [frame.load().subsample(8) for frame in frames]
    found = []
    for target in places:
        for source in range(len(frames)):
            if source != target:
                truth = protocol.true_transformation(frames[source].pose, frames[target].pose)
                share = protocol.overlap(seen[source], seen[target], truth)
                found.append((source, target, share))
    return tuple(found)


def pairs_within(
    setting: Setting, low: float, high: float, count: int, seed: int = 0
) -> tuple[str, list[Timed]]:
    """Draw pairs of 640 x 480 with an overlap within the bounds; the name of the data too."""
    name, frames = depth_frames(setting)
    within = [pair for pair in overlaps(setting) if low <= pair[2] < high]
    rng = np.random.default_rng([seed, round(100 * low)])
    chosen = [within[k] for k in rng.permutation(len(within))[:count]]
    pairs = []
    for axis, (i, j, share) in enumerate(chosen):
        source, target = frames[i].load(), frames[j].load()
        truth = protocol.true_transformation(frames[i].pose, frames[j].pose)
        init = started(source, truth, axis)
        label = f"{frames[i].index} to {frames[j].index}"
        pairs.append(Timed(label, source, target, truth, init, share))
    return name, pairs


def all_deciles(setting: Setting) -> tuple[str, list[Timed]]:
    """Draw as many pairs from every tenth of overlap that has some."""
    name, pairs = "", []
    for decile in range(0, DECILES, setting.some(1, 3)):
        low, high = decile / DECILES, (decile + 1) / DECILES + (decile == DECILES - 1)
        name, some = pairs_within(setting, low, high, setting.some(2, 1))
        pairs += some
    return name, pairs


def rendered(width: int, height: int, apart: int = 8) -> Timed:
    """Render two views of the package's desk at any size, with a sensor's noise."""
    scale = width / scenes.CAMERA.width
    camera = replace(
        scenes.CAMERA,
        width=width,
        height=height,
        fx=scenes.CAMERA.fx * scale,
        fy=scenes.CAMERA.fy * scale,
        cx=(width - 1) / 2,
        cy=(height - 1) / 2,
    )
    poses, rng = scenes.trajectory("desk", 60), np.random.default_rng(0)
    views = []
    for pose in (poses[apart], poses[0]):
        depth = render.render(scenes.desk(), camera, pose)
        views.append(PointCloud.from_depth(render.sensor_noise(depth, camera, rng), camera))
    truth = protocol.true_transformation(poses[apart], poses[0])
    return Timed(f"{width} x {height}", *views, truth, started(views[0], truth))


# --- other sensors ------------------------------------------------------------------------------


def lidar_pairs(setting: Setting) -> list[Timed]:
    """Read the LiDAR pairs that are there; they were seen from the origin of their frames."""
    pairs = []
    folder = setting.data / "lidar"
    if folder.is_dir():
        source, target = (_from_origin(folder / f"{name}.ply") for name in ("source", "target"))
        truth = np.loadtxt(folder / "T_target_source.txt")
        pairs.append(Timed("lidar", source, target, truth, started(source, truth)))
    if (setting.data / "real").is_dir():
        for pair in datasets.open_dataset(setting.data / "real").pairs:
            if pair.scene.startswith("d_"):
                source, target = pair.source_scan.load(), pair.target_scan.load()
                init = started(source, pair.truth, len(pairs))
                pairs.append(Timed(pair.scene, source, target, pair.truth, init, pair.overlap))
    if not pairs:
        raise Left(f"no LiDAR scans in {setting.data}")
    return pairs[: setting.some(len(pairs), 2)]


def _from_origin(path: Path) -> PointCloud:
    return PointCloud(read_cloud(path).points, viewpoint=np.zeros(3))


def fragment_pairs(setting: Setting) -> list[Timed]:
    """Read pairs of fused fragments, spread over overlap; each is in a frame of its own."""
    every = judges.spread(list(judges.fragments(setting.data)), setting.some(12, 3), 0)
    if not every:
        raise Left(f"no fragments in {setting.data}")
    return [
        Timed(pair.name, pair.source(), pair.target(), pair.truth, np.eye(4), pair.overlap)
        for pair in every
    ]


def vga_pair(setting: Setting) -> Timed:
    """Return the pair that the other benchmarks run on too."""
    name, source, target, truth, init = depth_pairs.vga_pair(setting.data / "kitchen-exact")
    return Timed(name, source, target, truth, init)
