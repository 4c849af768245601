"""The grid of an E57 scan: rows and columns that its points name become pixels again."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

INDICES = ("rowIndex", "columnIndex")

FULL = 0.5
"""Least share of the pixels that have a record: of a scan that was thinned out afterwards the
neighbours are gone, and its points are a list."""


class Grid(NamedTuple):
    """Where the records of a scan stand.

    Attributes
    ----------
    height, width
        Pixels, each at least two.
    cell
        (N,) pixel of each record, row after row.
    """

    height: int
    width: int
    cell: NDArray[np.int64]

    def laid(self, values: NDArray[Any], kept: NDArray[np.bool_]) -> NDArray[Any]:
        """Lay values of the records that are kept, (N, ...), out as (H, W, ...): else NaN or 0."""
        fill = np.nan if values.dtype.kind == "f" else 0
        grid = np.full((self.height * self.width, *values.shape[1:]), fill, values.dtype)
        grid[self.cell[kept]] = values[kept]
        return grid.reshape(self.height, self.width, *values.shape[1:])


def grid_of(rows: NDArray[np.float64], columns: NDArray[np.float64]) -> Grid | None:
    """Find the grid that records stand on by their rows and columns, (N,) each.

    None where they are no whole numbers, two records share a pixel (several returns of a
    pulse), there is a single row or column, or less than :data:`FULL` of the pixels have one.
    """
    sizes, places = [], []
    for values in (rows, columns):
        if not values.size or not np.isfinite(values).all():
            return None
        low, high = float(values.min()), float(values.max())
        if not 0.0 <= low <= high < 2.0**31 or (values != np.rint(values)).any():
            return None
        sizes.append(int(high - low) + 1)
        places.append((values - low).astype(np.int64))
    height, width = sizes
    if min(sizes) < 2 or rows.size < FULL * height * width:
        return None
    cell = places[0] * width + places[1]
    if np.bincount(cell, minlength=height * width).max() > 1:
        return None
    return Grid(height, width, cell)
