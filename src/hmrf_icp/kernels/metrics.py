"""Normal equations of the metrics: one pass over the matches, 6 x 6 sums in double precision.

Every pass takes the moved source points and normals (M, 3), rows of the target, the
weights (M,) of the matches (0 leaves one out), the motion ``pose`` (3, 4) to
apply first and the ``centre`` (3,) that everything is measured from. Twists are
rotation first. What is summed lies in one array: the upper triangle of the
matrix row by row, the gradient, the cost.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import ANY_ORDER, njit

GRADIENT = 21
COST = 27
SUMS = 28

BEYOND = 9.0
"""Times its mean that the square of a difference of normals is disagreement and not noise.

Three root mean squares, squared. Noise alone, about two tangents, has an exponential
distribution and gets there once in 8,000 matches: exp(-9). Little hangs on it: bare
surfaces and rooms are told apart with anything from 2 to 9. At 2 the noise itself is
cut short; from 16 on, wrong matches pass for noise and rooms seem free to move.
"""

_OPTIONS: Any = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": ANY_ORDER,
}


@njit(**_OPTIONS)
def weigh(
    normals: Any,
    noise: Any,
    tilt: Any,
    onto_normals: Any,
    onto_noise: Any,
    onto_tilt: Any,
    row: Any,
    chance: Any,
    turn: Any,
    oriented: bool,
    least: float,
) -> Any:
    """Turn the source's normals by ``turn`` (3, 3) and weigh the matches.

    Returns the turned normals, the weights, the variances of the source and of
    the target point of each match, the chance of those that count, and the
    square of half the difference that noise makes between their normals.
    ``least`` (square metres) is added to each variance.
    """
    count = row.shape[0]
    turned = np.empty((count, 3))
    weight = np.zeros(count)
    variance = np.empty(count)
    onto_variance = np.empty(count)
    used = np.zeros(count)
    apart = np.empty(count)
    shared = np.zeros(onto_noise.shape[0])
    for i in range(count):
        k = row[i]
        x, y, z = _turned(normals, i, turn)
        turned[i, 0], turned[i, 1], turned[i, 2] = x, y, z
        # Exactly 0 also where one of them has no normal.
        agree = x * onto_normals[k, 0] + y * onto_normals[k, 1] + z * onto_normals[k, 2]
        if agree > 0.0 or (agree < 0.0 and not oriented):
            used[i] = chance[i]
            shared[k] += chance[i]
    for i in range(count):
        k = row[i]
        variance[i] = noise[i] * noise[i] + least
        onto_variance[i] = max(shared[k], 1.0) * (onto_noise[k] * onto_noise[k] + least)
        weight[i] = used[i] / (variance[i] + onto_variance[i])
        # Two tangents, two normals, half of each.
        apart[i] = 0.5 * (tilt[i] * tilt[i] + onto_tilt[k] * onto_tilt[k])
    return turned, weight, variance, onto_variance, used, apart


# Inlined by force: left to LLVM it stays a call, and a pass takes a tenth longer.
@njit(forceinline=True, **_OPTIONS)
def _add_row(
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


@njit(**_OPTIONS)
def _moved(points: Any, i: int, onto: Any, k: int, pose: Any, centre: Any) -> Any:
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


@njit(**_OPTIONS)
def _turned(normals: Any, i: int, turn: Any) -> Any:
    """Turn normal i by the first three columns of ``turn``."""
    x, y, z = normals[i, 0], normals[i, 1], normals[i, 2]
    return (
        turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z,
        turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z,
        turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z,
    )


@njit(**_OPTIONS)
def _mean(sx: float, sy: float, sz: float, nx: float, ny: float, nz: float) -> Any:
    """Halve the sum of two normals; s is reversed where they point apart, of unknown sign."""
    sign = 0.5 if sx * nx + sy * ny + sz * nz >= 0.0 else -0.5
    return 0.5 * nx + sign * sx, 0.5 * ny + sign * sy, 0.5 * nz + sign * sz


@njit(**_OPTIONS)
def point_to_plane(
    points: Any,
    _normals: Any,
    onto: Any,
    onto_normals: Any,
    row: Any,
    weight: Any,
    pose: Any,
    centre: Any,
) -> Any:
    """R = n . (x - y), with the target's normal n."""
    sums = np.zeros(SUMS)
    middle = centre[0], centre[1], centre[2]
    for i in range(points.shape[0]):
        w = weight[i]
        if w == 0.0:
            continue
        k = row[i]
        nx, ny, nz = onto_normals[k, 0], onto_normals[k, 1], onto_normals[k, 2]
        x, y, z, dx, dy, dz = _moved(points, i, onto, k, pose, middle)
        residual = nx * dx + ny * dy + nz * dz
        _add_row(sums, x, y, z, nx, ny, nz, residual, w)
    return sums


@njit(**_OPTIONS)
def symmetric(
    points: Any,
    normals: Any,
    onto: Any,
    onto_normals: Any,
    row: Any,
    weight: Any,
    pose: Any,
    centre: Any,
) -> Any:
    """R = m . (x - y), m half the sum of both normals; each side takes half of the motion.

    A pair of normals that point apart (their sign is unknown) is brought to agree.
    """
    sums = np.zeros(SUMS)
    middle = centre[0], centre[1], centre[2]
    for i in range(points.shape[0]):
        w = weight[i]
        if w == 0.0:
            continue
        k = row[i]
        sx, sy, sz = _turned(normals, i, pose)
        nx, ny, nz = onto_normals[k, 0], onto_normals[k, 1], onto_normals[k, 2]
        nx, ny, nz = _mean(sx, sy, sz, nx, ny, nz)
        x, y, z, dx, dy, dz = _moved(points, i, onto, k, pose, middle)
        residual = nx * dx + ny * dy + nz * dz
        x, y, z = x - 0.5 * dx, y - 0.5 * dy, z - 0.5 * dz
        _add_row(sums, x, y, z, nx, ny, nz, residual, w)
    return sums


@njit(**_OPTIONS)
def plane_to_plane(
    points: Any,
    normals: Any,
    onto: Any,
    onto_normals: Any,
    row: Any,
    weight: Any,
    pose: Any,
    centre: Any,
    variance: Any,
    onto_variance: Any,
    flatness: float,
) -> Any:
    """r'C^-1 r for r = x - y, C = R C_s R' + C_t (M, 3 x 3 each).

    A covariance is ``variance`` along the normal and ``variance / flatness``
    across it. ``onto_variance`` has one entry a match, not one a target point.
    """
    sums = np.zeros(SUMS)
    middle = centre[0], centre[1], centre[2]
    wide = 1.0 / flatness
    less = wide - 1.0
    for i in range(points.shape[0]):
        w = weight[i]
        if w == 0.0:
            continue
        k = row[i]
        sx, sy, sz = _turned(normals, i, pose)
        nx, ny, nz = onto_normals[k, 0], onto_normals[k, 1], onto_normals[k, 2]
        x, y, z, dx, dy, dz = _moved(points, i, onto, k, pose, middle)
        # C over the sum of the variances, so that its determinant is of order 1 / flatness^2.
        total = variance[i] + onto_variance[i]
        a, b = less * variance[i] / total, less * onto_variance[i] / total
        c00 = wide - a * sx * sx - b * nx * nx
        c01 = -a * sx * sy - b * nx * ny
        c02 = -a * sx * sz - b * nx * nz
        c11 = wide - a * sy * sy - b * ny * ny
        c12 = -a * sy * sz - b * ny * nz
        c22 = wide - a * sz * sz - b * nz * nz
        m00 = c11 * c22 - c12 * c12
        m01 = c02 * c12 - c01 * c22
        m02 = c01 * c12 - c02 * c11
        m11 = c00 * c22 - c02 * c02
        m12 = c01 * c02 - c00 * c12
        m22 = c00 * c11 - c01 * c01
        scale = w / ((c00 * m00 + c01 * m01 + c02 * m02) * total)
        m00 *= scale
        m01 *= scale
        m02 *= scale
        m11 *= scale
        m12 *= scale
        m22 *= scale
        # J = [-[x], 1], so J'M = [[x] M; M]: the columns of M, each crossed with x.
        p00, p10, p20 = y * m02 - z * m01, z * m00 - x * m02, x * m01 - y * m00
        p01, p11, p21 = y * m12 - z * m11, z * m01 - x * m12, x * m11 - y * m01
        p02, p12, p22 = y * m22 - z * m12, z * m02 - x * m22, x * m12 - y * m02
        sums[0] += y * p02 - z * p01
        sums[1] += z * p00 - x * p02
        sums[2] += x * p01 - y * p00
        sums[3] += p00
        sums[4] += p01
        sums[5] += p02
        sums[6] += z * p10 - x * p12
        sums[7] += x * p11 - y * p10
        sums[8] += p10
        sums[9] += p11
        sums[10] += p12
        sums[11] += x * p21 - y * p20
        sums[12] += p20
        sums[13] += p21
        sums[14] += p22
        sums[15] += m00
        sums[16] += m01
        sums[17] += m02
        sums[18] += m11
        sums[19] += m12
        sums[20] += m22
        gx = m00 * dx + m01 * dy + m02 * dz
        gy = m01 * dx + m11 * dy + m12 * dz
        gz = m02 * dx + m12 * dy + m22 * dz
        sums[21] += y * gz - z * gy
        sums[22] += z * gx - x * gz
        sums[23] += x * gy - y * gx
        sums[24] += gx
        sums[25] += gy
        sums[26] += gz
        sums[27] += dx * gx + dy * gy + dz * gz
    return sums


@njit(**_OPTIONS)
def geometry(
    points: Any,
    normals: Any,
    onto: Any,
    onto_normals: Any,
    row: Any,
    weight: Any,
    apart: Any,
    centre: Any,
) -> Any:
    """Sum what surfaces know of the pose, and what noise in their normals makes up.

    Two sums: with half the sum of the normals of a match, and with half their
    difference. Where the square of that is more than ``BEYOND`` times ``apart`` (M,), what
    noise makes of it, it is shortened to ``apart``. Only the first sum has a gradient and
    a cost that mean something.
    """
    truth = np.zeros(SUMS)
    noise = np.zeros(SUMS)
    for i in range(points.shape[0]):
        w = weight[i]
        if w == 0.0:
            continue
        k = row[i]
        x, y, z = points[i, 0] - centre[0], points[i, 1] - centre[1], points[i, 2] - centre[2]
        sx, sy, sz = normals[i, 0], normals[i, 1], normals[i, 2]
        nx, ny, nz = onto_normals[k, 0], onto_normals[k, 1], onto_normals[k, 2]
        ux, uy, uz = _mean(sx, sy, sz, nx, ny, nz)
        residual = (
            ux * (points[i, 0] - onto[k, 0])
            + uy * (points[i, 1] - onto[k, 1])
            + uz * (points[i, 2] - onto[k, 2])
        )
        _add_row(truth, x, y, z, ux, uy, uz, residual, w)
        ux, uy, uz = nx - ux, ny - uy, nz - uz
        square = ux * ux + uy * uy + uz * uz
        if square > BEYOND * apart[i]:
            shorter = math.sqrt(apart[i] / square)
            ux, uy, uz = shorter * ux, shorter * uy, shorter * uz
        _add_row(noise, x, y, z, ux, uy, uz, 0.0, w)
    return truth, noise
