"""A table of space: for every cell of a grid, a target point that is (almost) the closest.

A search tree answers exactly, one question at a time; the search over starts
asks a million times and can do with the closest point of the cell.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import njit


@njit(nogil=True, error_model="numpy")
def closest(points: Any, k: int, x: float, y: float, z: float) -> float:
    """Square of the distance of point k to (x, y, z)."""
    return (points[k, 0] - x) ** 2 + (points[k, 1] - y) ** 2 + (points[k, 2] - z) ** 2


@njit(nogil=True, error_model="numpy")
def build(points: Any, corner: Any, edge: float, shape: Any) -> Any:
    """Propagate the points (N, 3) from their own cells to all, in four sweeps.

    Each sweep hands every cell the closest points of the seven neighbours
    behind it and of three to its sides (a chamfer transform that carries the
    point instead of a distance). Work: 40 comparisons a cell.
    """
    nx, ny, nz = shape
    table = np.full((nx, ny, nz), -1, np.int32)
    best = np.full((nx, ny, nz), np.inf, np.float32)
    for k in range(points.shape[0]):
        a = int((points[k, 0] - corner[0]) / edge)
        b = int((points[k, 1] - corner[1]) / edge)
        c = int((points[k, 2] - corner[2]) / edge)
        x, y, z = (
            corner[0] + (a + 0.5) * edge,
            corner[1] + (b + 0.5) * edge,
            corner[2] + (c + 0.5) * edge,
        )
        d = closest(points, k, x, y, z)
        if d < best[a, b, c]:
            best[a, b, c] = d
            table[a, b, c] = k
    for sweep in range(4):
        s = -1 if sweep % 2 == 0 else 1
        for ia in range(nx):
            a = ia if s < 0 else nx - 1 - ia
            for ib in range(ny):
                b = ib if s < 0 else ny - 1 - ib
                for ic in range(nz):
                    c = ic if s < 0 else nz - 1 - ic
                    x = corner[0] + (a + 0.5) * edge
                    y = corner[1] + (b + 0.5) * edge
                    z = corner[2] + (c + 0.5) * edge
                    low, at = best[a, b, c], table[a, b, c]
                    for m in range(1, 11):
                        if m < 8:
                            aa = a + (s if m & 1 else 0)
                            bb = b + (s if m & 2 else 0)
                            cc = c + (s if m & 4 else 0)
                        else:
                            aa = a + (-s if m == 8 else s)
                            bb = b + (-s if m == 9 else s)
                            cc = c + (-s if m == 10 else s)
                        if aa < 0 or bb < 0 or cc < 0 or aa >= nx or bb >= ny or cc >= nz:
                            continue
                        k = table[aa, bb, cc]
                        if k < 0 or k == at:
                            continue
                        d = closest(points, k, x, y, z)
                        if d < low:
                            low, at = d, k
                    best[a, b, c] = low
                    table[a, b, c] = at
    return table


@njit(nogil=True, error_model="numpy")
def look_up(points: Any, table: Any, corner: Any, edge: float, x: float, y: float, z: float) -> int:
    """Return the index of a close point, the closest of four cells' about (x, y, z); -1 outside."""
    nx, ny, nz = table.shape
    fa, fb, fc = (x - corner[0]) / edge, (y - corner[1]) / edge, (z - corner[2]) / edge
    if fa < 0.0 or fb < 0.0 or fc < 0.0 or fa >= nx or fb >= ny or fc >= nz:
        return -1
    a, b, c = int(fa), int(fb), int(fc)
    k = table[a, b, c]
    if k < 0:
        return -1
    low = closest(points, k, x, y, z)
    aa = min(max(a + (1 if fa - a > 0.5 else -1), 0), nx - 1)
    bb = min(max(b + (1 if fb - b > 0.5 else -1), 0), ny - 1)
    cc = min(max(c + (1 if fc - c > 0.5 else -1), 0), nz - 1)
    for m in range(3):
        other = table[aa if m == 0 else a, bb if m == 1 else b, cc if m == 2 else c]
        if other != k and other >= 0:
            d = closest(points, other, x, y, z)
            if d < low:
                low, k = d, other
    return int(k)
