"""Building neighbour graphs: symmetric edges, balanced weights, colours."""

from __future__ import annotations

from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import njit

COMPILED: Any = {"nogil": True, "error_model": "numpy"}


@njit(**COMPILED)
def mutual_or_either(nearest: Any) -> Any:
    """Rows of a symmetric graph from nearest neighbours (M, k): i ~ i' if either names the other.

    A negative entry, or one that names its own row, is no neighbour. The neighbours
    of a row come in rising order.
    """
    rows, k = nearest.shape
    degree = np.zeros(rows + 1, np.int64)
    for i in range(rows):
        for a in range(k):
            j = nearest[i, a]
            if j < 0 or j == i:
                continue
            degree[i + 1] += 1
            if not named(nearest, j, i):
                degree[j + 1] += 1
    indptr = np.cumsum(degree)
    filled = indptr[:-1].copy()
    indices = np.empty(indptr[-1], np.int32)
    for i in range(rows):
        for a in range(k):
            j = nearest[i, a]
            if j < 0 or j == i:
                continue
            indices[filled[i]] = j
            filled[i] += 1
            if not named(nearest, j, i):
                indices[filled[j]] = i
                filled[j] += 1
    for i in range(rows):
        indices[indptr[i] : indptr[i + 1]].sort()
    return indptr, indices


@njit(**COMPILED)
def named(nearest: Any, i: Any, j: Any) -> bool:
    """Whether row i names j."""
    for a in range(nearest.shape[1]):  # noqa: SIM110  (Numba compiles the loop, not any())
        if nearest[i, a] == j:
            return True
    return False


@njit(**COMPILED)
def balanced_weights(indptr: Any, indices: Any, total: float, rounds: int) -> Any:
    """Symmetric weights x_i x_i' whose rows sum to ``total`` as far as that can be, never to more.

    Each round takes the geometric mean of x and of what would make its row
    right (symmetric Sinkhorn scaling). Rows that a graph cannot balance, such
    as the points of a star, are left short.
    """
    rows = indptr.size - 1
    x, row = np.ones(rows), np.empty(rows)
    for i in range(rows):
        x[i] = np.sqrt(total / max(indptr[i + 1] - indptr[i], 1))
    for _ in range(rounds):
        for i in range(rows):
            around = 0.0
            for k in range(indptr[i], indptr[i + 1]):
                around += x[indices[k]]
            row[i] = np.sqrt(x[i] * total / around) if around > 0.0 else x[i]
        x, row = row, x
    for i in range(rows):
        around = 0.0
        for k in range(indptr[i], indptr[i + 1]):
            around += x[indices[k]]
        row[i] = x[i] * around
    weights = np.empty(indices.size)
    for i in range(rows):
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k]
            weights[k] = x[i] * x[j] * total / max(row[i], row[j], total)
    return weights


@njit(**COMPILED)
def greedy_colours(indptr: Any, indices: Any) -> Any:
    """Smallest colour that no earlier neighbour has, row after row."""
    rows = indptr.size - 1
    colour = np.full(rows, -1, np.int64)
    taken = np.full(rows + 1, -1, np.int64)
    for i in range(rows):
        for k in range(indptr[i], indptr[i + 1]):
            if colour[indices[k]] >= 0:
                taken[colour[indices[k]]] = i
        c = 0
        while taken[c] == i:
            c += 1
        colour[i] = c
    return colour
