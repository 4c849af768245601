"""Fewer points that stand for all."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import kept
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.surface import thinned
from hmrf_icp.loop.match import tree_of


def reduced(cloud: PointCloud, most: int) -> PointCloud:
    """Thin a cloud out to about ``most`` points; the same cloud where it has no more.

    An organised cloud keeps every n-th row and column, so that it stays one;
    any other keeps one point of every cell of a grid of cubes, so that what is
    dense is thinned first.
    """
    if cloud.organised:
        step = _step(cloud, most)
        if step <= 1:
            return cloud
        return kept.once(cloud, ("reduced", step), lambda: cloud.subsample(step))
    if len(cloud) <= most:
        return cloud
    return kept.once(cloud, ("reduced", most), lambda: _one_a_cell(cloud, most))


def standing(cloud: PointCloud, most: int) -> NDArray[np.intp]:
    """Tell which point of the reduced cloud stands for each observed one of the whole.

    Returns
    -------
    (M,) rows of the observed points that ``reduced(cloud, most)`` keeps.
    """
    few = reduced(cloud, most)
    if few is cloud:
        return np.arange(len(cloud))
    if cloud.organised:
        return _standing_in_image(cloud, few, _step(cloud, most))
    return _standing(cloud.observed_points, few)


def _step(cloud: PointCloud, most: int) -> int:
    return math.ceil(math.sqrt(math.prod(cloud.shape) / most))


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


def _standing(points: NDArray[np.float64], few: PointCloud) -> NDArray[np.intp]:
    """Row of the nearest kept point for each of the points (M, 3)."""
    _, index = tree_of(few).query(points)
    return np.asarray(index.astype(np.intp))


def _standing_in_image(cloud: PointCloud, few: PointCloud, step: int) -> NDArray[np.intp]:
    """Row of the kept pixel of the same block; of the nearest point where that saw nothing."""
    place = np.full(few.shape, -1, dtype=np.intp)
    place[few.observed] = np.arange(len(few))
    height, width = cloud.shape
    blocks = place.repeat(step, axis=0)[:height].repeat(step, axis=1)[:, :width]
    rows = blocks[cloud.observed]
    lost = rows < 0
    if lost.any():
        rows[lost] = _standing(cloud.observed_points[lost], few)
    return rows
