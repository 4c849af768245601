"""Fewer points that stand for all."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.cloud import PointCloud

if TYPE_CHECKING:
    from pykdtree.kdtree import KDTree


def downsample(cloud: PointCloud, most: int) -> PointCloud:
    """Thin a cloud out to about ``most`` points; the same cloud where it has no more.

    An organised cloud keeps every n-th row and column, so that it stays one;
    any other keeps one point of every cell of a grid of cubes, so that what is
    dense is thinned first.
    """
    if step(cloud, most) <= 1:
        return cloud
    return cloud.subsample(step(cloud, most)) if cloud.organised else _one_a_cell(cloud, most)


def step(cloud: PointCloud, most: int) -> int:
    """Keep every so manieth row and column, or, of other clouds, one of so many points."""
    share = math.prod(cloud.shape) / most if cloud.organised else len(cloud) / most
    return math.ceil(math.sqrt(share) if cloud.organised else share)


def representatives(
    cloud: PointCloud, few: PointCloud, tree: Callable[[], KDTree]
) -> NDArray[np.intp]:
    """Tell which point of a downsampled cloud stands for each observed one of the whole.

    Parameters
    ----------
    cloud, few
        A cloud, and what :func:`downsample` made of it.
    tree
        Builds the k-d tree of ``few`` where it is needed.

    Returns
    -------
    (M,) rows of the observed points of ``few``: the kept pixel of the same block, and the
    nearest point where there is none.
    """
    if not cloud.organised:
        return _nearest(cloud.observed_points, tree())
    place = np.full(few.shape, -1, dtype=np.intp)
    place[few.observed] = np.arange(len(few))
    height, width = cloud.shape
    by = math.ceil(height / few.shape[0])
    blocks = place.repeat(by, axis=0)[:height].repeat(by, axis=1)[:, :width]
    rows = blocks[cloud.observed]
    lost = rows < 0
    if lost.any():
        rows[lost] = _nearest(cloud.observed_points[lost], tree())
    return rows


def thinned(points: NDArray[np.float64], edge: float) -> NDArray[np.int64]:
    """Rows of the points (M, 3) that come first in their cell of ``edge`` metres; all if 0."""
    if not edge > 0:
        return np.arange(len(points))
    cell = np.floor((points - points.min(axis=0)) / edge).astype(np.int64)
    span = cell.max(axis=0) + 1
    key = (cell[:, 0] * span[1] + cell[:, 1]) * span[2] + cell[:, 2]
    _, first = np.unique(key, return_index=True)
    return np.sort(first)


def _one_a_cell(cloud: PointCloud, most: int) -> PointCloud:
    rows = thinned(cloud.observed_points, _edge(cloud.observed_points, most))
    return PointCloud(cloud.observed_points[rows], None, cloud.viewpoint)


def _edge(points: NDArray[np.float64], most: int) -> float:
    """Edge of the cells that leave about ``most`` points, by bisection, metres."""
    low, high = 0.0, float(np.ptp(points, axis=0).max())
    for _ in range(12):
        middle = 0.5 * (low + high) if low > 0.0 else 0.1 * high
        if len(thinned(points, middle)) > most:
            low = middle
        else:
            high = middle
    return high


def _nearest(points: NDArray[np.float64], tree: KDTree) -> NDArray[np.intp]:
    _, index = tree.query(points)
    return np.asarray(index.astype(np.intp))
