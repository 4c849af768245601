"""Mean-field steps over a pixel grid or a graph: z_i = tanh(beta sum_i' w_ii' z_i' + u_i / 2).

The tangent is the one of the EM pass (1e-13 off), in a loop of its own over
contiguous memory, so that the compiler vectorises it; only the gathering over a
graph's edges is left scalar.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import ANY_ORDER, njit
from hmrf_icp.kernels.tanh import tanh_of_half

COMPILED: dict[str, Any] = {
    "nogil": True,
    "fastmath": ANY_ORDER,
    "error_model": "numpy",
}


@njit(**COMPILED)
def respond(log_odds: Any) -> None:
    """tanh(log_odds / 2) in place."""
    for j in range(log_odds.size):
        log_odds[j] = tanh_of_half(log_odds[j])


# Inlined by Numba: handing over six rows takes an eighth of a step on a small image.
@njit(inline="always", **COMPILED)
def step_row(row: Any, up: Any, here: Any, down: Any, own: Any, strength: float) -> None:
    """Write the step of one row of an image, from itself and the rows above and below.

    All but ``row`` carry a margin of one pixel at either end.
    """
    # One offset of every array a loop: two of one array become a recurrence, left scalar.
    for j in range(row.size):
        row[j] = up[j + 1] + down[j + 1] + here[j]
    for j in range(row.size):
        row[j] += here[j + 2]
    for j in range(row.size):
        row[j] = strength * row[j] + own[j + 1]
    respond(row)


@njit(**COMPILED)
def lay_out(place: Any, unary: Any, z: Any, external: Any, field: Any, seen: Any) -> None:
    """Write values of the observed pixels where they stand in the images.

    An assignment of one array at the places in another does the same, and takes
    as long to compile as everything else here together: Numba words its error.
    """
    width = field.shape[1]
    for k in range(place.size):
        i, j = divmod(place[k], width)
        external[i, j] = unary[k]
        field[i, j] = z[k]
        seen[i, j] = 1.0


@njit(**COMPILED)
def pick_up(place: Any, field: Any) -> Any:
    """Read the observed pixels of an image back."""
    width = field.shape[1]
    z = np.empty(place.size)
    for k in range(place.size):
        i, j = divmod(place[k], width)
        z[k] = field[i, j]
    return z


@njit(**COMPILED)
def grid_simultaneous(place: Any, shape: Any, unary: Any, z: Any, beta: Any, least: float) -> Any:
    """Step on a grid, every pixel from the step before; the new z (M,) and the steps taken.

    ``place`` (M,) says where the pixels are in a flat grid of ``shape`` with a margin of one.
    """
    height, width = shape
    # The margin stays 0: border pixels have fewer neighbours without a test.
    field, spare = np.zeros((height + 2, width + 2)), np.zeros((height + 2, width + 2))
    external, seen = np.zeros((height + 2, width + 2)), np.zeros((height + 2, width + 2))
    lay_out(place, unary, z, external, field, seen)
    row = np.empty(width)
    taken = 0
    for step in range(beta.size):
        strength, moved = 2.0 * beta[step], 0.0
        for i in range(1, height + 1):
            up, here, down, out = field[i - 1], field[i], field[i + 1], spare[i]
            own, there = external[i], seen[i]
            step_row(row, up, here, down, own, strength)
            for j in range(width):
                value = there[j + 1] * row[j]
                out[j + 1] = value
                moved += abs(value - here[j + 1])
        field, spare = spare, field
        taken += 1
        if moved <= least:
            break
    return pick_up(place, field), taken


@njit(**COMPILED)
def grid_sequential(place: Any, shape: Any, unary: Any, z: Any, beta: Any, least: float) -> Any:
    """Step on a grid, the black squares of a checkerboard first, then the white from them."""
    height, width = shape
    field = np.zeros((height + 2, width + 2))
    external, seen = np.zeros((height + 2, width + 2)), np.zeros((height + 2, width + 2))
    lay_out(place, unary, z, external, field, seen)
    row, black = np.empty(width), np.zeros(width + 1)
    for j in range(0, width + 1, 2):
        black[j] = 1.0
    taken = 0
    for step in range(beta.size):
        strength, moved = 2.0 * beta[step], 0.0
        for colour in range(2):
            for i in range(1, height + 1):
                up, here, down = field[i - 1], field[i], field[i + 1]
                own, there = external[i], seen[i]
                chosen = black[(i - 1 + colour) % 2 :]
                step_row(row, up, here, down, own, strength)
                for j in range(width):
                    change = chosen[j] * there[j + 1] * (row[j] - here[j + 1])
                    here[j + 1] += change
                    moved += abs(change)
        taken += 1
        if moved <= least:
            break
    return pick_up(place, field), taken


@njit(**COMPILED)
def graph_simultaneous(
    indptr: Any, indices: Any, weights: Any, unary: Any, z: Any, beta: Any, least: float
) -> Any:
    """Step on a graph, every point from the step before; the new z (M,) and the steps taken."""
    z, new = z.copy(), np.empty_like(z)
    taken = 0
    for step in range(beta.size):
        strength, moved = 2.0 * beta[step], 0.0
        for i in range(z.size):
            total = 0.0
            for k in range(indptr[i], indptr[i + 1]):
                total += weights[k] * z[indices[k]]
            new[i] = strength * total + unary[i]
        respond(new)
        for i in range(z.size):
            moved += abs(new[i] - z[i])
        z, new = new, z
        taken += 1
        if moved <= least:
            break
    return z, taken


@njit(**COMPILED)
def graph_sequential(
    indptr: Any,
    indices: Any,
    weights: Any,
    order: Any,
    starts: Any,
    unary: Any,
    z: Any,
    beta: Any,
    least: float,
) -> Any:
    """Step on a graph, one colour after the other; no two neighbours share a colour."""
    z, part = z.copy(), np.empty_like(z)
    taken = 0
    for step in range(beta.size):
        strength, moved = 2.0 * beta[step], 0.0
        for c in range(starts.size - 1):
            first, last = starts[c], starts[c + 1]
            for a in range(first, last):
                i = order[a]
                total = 0.0
                for k in range(indptr[i], indptr[i + 1]):
                    total += weights[k] * z[indices[k]]
                part[a] = strength * total + unary[i]
            respond(part[first:last])
            for a in range(first, last):
                i = order[a]
                moved += abs(part[a] - z[i])
                z[i] = part[a]
        taken += 1
        if moved <= least:
            break
    return z, taken


@njit(**COMPILED)
def graph_sums(indptr: Any, indices: Any, weights: Any, z: Any) -> Any:
    """sum_i' w_ii' z_i' of every point."""
    sums = np.empty(indptr.size - 1)
    for i in range(sums.size):
        total = 0.0
        for k in range(indptr[i], indptr[i + 1]):
            total += weights[k] * z[indices[k]]
        sums[i] = total
    return sums
