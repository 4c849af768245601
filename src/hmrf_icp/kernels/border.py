"""Points at the border of a surface: neighbours on one side only."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import njit


@njit(error_model="numpy")
def find_border(points: Any, normals: Any, neighbours: Any, gap: float, border: Any) -> None:
    """Write for each point (N, 3) whether its neighbours (N, K) leave a gap round it.

    A gap is an angle of more than ``gap`` radians in the tangent plane in which none lies. A
    point without a normal counts as one at the border.
    """
    count = neighbours.shape[1]
    angle = np.empty(count)
    for i in range(points.shape[0]):
        nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
        if abs(nx) < 0.9:
            ux, uy, uz = 0.0, nz, -ny
        else:
            ux, uy, uz = -nz, 0.0, nx
        length = math.sqrt(ux * ux + uy * uy + uz * uz)
        border[i] = True
        if length <= 0.0:
            continue
        ux, uy, uz = ux / length, uy / length, uz / length
        vx, vy, vz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
        for k in range(count):
            j = neighbours[i, k]
            x = points[j, 0] - points[i, 0]
            y = points[j, 1] - points[i, 1]
            z = points[j, 2] - points[i, 2]
            angle[k] = math.atan2(vx * x + vy * y + vz * z, ux * x + uy * y + uz * z)
        angle.sort()
        widest = angle[0] + 2.0 * math.pi - angle[count - 1]
        for k in range(1, count):
            widest = max(widest, angle[k] - angle[k - 1])
        border[i] = widest > gap
