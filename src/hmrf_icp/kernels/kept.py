"""Matches that are kept from one iteration to the next."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import njit


@njit(error_model="numpy")
def keep(points: Any, before: Any, onto: Any, row: Any, bound: Any, most: float, far: Any) -> Any:
    """Tell which points (M, 3) must look for their match anew, having moved from ``before``.

    ``bound`` (M,) holds a distance that nothing is closer than; it shrinks by as much as a point
    moves. A match ``row`` (M,) of ``onto`` is kept where it is at ``most`` times the bound. Its
    distance goes to ``far`` (M,). Returns the others.
    """
    anew = np.empty(points.shape[0], np.int64)
    count = 0
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        a, b, c = x - before[i, 0], y - before[i, 1], z - before[i, 2]
        bound[i] -= math.sqrt(a * a + b * b + c * c)
        k = row[i]
        a, b, c = x - onto[k, 0], y - onto[k, 1], z - onto[k, 2]
        far[i] = math.sqrt(a * a + b * b + c * c)
        if not far[i] <= most * bound[i]:
            anew[count] = i
            count += 1
    return anew[:count]
