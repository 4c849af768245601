"""Poses that may be right, from local features alone: many, diverse, the likeliest first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.search.consistent_groups import Oriented, motions
from hmrf_icp.search.feature_matches import match
from hmrf_icp.search.features import Features, common_edge, describe
from hmrf_icp.search.surface_agreement import Agreement

Array = NDArray[np.float64]

MATCHES = 5000
"""Matches that are held against each other: the work grows with the square."""

SEEDS = 1500
"""Matches that a group is grown about."""

ALIKE = 0.1
"""Root mean square distance between two poses of the source below which they are one, in sizes."""


@dataclass(frozen=True, eq=False)
class Hypotheses:
    """Poses (K, 4, 4), source to target, and a score (K,) of each, descending."""

    poses: Array
    scores: Array


def hypotheses(
    source_points: Array,
    source_normals: Array,
    target_points: Array,
    target_normals: Array,
    oriented: bool,
    count: int = 200,
    edge: float | None = None,
) -> Hypotheses:
    """Find up to ``count`` poses that lay one surface on the other, wherever they stand.

    Parameters
    ----------
    source_points, source_normals, target_points, target_normals
        (M, 3) and (N, 3): points, metres, and unit normals (zero where there is none).
    oriented
        Whether the normals' signs mean something: towards the sensor.
    edge
        Of the cells that both are thinned to, metres. None chooses one for about 4,000 places.
    """
    if edge is None:
        edge = common_edge(source_points, target_points)
    source = describe(source_points, source_normals, edge, oriented)
    target = describe(target_points, target_normals, edge, oriented)
    return from_features(source, target, oriented, count)


def from_features(source: Features, target: Features, oriented: bool, count: int) -> Hypotheses:
    """Find poses between two clouds that were described with the same edge."""
    from hmrf_icp.kernels.poses import distinct

    pairs = match(source.values, target.values, MATCHES)
    poses, explained = motions(
        Oriented(source.points[pairs.source], source.normals[pairs.source]),
        Oriented(target.points[pairs.target], target.normals[pairs.target]),
        source.edge,
        SEEDS,
    )
    if len(poses) == 0:
        return Hypotheses(np.empty((0, 4, 4)), np.empty(0))
    corners, size = spread(source.points)
    order = np.argsort(-explained, kind="stable")
    apart = ALIKE * size * np.sqrt(len(corners))
    rows = distinct(placed(poses, corners), order, apart, 2 * count)
    poses, explained = poses[rows], explained[rows]
    agreement = Agreement(source, target, oriented)
    poses = agreement.settled(poses)
    scores = agreement.score(poses, explained)
    rows = distinct(placed(poses, corners), np.argsort(-scores, kind="stable"), apart, count)
    return Hypotheses(poses[rows], scores[rows])


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
    return np.asarray(moved.reshape(len(poses), -1))
