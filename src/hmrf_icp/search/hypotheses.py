"""Poses that may be right, from local features alone: many, diverse, the likeliest first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import threads
from hmrf_icp.search.consistent_groups import Oriented, explained, motions
from hmrf_icp.search.feature_matches import match
from hmrf_icp.search.features import Features, common_edge, describe
from hmrf_icp.search.surface_agreement import Agreement
from hmrf_icp.stages import stage

Array = NDArray[np.float64]

PLACES = (1700, 4000)
"""Places that a cloud is thinned to, about, one after the other.

What is found differs: of 30 pairs of 3DLoMatch 0.93 with 1,700 places, 0.90 with 4,000, 0.97
with both.
"""

MATCHES = 3500
"""Matches that are held against each other: the work grows with the square."""

SEEDS = 1000
"""Matches that a group is grown about."""

ALIKE = 0.1
"""Root mean square distance between two poses of the source below which they are one, in sizes."""


@dataclass(frozen=True, eq=False)
class Hypotheses:
    """Poses (K, 4, 4), source to target, and a score (K,) of each, descending."""

    poses: Array
    scores: Array


@dataclass(frozen=True, eq=False)
class Matched:
    """Two clouds described with the same edge, and the two ends of the matches between them."""

    source: Features
    target: Features
    ends: tuple[Oriented, Oriented]

    @classmethod
    def of(cls, source: Features, target: Features) -> Matched:
        """Match the features of two clouds."""
        pairs = match(source.values, target.values, MATCHES)
        ends = (
            Oriented(source.points[pairs.source], source.normals[pairs.source]),
            Oriented(target.points[pairs.target], target.normals[pairs.target]),
        )
        return cls(source, target, ends)


@stage("features")
def hypotheses(
    source_points: Array,
    source_normals: Array,
    target_points: Array,
    target_normals: Array,
    oriented: bool,
    count: int = 200,
) -> Hypotheses:
    """Find up to ``count`` poses that lay one surface on the other, wherever they stand.

    No chance is involved: the same clouds give the same poses.

    Parameters
    ----------
    source_points, source_normals, target_points, target_normals
        (M, 3) and (N, 3): points, metres, and unit normals (zero where there is none).
    oriented
        Whether the normals' signs mean something: towards the sensor.
    """
    workers = threads.current()
    found = workers.map(lambda places: common_edge(source_points, target_points, places), PLACES)
    edges = sorted(set(found))
    sides = (source_points, source_normals), (target_points, target_normals)
    described = workers.map(
        lambda one: describe(*one[0], one[1], oriented),
        [(side, edge) for edge in edges for side in sides],
    )
    levels = workers.map(
        lambda both: Matched.of(*both), list(zip(described[::2], described[1::2], strict=True))
    )
    return among(levels, oriented, count)


def among(levels: Sequence[Matched], oriented: bool, count: int) -> Hypotheses:
    """Find poses between two clouds that were matched on one or more levels."""
    found = threads.current().map(lambda level: _distinct_motions(level, count), levels)
    poses = np.concatenate(found)
    if len(poses) == 0:
        return Hypotheses(poses, np.empty(0))
    agreement = Agreement(levels[0].source, levels[0].target, oriented)
    poses = agreement.settled(poses)
    matches = sum(explained(poses, *level.ends, level.source.edge) for level in levels)
    scores = agreement.score(poses, np.asarray(matches))
    rows = _different(poses, scores, levels[0].source.points, count)
    return Hypotheses(poses[rows], scores[rows])


def _distinct_motions(level: Matched, count: int) -> Array:
    poses, worth = motions(*level.ends, level.source.edge, SEEDS)
    return poses[_different(poses, worth, level.source.points, count)]


def _different(poses: Array, worth: Array, points: Array, count: int) -> NDArray[np.int64]:
    """Rows of up to ``count`` poses, the worthiest first, that lay the points differently."""
    from hmrf_icp.kernels.poses import distinct

    corners, size = spread(points)
    apart = ALIKE * size * float(np.sqrt(len(corners)))
    order = np.argsort(-worth, kind="stable")
    return np.asarray(distinct(placed(poses, corners), order, apart, count))


def spread(points: Array) -> tuple[Array, float]:
    """Six points with the mean and the covariance of all (M, 3), and their size, metres.

    Over them two poses are as far apart as over the whole cloud, in the root mean square.
    """
    middle = points.mean(axis=0)
    values, axes = np.linalg.eigh(np.cov(points.T, bias=True))
    arms = np.sqrt(3.0 * np.maximum(values, 0.0)) * axes
    return np.concatenate([middle + arms.T, middle - arms.T]), float(np.sqrt(values.sum()))


def placed(poses: Array, points: Array) -> Array:
    """Coordinates (K, 3 N) of the points (N, 3) at each of the poses (K, 4, 4)."""
    moved = np.einsum("kij,nj->kni", poses[:, :3, :3], points) + poses[:, None, :3, 3]
    return np.asarray(moved.reshape(len(poses), 3 * len(points)))
