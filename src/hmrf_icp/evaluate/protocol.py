"""What is registered from where: the paper's experiment (Experiments, Results) as a protocol.

A *pair* is a target frame, which stays, and a source frame that overlaps it. A
*start* turns the pair's true pose by an angle (and, beyond the paper, shifts it);
it is done once about each of a fixed set of random *axes*, the same for all pairs.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.clouds.tree import Tree
from hmrf_icp.errors import InputError

Array = NDArray[np.float64]

NEIGHBOUR_FACTOR = 6.0
"""A source point overlaps when the target is nearer than this many times its own neighbour."""

SPACING_FACTOR = 2.0
"""The same in spacings of the target's surface, of random samples of which few are farther off."""

DECILES = 10


@dataclass(frozen=True, order=True)
class Pair:
    """Two frames of one sequence, by their indices, and the share of the source that overlaps.

    Parameters
    ----------
    scene
        Benchmark and scene (``3DMatch/kitchen``) where the data set has several.
    """

    target: int
    source: int
    overlap: float
    scene: str = ""

    @property
    def name(self) -> str:
        """What results call it: target, then source."""
        if self.scene:
            return f"{self.scene}-{self.target}-{self.source}"
        return f"{self.target:06d}-{self.source:06d}"


@dataclass(frozen=True, order=True)
class Start:
    """How far from the true pose a registration begins.

    Parameters
    ----------
    angle
        Rotation about an axis through the source's centroid, radians. Infinite where no start is
        given, each cloud being in its own frame (`NO_START`).
    translation
        Length of a shift in a random direction, metres; the paper has none.

    Raises
    ------
    InputError
        A number that is negative or not finite.
    """

    angle: float
    translation: float = 0.0

    @property
    def given(self) -> bool:
        """Whether there is one."""
        return self.angle != np.inf

    @property
    def cells(self) -> tuple[str, str]:
        """Angle and translation as results write them."""
        return (repr(self.angle) if self.given else NONE), repr(self.translation)

    @classmethod
    def of_cells(cls, angle: str, translation: str) -> Start:
        """Read what `cells` wrote; ValueError or InputError for anything else."""
        return NO_START if angle == NONE else cls(float(angle), float(translation))

    def __post_init__(self) -> None:
        """Refuse what is no distance."""
        if not self.given and self.translation == 0:
            return
        for name in ("angle", "translation"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0):
                raise InputError(f"start: {name} must be zero or positive, got {value:g}")


NONE = "none"
"""What people and results call a start that is not given."""

NO_START = Start(np.inf)


def usual_starts(listed: bool) -> tuple[Start, ...]:
    """Return the starts where nobody chose: the paper's, or none for lists of pairs."""
    return (NO_START,) if listed else (Start(np.pi / 30),)


@dataclass(frozen=True, eq=False)
class Axes:
    """The random directions that every pair is started along.

    Parameters
    ----------
    rotation, shift
        (N, 3) unit vectors in the target's frame: the axis turned about, and
        the direction of the translation.
    """

    rotation: Array
    shift: Array

    @classmethod
    def random(cls, count: int, seed: int) -> Axes:
        """Draw ``count`` axes evenly over the sphere; the first of them do not depend on it."""
        if count < 1:
            raise InputError(f"axes: expected one or more, got {count}")
        return cls(*(_directions(count, (seed, stream)) for stream in (0, 1)))

    def __len__(self) -> int:
        return len(self.rotation)


def _directions(count: int, seed: tuple[int, int]) -> Array:
    directions = np.random.default_rng(seed).standard_normal((count, 3))
    return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))


def true_transformation(source_pose: Array, target_pose: Array) -> Array:
    """Source to target, (4, 4), out of two sensor-to-world poses."""
    return se3.inverse(target_pose) @ source_pose


def perturbed(truth: Array, centroid: Array, axes: Axes, axis: int, start: Start) -> Array:
    """Move a true pose away from itself (Results: "perturbing this alignment").

    Parameters
    ----------
    truth
        (4, 4) source to target.
    centroid
        (3,) mean of the source's points in the source's frame, metres.
    axes, axis
        The set of axes, and which of them.
    start
        By how much.

    Returns
    -------
    (4, 4): the source under the true pose, turned about its centroid, then shifted.
    """
    turn = se3.rotation_about(axes.rotation[axis], start.angle, se3.transform(truth, centroid))
    shift = se3.rigid(np.eye(3), start.translation * axes.shift[axis])
    return np.asarray(shift @ turn @ truth)


def neighbour_distance(points: Array) -> Array:
    """Distance (N,) of each point to its nearest neighbour in its own cloud, metres."""
    distance, _ = Tree(points).query(points, k=2)
    return np.asarray(distance[:, 1])


def overlap(
    source: PointCloud, target: PointCloud, truth: Array, neighbours: Array | None = None
) -> float:
    """Share of the source's points that the target saw too, as the paper estimates it.

    Under the true pose a source point counts when its distance to the target is
    below six times the distance to its nearest neighbour in its own cloud. That fits depth
    maps; of scans whose rings are far apart see :func:`surface_overlap`.

    Parameters
    ----------
    source, target
        The clouds; what counts depends on their spacing, so pass those that
        are registered.
    truth
        (4, 4) source to target.
    neighbours
        ``neighbour_distance(source.observed_points)`` where it is known already.
    """
    points = source.observed_points
    if len(points) < 2 or len(target) == 0:
        return 0.0
    reach = NEIGHBOUR_FACTOR * (neighbour_distance(points) if neighbours is None else neighbours)
    distance, _ = Tree(target.observed_points).query(se3.transform(truth, points))
    return float(np.mean(distance < reach))


def surface_overlap(source: PreparedCloud, target: PreparedCloud, truth: Array) -> float:
    """Share of the source's *surface* that the target saw too, whatever the density of either.

    As :func:`overlap`, but each point counts by the area that it stands for, and a target point is
    near, too, within two of the spacings that the target has there. On a scanner's ring the
    nearest neighbour is so close that six times its distance does not reach the next ring.

    Parameters
    ----------
    source, target
        The clouds, as they are registered.
    truth
        (4, 4) source to target.
    """
    area = source.surface.area
    distance, near = target.tree.query(se3.transform(truth, source.points))
    reach = np.maximum(
        NEIGHBOUR_FACTOR * neighbour_distance(source.points),
        SPACING_FACTOR * np.sqrt(target.surface.area[near]),
    )
    return float(area @ (distance < reach) / area.sum())


def decile(overlap: float) -> int:
    """Which tenth of [0, 1] an overlap lies in, 0 to 9; 1.0 belongs to the last."""
    return min(int(overlap * DECILES), DECILES - 1)


@dataclass(frozen=True)
class Selection:
    """The pairs of one target frame, and the deciles that had none."""

    pairs: tuple[Pair, ...]
    empty_deciles: tuple[int, ...]


def select(
    target: int,
    overlaps: Mapping[int, float],
    per_decile: int,
    seed: int,
    minimum_overlap: float = 0.0,
) -> Selection:
    """Draw source frames for one target, as many from each decile of overlap.

    Frames that do not overlap at all are left out, as in the paper, and those
    below ``minimum_overlap``. The draw depends on the seed and the target alone.

    Parameters
    ----------
    target
        Index of the target frame.
    overlaps
        Overlap with it by index of the source frame.
    per_decile
        At most so many from each tenth.
    """
    rng = np.random.default_rng((seed, target))
    shuffled = rng.permutation(sorted(overlaps)).tolist()
    chosen: dict[int, list[Pair]] = {tenth: [] for tenth in range(DECILES)}
    for source in shuffled:
        share = overlaps[source]
        if source == target or share <= 0.0 or share < minimum_overlap:
            continue
        kept = chosen[decile(share)]
        if len(kept) < per_decile:
            kept.append(Pair(target, source, share))
    pairs = sorted(pair for kept in chosen.values() for pair in kept)
    return Selection(tuple(pairs), tuple(tenth for tenth, kept in chosen.items() if not kept))


def spread(pairs: Sequence[Pair], count: int, seed: int) -> tuple[Pair, ...]:
    """Choose pairs evenly over scenes and, within each, over overlap.

    Scene by scene in turn, along a sequence of places of which every beginning is
    spread (van der Corput's): the pairs of a small ``count`` are among those of a larger one.

    Parameters
    ----------
    count
        How many.
    seed
        Where each scene's sequence begins.

    Returns
    -------
    The pairs in the order in which they were given.
    """
    scenes: dict[str, list[Pair]] = {}
    for pair in sorted(pairs, key=lambda pair: (pair.scene, pair.overlap, pair)):
        scenes.setdefault(pair.scene, []).append(pair)
    queues = []
    for number, members in enumerate(scenes.values()):
        first = int(np.random.default_rng((seed, number)).integers(len(members)))
        queues.append([members[(first + k) % len(members)] for k in _spread_places(len(members))])
    turns = itertools.chain.from_iterable(itertools.zip_longest(*queues))
    chosen = set(itertools.islice((pair for pair in turns if pair is not None), count))
    return tuple(pair for pair in pairs if pair in chosen)


def _spread_places(count: int) -> list[int]:
    """0 to ``count`` - 1 in van der Corput's order: nothing, a half, a quarter, three quarters."""
    digits = max(count - 1, 1).bit_length()
    shares = (int(f"{k:0{digits}b}"[::-1], 2) / 2**digits for k in range(2**digits))
    return list(dict.fromkeys(int(share * count) for share in shares))


def spread_targets(frames: Iterable[int], count: int = 2) -> tuple[int, ...]:
    """Choose target frames where nobody did: ``count`` of them, evenly along the sequence.

    The middle frame of each of ``count`` equal stretches, so that none stands at
    an end, where a recording is often still or looking elsewhere.
    """
    indices = sorted(frames)
    count = min(count, len(indices))
    return tuple(indices[(2 * k + 1) * len(indices) // (2 * count)] for k in range(count))
