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

from hmrf_icp import PointCloud, datasets, se3
from hmrf_icp.evaluate import protocol

SUBSAMPLE = 4
"""Step of rows and columns of depth maps: 160 x 120 points."""

TARGETS = (6, 18, 31, 43)
"""Places in a sequence of the frames that stay, of fifty."""


@dataclass(frozen=True)
class Bounds:
    """Both errors at most these, the translation's as the paper measures it.

    Parameters
    ----------
    metres, radians
        The bounds.
    """

    metres: float = 0.05
    radians: float = 0.05

    def right(self, estimate: np.ndarray, truth: np.ndarray, centroid: np.ndarray) -> bool:  # noqa: ARG002
        """Tell whether a pose counts as the true one."""
        metres, radians = se3.error(estimate, truth)
        return metres <= self.metres and radians <= self.radians


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
    criterion: datasets.Criterion
    unit: float = 1.0
    voxel: float = 0.05
    bare: bool = False
    near: bool = False

    def outcome(self, pose: np.ndarray) -> tuple[bool, float, float]:
        """Tell whether a pose is right, and its errors in the pair's unit and in radians.

        By the benchmark's criterion the former is the root mean square error of the true matches.
        """
        centroid = self.source().observed_points.mean(axis=0)
        metres, radians = se3.error(pose, self.truth)
        if isinstance(self.criterion, datasets.MatchedRmse):
            metres = self.criterion.error(pose, self.truth)
        elif isinstance(self.criterion, datasets.Tolerance):
            metres, radians = self.criterion.errors(pose, self.truth, centroid)
        return self.criterion.right(pose, self.truth, centroid), metres, radians

    def start(self, start: protocol.Start) -> np.ndarray:
        """Turn and shift the true pose; the axis depends on the pair's name alone."""
        centroid = self.source().observed_points.mean(axis=0)
        axes = protocol.Axes.random(1, zlib.crc32(f"{self.group} {self.name}".encode()))
        scaled = replace(start, translation=start.translation * self.unit)
        return protocol.perturbed(self.truth, centroid, axes, 0, scaled)


@dataclass(frozen=True)
class View:
    """A depth map, thinned."""

    frame: datasets.Frame

    def __call__(self) -> PointCloud:
        """Read it."""
        return self.frame.load().subsample(SUBSAMPLE)


# --- the benchmarks of the field ----------------------------------------------------------------


def benchmark_3dmatch(data: Path, name: str) -> Iterator[JudgedPair]:
    """Yield the pairs of 3DMatch or 3DLoMatch that the benchmark counts."""
    if not (data / "3dmatch").is_dir():
        return
    for pair in datasets.open_dataset(data / "3dmatch").only(name).pairs:
        yield JudgedPair(
            f"{pair.scene}-{pair.target:02d}-{pair.source:02d}",
            pair.scene,
            pair.source_scan.load,
            pair.target_scan.load,
            pair.truth,
            pair.overlap,
            pair.criterion,
            bare=True,
        )


# --- what was rendered, and the real camera -----------------------------------------------------


def fragments(data: Path) -> Iterator[JudgedPair]:
    """Yield fragments of ``fragments-exact`` that overlap by a tenth or more."""
    if not (data / "fragments-exact").is_dir():
        return
    frames = datasets.open_sequence(data / "fragments-exact").frames
    read = [frame.load() for frame in frames]
    for i, target in enumerate(frames):
        for j, source in enumerate(frames[i + 1 :], i + 1):
            truth = protocol.true_transformation(source.pose, target.pose)
            overlap = protocol.overlap(read[j], read[i], truth)
            if overlap >= 0.1:
                yield JudgedPair(
                    f"{target.index:02d}-{source.index:02d}",
                    "fragments",
                    source.load,
                    target.load,
                    truth,
                    overlap,
                    Bounds(),
                    bare=True,
                )


def views(
    data: Path, name: str, criterion: datasets.Criterion, least: float
) -> Iterator[JudgedPair]:
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
    if not (data / "real").is_dir():
        return
    for pair in datasets.open_dataset(data / "real").pairs:
        about = json.loads((data / "real" / pair.scene / "meta.json").read_text(encoding="utf-8"))
        source, target = pair.source_scan.load(), pair.target_scan.load()
        yield JudgedPair(
            pair.scene,
            pair.scene[0],
            pair.source_scan.load,
            pair.target_scan.load,
            pair.truth,
            protocol.overlap(source, target, pair.truth),
            pair.criterion,
            unit=pair.unit,
            # 0.05 m for a fragment of 1.25 m.
            voxel=0.04 * about["size"],
            bare=source.viewpoint is None,
            near=about["identity"],
        )


JUDGES: dict[str, Callable[[Path], Iterator[JudgedPair]]] = {
    "3dmatch": lambda data: benchmark_3dmatch(data, "3DMatch"),
    "3dlomatch": lambda data: benchmark_3dmatch(data, "3DLoMatch"),
    "fragments-exact": fragments,
    "kitchen-exact": lambda data: views(data, "kitchen-exact", Bounds(), 0.1),
    "tabletop-exact": lambda data: views(data, "tabletop-exact", Bounds(), 0.1),
    "kitchen-real": lambda data: views(data, "kitchen-real", Bounds(0.075, 0.1), 0.1),
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
