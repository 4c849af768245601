"""One point for every cell of a grid of cubes, in one pass: a hash table of the cells in use."""

from __future__ import annotations

from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import njit

COMPILED: Any = {"nogil": True, "error_model": "numpy"}


@njit(**COMPILED)
def bounds(points: Any) -> Any:
    """Smallest and largest coordinates of points (M, 3), M of 1 or more; (3,) each.

    NumPy takes ten times as long over rows of three.
    """
    low, high = points[0].copy(), points[0].copy()
    for i in range(1, points.shape[0]):
        for axis in range(3):
            low[axis] = min(low[axis], points[i, axis])
            high[axis] = max(high[axis], points[i, axis])
    return low, high


@njit(**COMPILED)
def slot(keys: Any, used: Any, a: int, b: int, c: int) -> int:
    """Find the place of cell (a, b, c) in an open table of 2^n entries, or the free one for it."""
    mask = np.uint64(used.size - 1)
    mixed = np.uint64(a) * np.uint64(0x9E3779B97F4A7C15)
    mixed ^= np.uint64(b) * np.uint64(0xC2B2AE3D27D4EB4F)
    mixed ^= np.uint64(c) * np.uint64(0x165667B19E3779F9)
    mixed ^= mixed >> np.uint64(32)
    mixed *= np.uint64(0xD6E8FEB86659FD93)
    mixed ^= mixed >> np.uint64(32)
    at = np.int64(mixed & mask)
    while used[at] >= 0 and not (keys[at, 0] == a and keys[at, 1] == b and keys[at, 2] == c):
        at = (at + 1) & np.int64(mask)
    return at


@njit(**COMPILED)
def first_of_each(points: Any, corner: Any, edge: float, most: int, owner: Any) -> Any:
    """Rows of the points (M, 3) that come first in their cell of ``edge``, in order.

    Parameters
    ----------
    points
        Finite, and ``corner`` (3,) is below all of them.
    edge
        Large enough that the cells can be counted in 63 bits along each axis.
    most
        Cells after which it gives up; one row more than that is returned then.
    owner
        (M,) int32 to write the number of each point's cell to, or empty. Cells are numbered
        as their rows are returned.
    """
    size = 64
    keys = np.empty((size, 3), np.int64)
    used = np.full(size, -1, np.int32)
    rows = np.empty(32, np.int64)
    count = 0
    at = np.int64(0)
    there = False
    for i in range(points.shape[0]):
        a = np.int64((points[i, 0] - corner[0]) / edge)
        b = np.int64((points[i, 1] - corner[1]) / edge)
        c = np.int64((points[i, 2] - corner[2]) / edge)
        # Points come along lines of a scan: most are in the cell of the one before.
        if there and keys[at, 0] == a and keys[at, 1] == b and keys[at, 2] == c:
            if owner.size > 0:
                owner[i] = used[at]
            continue
        at = slot(keys, used, a, b, c)
        there = True
        if used[at] < 0:
            keys[at, 0], keys[at, 1], keys[at, 2] = a, b, c
            used[at] = count
            rows[count] = i
            count += 1
            if count > most:
                break
            if 2 * count == size:
                keys, used = larger(keys, used)
                size = used.size
                more = np.empty(size // 2, np.int64)
                more[:count] = rows[:count]
                rows = more
                at = slot(keys, used, a, b, c)
        if owner.size > 0:
            owner[i] = used[at]
    return rows[:count]


@njit(**COMPILED)
def larger(keys: Any, used: Any) -> Any:
    """Move a table into one of twice the size."""
    wider = np.empty((2 * used.size, 3), np.int64)
    taken = np.full(2 * used.size, -1, np.int32)
    for k in range(used.size):
        if used[k] >= 0:
            at = slot(wider, taken, keys[k, 0], keys[k, 1], keys[k, 2])
            wider[at, 0], wider[at, 1], wider[at, 2] = keys[k, 0], keys[k, 1], keys[k, 2]
            taken[at] = used[k]
    return wider, taken
