"""What every pass over the matches sums: a 6 x 6 matrix, a gradient and a cost, in doubles.

They lie in one array: the upper triangle of the matrix row by row, the gradient, the
cost. Twists are rotation first.
"""

from __future__ import annotations

from typing import Any

from hmrf_icp.kernels.compiled import ANY_ORDER, njit

GRADIENT = 21
COST = 27
SUMS = 28

OPTIONS: Any = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": ANY_ORDER,
}


# Inlined by force: left to LLVM it stays a call, and a pass takes a tenth longer.
@njit(forceinline=True, **OPTIONS)
def add_row(
    sums: Any,
    x: float,
    y: float,
    z: float,
    nx: float,
    ny: float,
    nz: float,
    residual: float,
    weight: float,
) -> None:
    """Add w J'J, w J'r and w r^2 of one residual along n at x, J = [x cross n, n]."""
    j0, j1, j2 = y * nz - z * ny, z * nx - x * nz, x * ny - y * nx
    a, b, c, d, e, f = weight * j0, weight * j1, weight * j2, weight * nx, weight * ny, weight * nz
    sums[0] += a * j0
    sums[1] += a * j1
    sums[2] += a * j2
    sums[3] += a * nx
    sums[4] += a * ny
    sums[5] += a * nz
    sums[6] += b * j1
    sums[7] += b * j2
    sums[8] += b * nx
    sums[9] += b * ny
    sums[10] += b * nz
    sums[11] += c * j2
    sums[12] += c * nx
    sums[13] += c * ny
    sums[14] += c * nz
    sums[15] += d * nx
    sums[16] += d * ny
    sums[17] += d * nz
    sums[18] += e * ny
    sums[19] += e * nz
    sums[20] += f * nz
    sums[21] += a * residual
    sums[22] += b * residual
    sums[23] += c * residual
    sums[24] += d * residual
    sums[25] += e * residual
    sums[26] += f * residual
    sums[27] += weight * residual * residual


@njit(**OPTIONS)
def moved(points: Any, i: int, onto: Any, k: int, pose: Any, centre: Any) -> Any:
    """Move point i: where it is then from the centre, and from row k of the target.

    ``centre`` is a tuple, read once a pass; an array is read again for every match,
    because the sums might lie over it, which takes 2 % longer.
    """
    cx, cy, cz = centre
    x, y, z = points[i, 0] - cx, points[i, 1] - cy, points[i, 2] - cz
    x, y, z = (
        pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3],
        pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3],
        pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3],
    )
    return x, y, z, x + cx - onto[k, 0], y + cy - onto[k, 1], z + cz - onto[k, 2]


@njit(**OPTIONS)
def turned(normals: Any, i: int, turn: Any) -> Any:
    """Turn normal i by the first three columns of ``turn``."""
    x, y, z = normals[i, 0], normals[i, 1], normals[i, 2]
    return (
        turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z,
        turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z,
        turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z,
    )


@njit(**OPTIONS)
def mean(sx: float, sy: float, sz: float, nx: float, ny: float, nz: float) -> Any:
    """Halve the sum of two normals; s is reversed where they point apart, of unknown sign."""
    sign = 0.5 if sx * nx + sy * ny + sz * nz >= 0.0 else -0.5
    return 0.5 * nx + sign * sx, 0.5 * ny + sign * sy, 0.5 * nz + sign * sz
