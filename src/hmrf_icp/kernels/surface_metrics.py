"""Normal equations of the metrics: one pass over the matches.

Every pass takes the moved source points and normals (M, 3), rows of the target, the
weights (M,) of the matches (0 leaves one out), the motion ``pose`` (3, 4) to
apply first and the ``centre`` (3,) that everything is measured from. What it
returns is laid out as :mod:`hmrf_icp.kernels.normal_equations` has it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import njit
from hmrf_icp.kernels.normal_equations import OPTIONS, SUMS, add_row, mean, moved, turned


@njit(**OPTIONS)
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
    facing = np.empty((count, 3))
    weight = np.zeros(count)
    variance = np.empty(count)
    onto_variance = np.empty(count)
    used = np.zeros(count)
    apart = np.empty(count)
    shared = np.zeros(onto_noise.shape[0])
    for i in range(count):
        k = row[i]
        x, y, z = turned(normals, i, turn)
        facing[i, 0], facing[i, 1], facing[i, 2] = x, y, z
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
    return facing, weight, variance, onto_variance, used, apart


@njit(**OPTIONS)
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
        x, y, z, dx, dy, dz = moved(points, i, onto, k, pose, middle)
        residual = nx * dx + ny * dy + nz * dz
        add_row(sums, x, y, z, nx, ny, nz, residual, w)
    return sums


@njit(**OPTIONS)
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
        sx, sy, sz = turned(normals, i, pose)
        nx, ny, nz = onto_normals[k, 0], onto_normals[k, 1], onto_normals[k, 2]
        nx, ny, nz = mean(sx, sy, sz, nx, ny, nz)
        x, y, z, dx, dy, dz = moved(points, i, onto, k, pose, middle)
        residual = nx * dx + ny * dy + nz * dz
        x, y, z = x - 0.5 * dx, y - 0.5 * dy, z - 0.5 * dz
        add_row(sums, x, y, z, nx, ny, nz, residual, w)
    return sums


@njit(**OPTIONS)
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
        sx, sy, sz = turned(normals, i, pose)
        nx, ny, nz = onto_normals[k, 0], onto_normals[k, 1], onto_normals[k, 2]
        x, y, z, dx, dy, dz = moved(points, i, onto, k, pose, middle)
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
