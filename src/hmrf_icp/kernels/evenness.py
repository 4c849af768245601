"""How unevenly points lie over the directions from a place."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import njit

GRAZING = 0.1
"""Least cosine between a ray and a normal: below it, the noise of the normal is what counts."""


@njit(error_model="numpy")
def unevenness(points: Any, normals: Any, log_area: Any, place: Any) -> Any:
    """Robust deviation of the logarithm of the solid angle that a point (N, 3) stands for.

    ``log_area`` (N,) is the logarithm of the area about each; seen from ``place`` (3,) it fills
    area * cosine / distance^2. A sensor's pixels, or beams, fill about the same each.
    """
    count = points.shape[0]
    angle = np.empty(count)
    for k in range(count):
        x, y, z = points[k, 0] - place[0], points[k, 1] - place[1], points[k, 2] - place[2]
        square = x * x + y * y + z * z + 1e-300
        along = abs(normals[k, 0] * x + normals[k, 1] * y + normals[k, 2] * z)
        cosine = max(along / math.sqrt(square), GRAZING)
        angle[k] = log_area[k] - math.log(square) + math.log(cosine)
    middle = np.median(angle)
    for k in range(count):
        angle[k] = abs(angle[k] - middle)
    return 1.4826 * np.median(angle)
