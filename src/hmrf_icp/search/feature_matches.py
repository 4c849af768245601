"""Matches between the features of two clouds: the nearest ones, both ways."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

BLOCK = 256
"""Source features whose products with all target features are held at a time."""


@dataclass(frozen=True, eq=False)
class FeatureMatches:
    """Rows of the source and of the target that may be the same place, the likeliest first.

    Attributes
    ----------
    source, target
        (N,) rows.
    mutual
        (N,) whether each is among the other's nearest.
    distance
        (N,) between the two features.
    """

    source: NDArray[np.int64]
    target: NDArray[np.int64]
    mutual: NDArray[np.bool_]
    distance: NDArray[np.float64]


def nearest(
    source: NDArray[np.float32], target: NDArray[np.float32], count: int
) -> tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.int64], NDArray[np.float32]]:
    """Nearest ``count`` target features of each source feature (M, D), and the other way round.

    Returns
    -------
    Rows (M, count) and squared distances, ascending; the same for the target (N, count).
    """
    from hmrf_icp.kernels.feature_matches import keep_nearest

    mine, theirs = ((side**2).sum(axis=1) for side in (source, target))
    row_near = np.full((len(source), count), np.inf, dtype=np.float32)
    row_index = np.zeros((len(source), count), dtype=np.int64)
    column_near = np.full((len(target), count), np.inf, dtype=np.float32)
    column_index = np.zeros((len(target), count), dtype=np.int64)
    across = np.ascontiguousarray(target.T)
    for first in range(0, len(source), BLOCK):
        keep_nearest(
            source[first : first + BLOCK] @ across,
            first,
            mine,
            theirs,
            row_near,
            row_index,
            column_near,
            column_index,
        )
    return row_index, row_near, column_index, column_near


def match(
    source: NDArray[np.float32], target: NDArray[np.float32], most: int, count: int = 1
) -> FeatureMatches:
    """Match features (M, D), (N, D): the nearest ``count`` either way, the best ``most`` of them.

    Mutual ones come first, then those whose features are closest.
    """
    count = min(count, len(source), len(target))
    there, there_apart, back, back_apart = nearest(source, target, count)
    mine = np.concatenate([np.repeat(np.arange(len(source)), count), back.ravel()])
    theirs = np.concatenate([there.ravel(), np.repeat(np.arange(len(target)), count)])
    apart = np.concatenate([there_apart.ravel(), back_apart.ravel()])
    _, first, times = np.unique(mine * len(target) + theirs, return_index=True, return_counts=True)
    mutual = times > 1
    order = np.lexsort((apart[first], ~mutual))[:most]
    rows = first[order]
    return FeatureMatches(
        mine[rows], theirs[rows], mutual[order], np.sqrt(np.maximum(apart[rows], 0.0))
    )
