"""How many points of a cloud others hide from a place."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import njit

STEEPEST = 0.2
"""Cosine of incidence below which a surface counts as no steeper."""


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
        for i in range(count):
            x = points[i, 0] - places[k, 0]
            y = points[i, 1] - places[k, 1]
            z = points[i, 2] - places[k, 2]
            r = math.sqrt(x * x + y * y + z * z) + 1e-300
            row = int((math.asin(min(1.0, max(-1.0, z / r))) + 0.5 * math.pi) / step)
            width = math.cos((row + 0.5) * step - 0.5 * math.pi)
            column = int((math.atan2(y, x) + math.pi) * max(width, 0.0) / step)
            reach[i] = r
            cell[i] = row * columns + column
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
