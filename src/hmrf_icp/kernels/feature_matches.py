"""Nearest neighbours among features, both ways in one pass over their products."""

from __future__ import annotations

from typing import Any

from hmrf_icp.kernels.compiled import njit


@njit(error_model="numpy")
def keep_nearest(
    products: Any,
    first: int,
    mine: Any,
    theirs: Any,
    row_near: Any,
    row_index: Any,
    column_near: Any,
    column_index: Any,
) -> None:
    """Go through products (B, N) of source features ``first`` and on with all target features.

    ``mine`` (M,) and ``theirs`` (N,) are the squared lengths; the nearest K so far of every
    source feature (M, K) and of every target feature (N, K) are kept up to date, squared
    distances ascending.
    """
    most = row_near.shape[1]
    for b in range(products.shape[0]):
        i = first + b
        worst = row_near[i, most - 1]
        for j in range(products.shape[1]):
            apart = mine[i] + theirs[j] - 2.0 * products[b, j]
            if apart < worst:
                insert(row_near[i], row_index[i], apart, j)
                worst = row_near[i, most - 1]
            if apart < column_near[j, most - 1]:
                insert(column_near[j], column_index[j], apart, i)


@njit(error_model="numpy")
def insert(near: Any, index: Any, apart: float, j: int) -> None:
    """Put one more into an ascending list that keeps its length."""
    k = len(near) - 1
    while k > 0 and near[k - 1] > apart:
        near[k], index[k] = near[k - 1], index[k - 1]
        k -= 1
    near[k], index[k] = apart, j
