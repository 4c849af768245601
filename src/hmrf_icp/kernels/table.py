"""A table of space: for every cell of a grid, a target point that is (almost) the closest.

A search tree answers exactly, one question at a time; the search over starts
asks a million times and can do with the closest point of the cell.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import njit


@njit(error_model="numpy")
def squared_distance(points: Any, k: int, x: float, y: float, z: float) -> float:
    """Square of the distance of point k to (x, y, z)."""
    return (points[k, 0] - x) ** 2 + (points[k, 1] - y) ** 2 + (points[k, 2] - z) ** 2


def build(points: Any, corner: Any, edge: float, shape: tuple[int, ...]) -> Any:
    """Hand every cell the point of the closest cell that has one, then the best of its neighbours'.

    The closest cell is found exactly, one axis after the other: squared distances add up,
    so along each line it is the lowest of as many parabolas (Felzenszwalb and Huttenlocher,
    "Distance transforms of sampled functions", 2012). Work and memory grow with the cells.
    """
    table = np.full(shape, -1, np.int32)
    fill(points, corner, edge, table)
    squared = np.where(table < 0, np.float32(np.inf), np.float32(0.0))
    longest = max(shape)
    nx, ny, nz = shape
    # Made here: what a kernel allocates itself takes long to compile.
    scratch = (
        np.empty(longest, np.int64),
        np.empty(longest),
        np.empty(longest, np.int32),
        np.empty(longest, np.float32),
    )
    spread_all(table.reshape(-1), squared.reshape(-1), nx, ny, nz, *scratch)
    compare(points, corner, edge, table)
    return table


@njit(error_model="numpy")
def spread_all(
    cells: Any,
    squared: Any,
    nx: int,
    ny: int,
    nz: int,
    lowest: Any,
    begins: Any,
    line: Any,
    height: Any,
) -> None:
    """Spread along all lines of a table of nx, ny, nz cells, one axis after the other."""
    for a in range(nx):
        for b in range(ny):
            spread(cells, squared, (a * ny + b) * nz, 1, nz, lowest, begins, line, height)
    for a in range(nx):
        for c in range(nz):
            spread(cells, squared, a * ny * nz + c, nz, ny, lowest, begins, line, height)
    for b in range(ny):
        for c in range(nz):
            spread(cells, squared, b * nz + c, ny * nz, nx, lowest, begins, line, height)


@njit(error_model="numpy")
def fill(points: Any, corner: Any, edge: float, table: Any) -> None:
    """Put each point into its own cell; the one closest to the centre, where there are more."""
    nx, ny, nz = table.shape
    for k in range(points.shape[0]):
        a = int((points[k, 0] - corner[0]) / edge)
        b = int((points[k, 1] - corner[1]) / edge)
        c = int((points[k, 2] - corner[2]) / edge)
        if a < 0 or b < 0 or c < 0 or a >= nx or b >= ny or c >= nz:
            continue
        x = corner[0] + (a + 0.5) * edge
        y = corner[1] + (b + 0.5) * edge
        z = corner[2] + (c + 0.5) * edge
        there = table[a, b, c]
        if there < 0 or squared_distance(points, k, x, y, z) < squared_distance(
            points, there, x, y, z
        ):
            table[a, b, c] = k


@njit(error_model="numpy")
def spread(
    cells: Any,
    squared: Any,
    first: int,
    step: int,
    count: int,
    lowest: Any,
    begins: Any,
    line: Any,
    height: Any,
) -> None:
    """Along one line of cells, hand every cell what the cell of the lowest parabola has.

    The line is ``count`` cells from the ``first``, ``step`` apart. ``squared`` holds the squared
    distance, in cells, of what a cell has. The last four are scratch: the parabolas of the
    envelope, where each begins, and the line as it was.
    """
    parabolas = 0
    for i in range(count):
        line[i], height[i] = cells[first + i * step], squared[first + i * step]
        if line[i] < 0:
            continue
        begin = -np.inf
        while parabolas > 0:
            j = lowest[parabolas - 1]
            begin = (height[i] - height[j] + i * i - j * j) / (2.0 * (i - j))
            if begin > begins[parabolas - 1]:
                break
            parabolas -= 1
        lowest[parabolas] = i
        begins[parabolas] = begin if parabolas > 0 else -np.inf
        parabolas += 1
    if parabolas == 0:
        return
    at = 0
    for i in range(count):
        while at + 1 < parabolas and begins[at + 1] < i:
            at += 1
        j = lowest[at]
        cells[first + i * step], squared[first + i * step] = line[j], height[j] + (i - j) ** 2


@njit(error_model="numpy")
def compare(points: Any, corner: Any, edge: float, table: Any) -> None:
    """Let every cell take the point of one of its six neighbours where that is closer."""
    nx, ny, nz = table.shape
    for a in range(nx):
        for b in range(ny):
            for c in range(nz):
                k = table[a, b, c]
                x = corner[0] + (a + 0.5) * edge
                y = corner[1] + (b + 0.5) * edge
                z = corner[2] + (c + 0.5) * edge
                low = squared_distance(points, k, x, y, z)
                for m in range(6):
                    s = 2 * (m % 2) - 1
                    aa = a + (s if m < 2 else 0)
                    bb = b + (s if m // 2 == 1 else 0)
                    cc = c + (s if m > 3 else 0)
                    if aa < 0 or bb < 0 or cc < 0 or aa >= nx or bb >= ny or cc >= nz:
                        continue
                    other = table[aa, bb, cc]
                    if other != k:
                        d = squared_distance(points, other, x, y, z)
                        if d < low:
                            low, k = d, other
                table[a, b, c] = k


@njit(error_model="numpy")
def look_up(points: Any, table: Any, corner: Any, edge: float, x: float, y: float, z: float) -> int:
    """Return the index of a close point, the closest of four cells' about (x, y, z); -1 outside."""
    nx, ny, nz = table.shape
    fa, fb, fc = (x - corner[0]) / edge, (y - corner[1]) / edge, (z - corner[2]) / edge
    # Asked for what is inside, so that NaN is not.
    if not (0.0 <= fa < nx and 0.0 <= fb < ny and 0.0 <= fc < nz):
        return -1
    a, b, c = int(fa), int(fb), int(fc)
    k = table[a, b, c]
    if k < 0:
        return -1
    low = squared_distance(points, k, x, y, z)
    aa = min(max(a + (1 if fa - a > 0.5 else -1), 0), nx - 1)
    bb = min(max(b + (1 if fb - b > 0.5 else -1), 0), ny - 1)
    cc = min(max(c + (1 if fc - c > 0.5 else -1), 0), nz - 1)
    for m in range(3):
        other = table[aa if m == 0 else a, bb if m == 1 else b, cc if m == 2 else c]
        if other != k and other >= 0:
            d = squared_distance(points, other, x, y, z)
            if d < low:
                low, k = d, other
    return int(k)
