"""Mean-field steps over a pixel grid or a graph: z_i = tanh(beta sum_i' w_ii' z_i' + u_i / 2).

The exponential is the one of the EM pass (products only, 1e-13 off), in loops of
their own over contiguous memory, so that the compiler vectorises them; only the
gathering over a graph's edges is left scalar.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import njit
from hmrf_icp.kernels.em import ANY_ORDER

SATURATED = 40.0
"""Log-odds beyond which the label is -1 or +1 to the last digit."""

COMPILED: dict[str, Any] = {
    "nogil": True,
    "fastmath": ANY_ORDER,
    "error_model": "numpy",
}


@njit(**COMPILED)
def respond(log_odds: Any) -> None:
    """tanh(log_odds / 2) in place."""
    scale = 0.5**10
    for j in range(log_odds.size):
        x = log_odds[j]
        x = SATURATED if x > SATURATED else x
        x = -SATURATED if x < -SATURATED else x
        x *= scale
        tail = 1 / 6 + x * (1 / 24 + x * (1 / 120 + x * (1 / 720 + x * (1 / 5040))))
        e = 1.0 + x * (1.0 + x * (0.5 + x * tail))
        e *= e
        e *= e
        e *= e
        e *= e
        e *= e
        e *= e
        e *= e
        e *= e
        e *= e
        e *= e
        log_odds[j] = (e - 1.0) / (e + 1.0)


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
            for j in range(width):
                row[j] = up[j + 1] + down[j + 1] + here[j]
            for j in range(width):
                row[j] += here[j + 2]
            for j in range(width):
                row[j] = strength * row[j] + own[j + 1]
            respond(row)
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
                for j in range(width):
                    row[j] = up[j + 1] + down[j + 1] + here[j]
                for j in range(width):
                    row[j] += here[j + 2]
                for j in range(width):
                    row[j] = strength * row[j] + own[j + 1]
                respond(row)
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
