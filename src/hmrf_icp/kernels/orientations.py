"""How alike two clouds face under many rotations, looked up in a table of directions."""

from __future__ import annotations

from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import ANY_ORDER, njit


@njit(error_model="numpy", fastmath=ANY_ORDER)
def alike(rotation: Any, directions: Any, weight: Any, table: Any) -> float:
    """Sum of what the table says of each direction (N, 3), turned by the rotation (3, 3).

    The table (S, S) is the octahedron unfolded: a direction divided by the sum of its
    coordinates' sizes falls on one of eight faces, the lower four folded outwards.
    """
    side = table.shape[0]
    half = 0.5 * side
    total = 0.0
    for i in range(directions.shape[0]):
        a, b, c = directions[i, 0], directions[i, 1], directions[i, 2]
        x = rotation[0, 0] * a + rotation[0, 1] * b + rotation[0, 2] * c
        y = rotation[1, 0] * a + rotation[1, 1] * b + rotation[1, 2] * c
        z = rotation[2, 0] * a + rotation[2, 1] * b + rotation[2, 2] * c
        s = 1.0 / (abs(x) + abs(y) + abs(z))
        u, v = x * s, y * s
        if z < 0.0:
            u, v = (
                (1.0 - abs(v)) * (1.0 if u >= 0.0 else -1.0),
                (1.0 - abs(u)) * (1.0 if v >= 0.0 else -1.0),
            )
        j = min(side - 1, int((u + 1.0) * half))
        k = min(side - 1, int((v + 1.0) * half))
        total += weight[i] * table[j, k]
    return total


@njit(error_model="numpy")
def rate(rotations: Any, directions: Any, weight: Any, table: Any) -> Any:
    """Return the same for each of the rotations (K, 3, 3): (K,)."""
    score = np.empty(rotations.shape[0])
    for k in range(rotations.shape[0]):
        score[k] = alike(rotations[k], directions, weight, table)
    return score


@njit(error_model="numpy")
def climb(rotations: Any, score: Any, turns: Any, directions: Any, weight: Any, table: Any) -> None:
    """Turn each rotation by every one of the turns (T, 3, 3) in order, and keep what is better."""
    for k in range(rotations.shape[0]):
        for t in range(turns.shape[0]):
            turned = rotations[k] @ turns[t]
            found = alike(turned, directions, weight, table)
            if found > score[k]:
                score[k] = found
                rotations[k] = turned
