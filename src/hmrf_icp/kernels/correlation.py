"""What a correlation of two clouds needs: clouds laid into grids, and the peaks of what comes out.

Grids are cubes of N cells that wrap round: what leaves on one side enters on the other.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import ANY_ORDER, njit


@njit(error_model="numpy", fastmath=ANY_ORDER)
def lay(
    rotation: Any, points: Any, normals: Any, weight: Any, empty: Any, signed: bool, grid: Any
) -> None:
    """Lay a cloud, turned, into the channels of a grid (8, N, N, N); lengths are in cells.

    Channel 0 counts the points (M, 3), each shared by the eight cells around it. The next
    six say how they face, by their weight (M,): for ``signed`` normals the square of each
    coordinate, one channel for either sign, so that opposite surfaces have nothing in
    common; otherwise the product of the normal with itself, less a third of the identity, so that
    surfaces at random angles have nothing in common on average. The last marks the cells of
    the points (K, 3) that were seen to be empty.
    """
    n = grid.shape[1]
    root = math.sqrt(2.0)
    grid[:] = 0.0
    share = np.empty(6, np.float32)
    channel = np.empty(6, np.int64)
    for k in range(points.shape[0]):
        x, y, z = turned(rotation, points, k)
        a, b, c = turned(rotation, normals, k)
        if signed:
            used = 3
            share[0], channel[0] = a * a, 1 if a > 0.0 else 2
            share[1], channel[1] = b * b, 3 if b > 0.0 else 4
            share[2], channel[2] = c * c, 5 if c > 0.0 else 6
        else:
            used = 6
            share[0], share[1], share[2] = a * a - 1.0 / 3.0, b * b - 1.0 / 3.0, c * c - 1.0 / 3.0
            share[3], share[4], share[5] = root * a * b, root * a * c, root * b * c
            for m in range(6):
                channel[m] = m + 1
        i, j, l = math.floor(x), math.floor(y), math.floor(z)  # noqa: E741
        for corner in range(8):
            di, dj, dl = corner >> 2, (corner >> 1) & 1, corner & 1
            part = (
                (x - i if di else 1.0 - x + i)
                * (y - j if dj else 1.0 - y + j)
                * (z - l if dl else 1.0 - z + l)
            )
            ii, jj, ll = (i + di) % n, (j + dj) % n, (l + dl) % n
            grid[0, ii, jj, ll] += part
            part *= weight[k]
            for m in range(used):
                grid[channel[m], ii, jj, ll] += part * share[m]
    for k in range(empty.shape[0]):
        x, y, z = turned(rotation, empty, k)
        grid[7, math.floor(x + 0.5) % n, math.floor(y + 0.5) % n, math.floor(z + 0.5) % n] = 1.0


@njit(error_model="numpy", inline="always")
def turned(rotation: Any, vectors: Any, k: int) -> Any:
    """Return the coordinates of vector number k, turned."""
    a, b, c = vectors[k, 0], vectors[k, 1], vectors[k, 2]
    return (
        rotation[0, 0] * a + rotation[0, 1] * b + rotation[0, 2] * c,
        rotation[1, 0] * a + rotation[1, 1] * b + rotation[1, 2] * c,
        rotation[2, 0] * a + rotation[2, 1] * b + rotation[2, 2] * c,
    )


@njit(error_model="numpy")
def carve(points: Any, viewpoint: Any, corner: Any, edge: float, short: float, seen: Any) -> None:
    """Mark in ``seen`` (A, B, C) the cells that the rays to the points (M, 3) pass through.

    Rays end ``short`` metres before their point. ``corner`` (3,) is that of the first cell.
    The points are in the grid: however far off a ray began, it is in it for the last diagonal.
    """
    step = 0.7 * edge
    diagonal = edge * math.sqrt(seen.shape[0] ** 2 + seen.shape[1] ** 2 + seen.shape[2] ** 2)
    for k in range(points.shape[0]):
        a = points[k, 0] - viewpoint[0]
        b = points[k, 1] - viewpoint[1]
        c = points[k, 2] - viewpoint[2]
        reach = math.sqrt(a * a + b * b + c * c)
        first = max(0, int((reach - short - diagonal) / step))
        for m in range(first, max(0, int((reach - short) / step))):
            t = m * step / reach
            i = math.floor((viewpoint[0] + t * a - corner[0]) / edge)
            j = math.floor((viewpoint[1] + t * b - corner[1]) / edge)
            l = math.floor((viewpoint[2] + t * c - corner[2]) / edge)  # noqa: E741
            if 0 <= i < seen.shape[0] and 0 <= j < seen.shape[1] and 0 <= l < seen.shape[2]:
                seen[i, j, l] = True


@njit(error_model="numpy", fastmath=ANY_ORDER)
def multiply(moving: Any, fixed: Any, both: Any) -> None:
    """Write the spectra of agreement and of violation, (2, ...), from those of two grids.

    Agreement is of the channels that say how points face; violation of points of one
    cloud with what the other saw to be empty, and the reverse. All are flattened: (8, M).
    """
    for k in range(moving.shape[1]):
        total = np.conj(moving[1, k]) * fixed[1, k]
        for m in range(2, 7):
            total += np.conj(moving[m, k]) * fixed[m, k]
        both[0, k] = total
        both[1, k] = np.conj(moving[0, k]) * fixed[7, k] + np.conj(moving[7, k]) * fixed[0, k]


@njit(error_model="numpy")
def peaks(
    agree: Any, violated: Any, floor: float, most: int, ratio: Any, cell: Any, value: Any
) -> int:
    """Find the highest local maxima of (agreement + floor) / (violation + floor).

    The grids are (N, N, N), ``ratio`` is scratch of that shape. Writes ``cell`` (most, 3),
    with a parabola through the neighbours along each axis, and ``value`` (most,), the
    highest first; returns how many there are.
    """
    n = agree.shape[0]
    for i in range(n):
        for j in range(n):
            for k in range(n):
                ratio[i, j, k] = (max(agree[i, j, k], 0.0) + floor) / (
                    max(violated[i, j, k], 0.0) + floor
                )
    count = 0
    for i in range(n):
        for j in range(n):
            for k in range(n):
                here = ratio[i, j, k]
                if (count == most and here <= value[most - 1]) or not highest(ratio, i, j, k):
                    continue
                at = min(count, most - 1)
                while at > 0 and value[at - 1] < here:
                    value[at] = value[at - 1]
                    cell[at] = cell[at - 1]
                    at -= 1
                value[at] = here
                cell[at, 0], cell[at, 1], cell[at, 2] = i, j, k
                count = min(count + 1, most)
    for m in range(count):
        i, j, k = int(cell[m, 0]), int(cell[m, 1]), int(cell[m, 2])
        here = ratio[i, j, k]
        cell[m, 0] += vertex(ratio[i - 1, j, k], here, ratio[(i + 1) % n, j, k])
        cell[m, 1] += vertex(ratio[i, j - 1, k], here, ratio[i, (j + 1) % n, k])
        cell[m, 2] += vertex(ratio[i, j, k - 1], here, ratio[i, j, (k + 1) % n])
    return count


@njit(error_model="numpy")
def highest(ratio: Any, i: int, j: int, k: int) -> bool:
    """Tell whether no cell around is higher, nor one that comes first as high."""
    n = ratio.shape[0]
    here = ratio[i, j, k]
    for a in range(-1, 2):
        for b in range(-1, 2):
            for c in range(-1, 2):
                there = ratio[(i + a) % n, (j + b) % n, (k + c) % n]
                if there > here or (there == here and (a, b, c) < (0, 0, 0)):
                    return False
    return True


@njit(error_model="numpy")
def vertex(before: float, here: float, after: float) -> float:
    """Where the parabola through three values is highest, within half a step of the middle."""
    bend = before + after - 2.0 * here
    if bend >= 0.0:
        return 0.0
    return min(max(0.5 * (before - after) / bend, -0.5), 0.5)
