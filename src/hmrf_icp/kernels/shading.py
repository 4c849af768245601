"""Intensity as a function on the tangent plane: fits, equations, and what they know."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import njit
from hmrf_icp.kernels.normal_equations import OPTIONS, SUMS, add_row, moved, turned

UNKNOWNS = 3
"""Of a fit: the intensity at the point, and its slope along two tangents."""

MINIMUM = 6
"""Neighbours below which none is fitted."""

NARROW = 0.02
"""Determinant over squared trace of a patch below which it is a line, and has no slope."""

FAR = 9.0
"""Residuals of three deviations, squared, count half: highlights and shadows."""


@njit(error_model="numpy")
def fit_shading(points: Any, normals: Any, values: Any, index: Any) -> Any:
    """Fit c + g . (p - x) to the intensities of the neighbours ``index`` (M, K) of every point.

    Neighbours farther off the tangent plane than along it are left out, and so is what has no
    intensity (NaN). Returns the levels c (M,), NaN where nothing is fitted; the slopes g
    (M, 3), along the tangent plane; the mean squares left over (M,); and the trace of the
    slope's covariance over the variance of the noise, halved: its variance along a tangent (M,).
    """
    count = points.shape[0]
    level = np.full(count, np.nan)
    slope = np.zeros((count, 3))
    left = np.full(count, np.nan)
    share = np.zeros(count)
    u = np.empty(index.shape[1])
    v = np.empty(index.shape[1])
    c = np.empty(index.shape[1])
    for i in range(count):
        nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
        if nx == 0.0 and ny == 0.0 and nz == 0.0:
            continue
        # A tangent: the normal crossed with the axis it is farthest from.
        if abs(nx) <= abs(ny) and abs(nx) <= abs(nz):
            ax, ay, az = 0.0, nz, -ny
        elif abs(ny) <= abs(nz):
            ax, ay, az = -nz, 0.0, nx
        else:
            ax, ay, az = ny, -nx, 0.0
        length = math.sqrt(ax * ax + ay * ay + az * az)
        ax, ay, az = ax / length, ay / length, az / length
        bx, by, bz = ny * az - nz * ay, nz * ax - nx * az, nx * ay - ny * ax
        n = 0
        mu = mv = mc = 0.0
        for j in index[i]:
            x = points[j, 0] - points[i, 0]
            y = points[j, 1] - points[i, 1]
            z = points[j, 2] - points[i, 2]
            off = nx * x + ny * y + nz * z
            if math.isnan(values[j]) or 2.0 * off * off > x * x + y * y + z * z:
                continue
            u[n] = ax * x + ay * y + az * z
            v[n] = bx * x + by * y + bz * z
            c[n] = values[j]
            mu += u[n]
            mv += v[n]
            mc += c[n]
            n += 1
        if n < MINIMUM:
            continue
        mu, mv, mc = mu / n, mv / n, mc / n
        uu = uv = vv = uc = vc = cc = 0.0
        for j in range(n):
            du, dv, dc = u[j] - mu, v[j] - mv, c[j] - mc
            uu += du * du
            uv += du * dv
            vv += dv * dv
            uc += du * dc
            vc += dv * dc
            cc += dc * dc
        determinant = uu * vv - uv * uv
        trace = uu + vv
        if not determinant > NARROW * trace * trace:
            continue
        gu, gv = (vv * uc - uv * vc) / determinant, (uu * vc - uv * uc) / determinant
        level[i] = mc - gu * mu - gv * mv
        slope[i, 0], slope[i, 1], slope[i, 2] = (
            gu * ax + gv * bx,
            gu * ay + gv * by,
            gu * az + gv * bz,
        )
        left[i] = max(0.0, cc - gu * uc - gv * vc) / (n - UNKNOWNS)
        share[i] = 0.5 * trace / determinant
    return level, slope, left, share


@njit(**OPTIONS)
def weigh_shading(
    points: Any,
    onto: Any,
    row: Any,
    chance: Any,
    values: Any,
    variance: Any,
    level: Any,
    slope: Any,
    onto_variance: Any,
) -> Any:
    """Weigh the difference of intensities of each match: chance over variance.

    A target point that is matched k times is one measurement. Where differences are larger than
    the noise says, by their root mean square, that is the noise; and what is far beyond counts
    for less. Returns the weights (M,).
    """
    count = row.shape[0]
    weight = np.zeros(count)
    square = np.zeros(count)
    shared = np.zeros(onto.shape[0])
    for i in range(count):
        shared[row[i]] += chance[i]
    total = cost = 0.0
    for i in range(count):
        k = row[i]
        both = variance[i] + max(shared[k], 1.0) * onto_variance[k]
        if chance[i] == 0.0 or not both > 0.0 or math.isnan(values[i]) or math.isnan(level[k]):
            continue
        off = level[k] - values[i]
        for a in range(3):
            off += slope[k, a] * (points[i, a] - onto[k, a])
        weight[i] = chance[i] / both
        square[i] = off * off / both
        total += chance[i]
        cost += chance[i] * min(square[i], 1e6)
    excess = max(1.0, cost / total) if total > 0.0 else 1.0
    for i in range(count):
        weight[i] /= excess * (1.0 + square[i] / (FAR * excess))
    return weight


@njit(**OPTIONS)
def photometric(
    points: Any,
    onto: Any,
    row: Any,
    weight: Any,
    values: Any,
    level: Any,
    slope: Any,
    pose: Any,
    centre: Any,
) -> Any:
    """R = c + g . (x - y) - C(x): what the target's plane says there less what the source has."""
    sums = np.zeros(SUMS)
    middle = centre[0], centre[1], centre[2]
    for i in range(points.shape[0]):
        w = weight[i]
        if w == 0.0:
            continue
        k = row[i]
        gx, gy, gz = slope[k, 0], slope[k, 1], slope[k, 2]
        x, y, z, dx, dy, dz = moved(points, i, onto, k, pose, middle)
        residual = level[k] + gx * dx + gy * dy + gz * dz - values[i]
        add_row(sums, x, y, z, gx, gy, gz, residual, w)
    return sums


@njit(**OPTIONS)
def shading_known(
    points: Any,
    row: Any,
    weight: Any,
    slope: Any,
    slope_variance: Any,
    normals: Any,
    onto_slope: Any,
    onto_variance: Any,
    turn: Any,
    centre: Any,
) -> Any:
    """Sum what intensities know of the pose, what noise makes up of it, and how far they differ.

    Three sums, as those of the normals: with half the sum of the slopes of a match; with what
    noise is expected to make of half their difference; and with half their difference as it is.
    ``normals`` (M, 3) are the source's where it is, ``turn`` (3, 3) turned its slopes.
    """
    truth = np.zeros(SUMS)
    noise = np.zeros(SUMS)
    apart = np.zeros(SUMS)
    for i in range(points.shape[0]):
        w = weight[i]
        if w == 0.0:
            continue
        k = row[i]
        x, y, z = points[i, 0] - centre[0], points[i, 1] - centre[1], points[i, 2] - centre[2]
        sx, sy, sz = turned(slope, i, turn)
        gx, gy, gz = onto_slope[k, 0], onto_slope[k, 1], onto_slope[k, 2]
        add_row(truth, x, y, z, 0.5 * (gx + sx), 0.5 * (gy + sy), 0.5 * (gz + sz), 0.0, w)
        add_row(apart, x, y, z, 0.5 * (gx - sx), 0.5 * (gy - sy), 0.5 * (gz - sz), 0.0, w)
        # Along both tangents: the identity less the normal's square, row by row.
        each = 0.25 * w * (slope_variance[i] + onto_variance[k])
        nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
        add_row(noise, x, y, z, 1.0 - nx * nx, -nx * ny, -nx * nz, 0.0, each)
        add_row(noise, x, y, z, -nx * ny, 1.0 - ny * ny, -ny * nz, 0.0, each)
        add_row(noise, x, y, z, -nx * nz, -ny * nz, 1.0 - nz * nz, 0.0, each)
    return truth, noise, apart
