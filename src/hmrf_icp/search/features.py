"""Local features of a cloud at several scales, all of them shares of one edge."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.tree import Tree
from hmrf_icp.search.normal_signs import agreeing

Array = NDArray[np.float64]

SCALES = (5.0, 10.0)
"""Radii of a feature, in edges of the cells that the cloud is thinned to.

Measured on 30 pairs of 3DLoMatch: 110 features of 3,980 have their nearest at the right place
with the first alone, 92 with the second, 138 with both; 20 edges beside them add nothing.
"""

WITHIN = 5.0
"""Edges that the radius is long after thinning: larger features look at fewer points."""

SMOOTHED = 2.0
"""Radius of the plane fitted for a normal, in edges."""

PLACES = 4000
"""Features of a cloud, about: so the edge is chosen."""

FINEST = 1.5
"""Smallest edge in spacings of the coarser cloud: with less nothing is thinned."""


@dataclass(frozen=True, eq=False)
class Features:
    """Places of a cloud and what the surface looks like about them.

    Attributes
    ----------
    points, normals
        (N, 3) metres, and unit vectors whose signs agree with each other.
    values
        (N, D) features: distances between them mean something.
    edge
        Edge of the cells that there is one place of, metres.
    """

    points: Array
    normals: Array
    values: NDArray[np.float32]
    edge: float


@dataclass(frozen=True, eq=False)
class Grid:
    """Points and normals (M, 3) in the order of their cells, edge ``reach`` metres."""

    points: Array
    normals: Array
    cells: NDArray[np.int64]
    span: NDArray[np.int64]
    reach: float
    low: Array

    @classmethod
    def of(cls, points: Array, normals: Array, reach: float) -> Grid:
        """Sort points by the cells that they are in."""
        cells, span, low = cells_of(points, reach)
        order = np.argsort(cells, kind="stable")
        return cls(points[order], normals[order], cells[order], span, reach, low)

    @property
    def near(self) -> tuple[Any, Any, float, Any]:
        """What :func:`hmrf_icp.kernels.features.within` needs beside the points."""
        return self.cells, self.span, self.reach, self.low


def common_edge(source: Array, target: Array, places: int = PLACES) -> float:
    """Edge of the cells that leave about ``places`` points of a cloud, (M, 3) and (N, 3), metres.

    The same for both clouds, or their features would not be alike: the mean of the two counts.
    Not finer than the coarser of the two allows.
    """
    edge = float(max(np.ptp(source, axis=0).max(), np.ptp(target, axis=0).max())) / 64.0
    if not edge > 0.0:
        return 1.0
    for step in range(12):
        # A surface has a quarter of the cells at twice the edge; points far off take longer.
        count = 0.5 * sum(len(np.unique(cells_of(points, edge)[0])) for points in (source, target))
        edge *= float(np.sqrt(count / places))
        if step >= 2 and 0.5 * places < count:
            break
    return max(edge, FINEST * max(spacing(source), spacing(target)))


def spacing(points: Array, sample: int = 1000) -> float:
    """Median distance of points (M, 3) to their nearest neighbour, of some of them, metres."""
    some = points[:: max(1, len(points) // sample)]
    distance, _ = Tree(points).query(some, k=min(2, len(points)))
    return float(np.median(distance.reshape(len(some), -1)[:, -1]))


def cells_of(points: Array, edge: float) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Return the cell (M,) of each point (M, 3), how many along each axis, and the corner."""
    low = points.min(axis=0)
    place = ((points - low) / edge).astype(np.int64)
    span = place.max(axis=0) + 1
    return (place[:, 0] * span[1] + place[:, 1]) * span[2] + place[:, 2], span, low


def thinned(points: Array, normals: Array, edge: float) -> tuple[Array, Array]:
    """Mean point and normal of each cell of ``edge`` metres: (N, 3), (N, 3)."""
    from hmrf_icp.kernels import features

    cells, _, _ = cells_of(points, edge)
    order = np.argsort(cells, kind="stable")
    starts = np.flatnonzero(np.diff(cells[order], prepend=-1, append=-1))
    where, facing = features.thin(points, normals, starts, order)
    return np.asarray(where), np.asarray(facing)


def describe(points: Array, normals: Array, edge: float, oriented: bool) -> Features:
    """Thin a cloud (M, 3) out to cells of ``edge`` metres, and describe every place that is left.

    Fast point feature histograms (Rusu et al., ICRA 2009) at each of the ``SCALES``. Their root
    is compared: it counts a vote more where there are few.

    Parameters
    ----------
    normals
        (M, 3) unit normals; zero where there is none.
    oriented
        Whether their signs mean something; otherwise they are given some.
    """
    from hmrf_icp.kernels import features

    grid = Grid.of(*thinned(points, normals, edge), SMOOTHED * edge)
    points = grid.points
    normals = np.asarray(features.smooth_normals(points, grid.normals, *grid.near))
    if not oriented:
        normals = agreeing(points, normals, edge)
    values = [_histograms(points, normals, edge, scale) for scale in SCALES]
    return Features(points, normals, np.sqrt(np.concatenate(values, axis=1)), edge)


def _histograms(points: Array, normals: Array, edge: float, scale: float) -> NDArray[np.float32]:
    """FPFH (N, 33) at the points (N, 3), of what is within ``scale`` edges."""
    from hmrf_icp.kernels import features

    near = points, normals
    if scale > WITHIN:
        near = thinned(points, normals, edge * scale / WITHIN)
    grid = Grid.of(*near, scale * edge)
    simple = features.simple(grid.points, grid.normals, *grid.near)
    return np.asarray(features.gather(simple, grid.points, *grid.near, points))
