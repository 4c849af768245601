"""Points that others hide, seen from a place."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import njit

SQUARE = 2.0
"""Edge of a face of the cube about a place, whose centre is at a distance of one."""

WIDEST = 6
"""Cells that a disc covers to each side of its centre at most: one before the eye is cut off."""


@njit(error_model="numpy")
def count_hidden(
    points: Any, normals: Any, spacing: Any, place: Any, margin: float, depth: Any, drawn: Any
) -> Any:
    """Count the points (N, 3) that discs about the others hide from ``place`` (3,).

    Every point carries a disc across its normal, half of its ``spacing`` (N,) in radius, that
    is drawn on the faces of a cube about the place. A point is hidden where it is farther than
    the nearest disc on its ray by more than ``margin`` of both spacings.

    ``depth`` (6, B, B) is what is drawn on, and ``drawn`` (6, B, B) the picture that a cell was
    drawn in last: it is larger by one after each, so that nothing has to be wiped.
    """
    size = depth.shape[1]
    edge = SQUARE / size
    picture = drawn[0, 0, 0] + 1
    drawn[0, 0, 0] = picture
    depth[0, 0, 0] = np.inf
    count = points.shape[0]
    cell = np.empty((count, 3), dtype=np.int32)
    for k in range(count):
        x, y, z = points[k, 0] - place[0], points[k, 1] - place[1], points[k, 2] - place[2]
        ax, ay, az = abs(x), abs(y), abs(z)
        if ax >= ay and ax >= az:
            face, a, b, c = (0 if x > 0 else 1), y, z, ax
        elif ay >= az:
            face, a, b, c = (2 if y > 0 else 3), z, x, ay
        else:
            face, a, b, c = (4 if z > 0 else 5), x, y, az
        c = max(c, 1e-300)
        u, v = a / c, b / c
        i = min(max(int((u + 1.0) / edge), 0), size - 1)
        j = min(max(int((v + 1.0) / edge), 0), size - 1)
        cell[k, 0], cell[k, 1], cell[k, 2] = face, i, j
        radius = 0.5 * spacing[k]
        across = min(int(radius / c / edge * 1.3 + 0.5), WIDEST)
        reach = math.sqrt(x * x + y * y + z * z)
        along = normals[k, 0] * x + normals[k, 1] * y + normals[k, 2] * z
        for p in range(max(i - across, 0), min(i + across + 1, size)):
            for q in range(max(j - across, 0), min(j + across + 1, size)):
                if p == i and q == j:
                    at = reach
                else:
                    s, t = (p + 0.5) * edge - 1.0, (q + 0.5) * edge - 1.0
                    if face < 2:
                        dx, dy, dz = (1.0 if face == 0 else -1.0), s, t
                    elif face < 4:
                        dx, dy, dz = t, (1.0 if face == 2 else -1.0), s
                    else:
                        dx, dy, dz = s, t, (1.0 if face == 4 else -1.0)
                    facing = normals[k, 0] * dx + normals[k, 1] * dy + normals[k, 2] * dz
                    if abs(facing) < 1e-9:
                        continue
                    to = along / facing
                    ox, oy, oz = to * dx - x, to * dy - y, to * dz - z
                    if to <= 0.0 or ox * ox + oy * oy + oz * oz > radius * radius:
                        continue
                    at = to * math.sqrt(1.0 + s * s + t * t)
                at += margin * spacing[k]
                if drawn[face, p, q] != picture or at < depth[face, p, q]:
                    drawn[face, p, q] = picture
                    depth[face, p, q] = at
    hidden = 0
    for k in range(count):
        x, y, z = points[k, 0] - place[0], points[k, 1] - place[1], points[k, 2] - place[2]
        reach = math.sqrt(x * x + y * y + z * z)
        if reach - margin * spacing[k] > depth[cell[k, 0], cell[k, 1], cell[k, 2]]:
            hidden += 1
    return hidden
