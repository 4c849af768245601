"""A table of space: a few points of a cloud, and for every cell of a grid the closest of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.surface import Surface, evenly
from hmrf_icp.stages import stage

Array = NDArray[np.float64]

LEAST_SIDE = 1e-6
"""Longest side of the box at the least, as a share of the surface's size: points may coincide."""


@dataclass(frozen=True, eq=False)
class ClosestTable:
    """A few points of a cloud, with a table of space that knows the closest of them.

    Attributes
    ----------
    points, normals
        (N, 3) metres, and unit vectors.
    table
        (A, B, C) a row of ``points`` for every cell, as :mod:`hmrf_icp.kernels.table` has them.
    corner
        (3,) corner of the first cell, metres.
    edge
        Edge of every cell, metres.
    """

    points: Array
    normals: Array
    table: NDArray[np.int32]
    corner: Array
    edge: float

    @classmethod
    @stage("table of space")
    def of(cls, surface: Surface, count: int, cells: int, margin: int) -> ClosestTable:
        """Choose about ``count`` points evenly by area, and lay the table round them.

        Parameters
        ----------
        surface
            Of the cloud.
        count
            Points that take part.
        cells
            Cells along the longest side of the box round these points.
        margin
            Cells beyond the box on every side.
        """
        from hmrf_icp.kernels import table

        rows = evenly(surface, count)
        points = surface.points[rows]
        if len(rows) == 0:
            # No surface, no matches: one cell that knows of nobody.
            nobody = np.full((1, 1, 1), -1, np.int32)
            return cls(points, surface.normals[rows], nobody, np.zeros(3), 1.0)
        low, high = points.min(axis=0), points.max(axis=0)
        edge = max(float((high - low).max()), LEAST_SIDE * surface.size) / cells
        # The outermost points stand in the middle of their cells: on an edge between two,
        # rounding would say which is theirs, and in other units another one.
        corner = low - (margin + 0.5) * edge
        shape = np.floor((high - low) / edge + 2 * margin + 1.5).astype(np.int64)
        laid = table.build(points, corner, edge, tuple(int(n) for n in shape))
        return cls(points, surface.normals[rows], laid, corner, edge)
