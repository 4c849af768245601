"""How many points of a cloud others hide from a place."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import njit

STEEPEST = 0.2
"""Cosine of incidence below which a surface counts as no steeper."""


@njit(error_model="numpy", inline="always")
def angle(y: float, x: float) -> float:
    """Angle of (x, y) as ``atan2`` has it, to 1e-4 radians: cells are a hundred times as wide."""
    low, high = min(abs(x), abs(y)), max(abs(x), abs(y))
    a = low / max(high, 1e-300)
    s = a * a
    # Hastings, "Approximations for Digital Computers" (1955), sheet 9, of fewer terms.
    r = a * (0.9998660 + s * (-0.3302995 + s * (0.1801410 + s * (-0.0851330 + s * 0.0208351))))
    if abs(y) > abs(x):
        r = 0.5 * math.pi - r
    if x < 0.0:
        r = math.pi - r
    return -r if y < 0.0 else r


@njit(error_model="numpy")
def hidden_shares(points: Any, normals: Any, margin: float, places: Any, steps: Any) -> Any:
    """Share of the points (M, 3) that are hidden from each of the places (K, 3).

    A point is hidden where another stands in front of it, in the same cell of directions,
    by more than ``margin`` (metres) and what its surface recedes over the cell. ``steps``
    (K,) are the edges of the cells, radians.
    """
    count = points.shape[0]
    reach = np.empty(count)
    cell = np.empty(count, np.int64)
    shares = np.empty(places.shape[0])
    for k in range(places.shape[0]):
        step = steps[k]
        rows = int(math.pi / step) + 1
        columns = int(2.0 * math.pi / step) + 1
        nearest = np.full(rows * columns, np.inf)
        wide = np.empty(rows)
        for i in range(rows):
            wide[i] = max(math.cos((i + 0.5) * step - 0.5 * math.pi), 0.0)
        for i in range(count):
            x = points[i, 0] - places[k, 0]
            y = points[i, 1] - places[k, 1]
            z = points[i, 2] - places[k, 2]
            across = x * x + y * y
            r = math.sqrt(across + z * z) + 1e-300
            row = max(int((angle(z, math.sqrt(across)) + 0.5 * math.pi) / step), 0)
            column = max(int((angle(y, x) + math.pi) * wide[min(row, rows - 1)] / step), 0)
            reach[i] = r
            cell[i] = min(row, rows - 1) * columns + min(column, columns - 1)
            nearest[cell[i]] = min(nearest[cell[i]], r)
        hidden = 0
        for i in range(count):
            x = points[i, 0] - places[k, 0]
            y = points[i, 1] - places[k, 1]
            z = points[i, 2] - places[k, 2]
            cosine = abs(x * normals[i, 0] + y * normals[i, 1] + z * normals[i, 2]) / reach[i]
            recedes = step * reach[i] / max(cosine, STEEPEST)
            if reach[i] > nearest[cell[i]] + margin + recedes:
                hidden += 1
        shares[k] = hidden / count
    return shares
