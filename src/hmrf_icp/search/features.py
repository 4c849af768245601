"""Local features of a cloud at several scales, all of them shares of one edge that is given."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RADIUS = 5.0
"""Radius of a feature, in edges of the cells that its neighbours were thinned to."""


@dataclass(frozen=True, eq=False)
class Grid:
    """Points sorted by the cells of a grid of cubes."""

    points: Array
    normals: Array
    cells: NDArray[np.int64]
    span: NDArray[np.int64]
    reach: float
    low: Array

    @property
    def near(self) -> tuple[Any, ...]:
        return self.cells, self.span, self.reach, self.low


def cells_of(points: Array, edge: float) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    low = points.min(axis=0)
    place = np.floor((points - low) / edge).astype(np.int64)
    span = place.max(axis=0) + 1
    return (place[:, 0] * span[1] + place[:, 1]) * span[2] + place[:, 2], span, low


def thinned(points: Array, normals: Array, edge: float) -> tuple[Array, Array]:
    """Mean point and normal of each cell of ``edge`` metres: (N, 3), (N, 3)."""
    from hmrf_icp.kernels import features

    cells, _, _ = cells_of(points, edge)
    order = np.argsort(cells, kind="stable")
    starts = np.flatnonzero(np.diff(cells[order], prepend=-1, append=-1))
    return features.thin(points, normals, starts, order)


def grid(points: Array, normals: Array, reach: float) -> Grid:
    cells, span, low = cells_of(points, reach)
    order = np.argsort(cells, kind="stable")
    return Grid(points[order], normals[order], cells[order], span, reach, low)


def smoothed(points: Array, normals: Array, reach: float) -> tuple[Array, Array]:
    from hmrf_icp.kernels import features

    sorted_ = grid(points, normals, reach)
    return sorted_.points, features.smooth_normals(sorted_.points, sorted_.normals, *sorted_.near)


def histograms(at: Array, points: Array, normals: Array, reach: float) -> NDArray[np.float32]:
    """FPFH (K, 33) at the places ``at`` (K, 3), of points with normals within ``reach`` metres."""
    from hmrf_icp.kernels import features

    sorted_ = grid(points, normals, reach)
    simple = features.simple(sorted_.points, sorted_.normals, *sorted_.near)
    return features.gather(simple, sorted_.points, *sorted_.near, at)
