"""Annealed registration of two small clouds: the inner loop of the search over starts."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import njit
from hmrf_icp.kernels.table import look_up

ANCHOR = 0.01
"""Share of the point-to-point metric in the symmetric one, so that no direction is free."""

LEAST_WEIGHT = 6.0
"""Weight of all matches together below which a start is given up: six unknowns."""


@njit(error_model="numpy")
def solve(h: Any, g: Any, x: Any) -> None:
    """Solve h x = g for a symmetric (6, 6) h, lower triangle given, by Cholesky in place."""
    trace = 0.0
    for i in range(6):
        trace += h[i, i]
    for i in range(6):
        for j in range(i + 1):
            s = h[i, j]
            for k in range(j):
                s -= h[i, k] * h[j, k]
            if i == j:
                h[i, i] = math.sqrt(max(s + 1e-9 * trace, 1e-300))
            else:
                h[i, j] = s / h[j, j]
    for i in range(6):
        s = g[i]
        for k in range(i):
            s -= h[i, k] * x[k]
        x[i] = s / h[i, i]
    for i in range(5, -1, -1):
        s = x[i]
        for k in range(i + 1, 6):
            s -= h[k, i] * x[k]
        x[i] = s / h[i, i]


@njit(error_model="numpy")
def move(pose: Any, x: Any) -> None:
    """Move pose (4, 4) in place: turn by the rotation vector x[:3], then shift by x[3:]."""
    angle = math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    if angle < 1e-9:
        a, b = 1.0, 0.5
    else:
        a, b = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle**2
    for column in range(4):
        p, q, r = pose[0, column], pose[1, column], pose[2, column]
        cx, cy, cz = x[1] * r - x[2] * q, x[2] * p - x[0] * r, x[0] * q - x[1] * p
        dx, dy, dz = x[1] * cz - x[2] * cy, x[2] * cx - x[0] * cz, x[0] * cy - x[1] * cx
        pose[0, column] = p + a * cx + b * dx
        pose[1, column] = q + a * cy + b * dy
        pose[2, column] = r + a * cz + b * dz
    pose[0, 3] += x[3]
    pose[1, 3] += x[4]
    pose[2, 3] += x[5]


@njit(error_model="numpy")
def anneal(
    points: Any,
    normals: Any,
    onto: Any,
    onto_normals: Any,
    signed: bool,
    table: Any,
    corner: Any,
    edge: float,
    scales: Any,
    steps: int,
    small: float,
    poses: Any,
) -> None:
    """Register points (M, 3) to ``onto`` (N, 3) from every pose (K, 4, 4), in place.

    At each of the falling ``scales`` (metres), ``steps`` times: the closest
    points out of the table, weights exp(-d^2 / 2 s^2) times the squared cosine
    between the normals, and one Gauss-Newton step of the symmetric metric.
    """
    h = np.zeros((6, 6))
    g = np.zeros(6)
    x = np.zeros(6)
    row = np.zeros(6)
    for candidate in range(poses.shape[0]):
        pose = poses[candidate]
        for scale in scales:
            sharpness = 0.5 / scale**2
            for _ in range(steps):
                for i in range(6):
                    g[i] = 0.0
                    for j in range(6):
                        h[i, j] = 0.0
                total = 0.0
                for k in range(points.shape[0]):
                    px, py, pz = points[k, 0], points[k, 1], points[k, 2]
                    qx = pose[0, 0] * px + pose[0, 1] * py + pose[0, 2] * pz + pose[0, 3]
                    qy = pose[1, 0] * px + pose[1, 1] * py + pose[1, 2] * pz + pose[1, 3]
                    qz = pose[2, 0] * px + pose[2, 1] * py + pose[2, 2] * pz + pose[2, 3]
                    m = look_up(onto, table, corner, edge, qx, qy, qz)
                    if m < 0:
                        continue
                    dx, dy, dz = qx - onto[m, 0], qy - onto[m, 1], qz - onto[m, 2]
                    weight = math.exp(-sharpness * (dx * dx + dy * dy + dz * dz))
                    if weight < 1e-4:
                        continue
                    px, py, pz = normals[k, 0], normals[k, 1], normals[k, 2]
                    nx = pose[0, 0] * px + pose[0, 1] * py + pose[0, 2] * pz
                    ny = pose[1, 0] * px + pose[1, 1] * py + pose[1, 2] * pz
                    nz = pose[2, 0] * px + pose[2, 1] * py + pose[2, 2] * pz
                    tx, ty, tz = onto_normals[m, 0], onto_normals[m, 1], onto_normals[m, 2]
                    cosine = nx * tx + ny * ty + nz * tz
                    if cosine < 0.0 and not signed:
                        cosine, nx, ny, nz = -cosine, -nx, -ny, -nz
                    if cosine <= 0.0:
                        continue
                    weight *= cosine * cosine
                    total += weight
                    nx, ny, nz = nx + tx, ny + ty, nz + tz
                    length = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
                    nx, ny, nz = nx * length, ny * length, nz * length
                    row[0] = qy * nz - qz * ny
                    row[1] = qz * nx - qx * nz
                    row[2] = qx * ny - qy * nx
                    row[3], row[4], row[5] = nx, ny, nz
                    off = weight * (dx * nx + dy * ny + dz * nz)
                    for i in range(6):
                        g[i] -= row[i] * off
                        part = weight * row[i]
                        for j in range(i + 1):
                            h[i, j] += part * row[j]
                    w = ANCHOR * weight
                    h[0, 0] += w * (qy * qy + qz * qz)
                    h[1, 1] += w * (qx * qx + qz * qz)
                    h[2, 2] += w * (qx * qx + qy * qy)
                    h[1, 0] -= w * qx * qy
                    h[2, 0] -= w * qx * qz
                    h[2, 1] -= w * qy * qz
                    h[3, 1] += w * qz
                    h[3, 2] -= w * qy
                    h[4, 0] -= w * qz
                    h[4, 2] += w * qx
                    h[5, 0] += w * qy
                    h[5, 1] -= w * qx
                    h[3, 3] += w
                    h[4, 4] += w
                    h[5, 5] += w
                    g[0] -= w * (qy * dz - qz * dy)
                    g[1] -= w * (qz * dx - qx * dz)
                    g[2] -= w * (qx * dy - qy * dx)
                    g[3] -= w * dx
                    g[4] -= w * dy
                    g[5] -= w * dz
                if total < LEAST_WEIGHT:
                    break
                solve(h, g, x)
                move(pose, x)
                turned = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
                shifted = x[3] * x[3] + x[4] * x[4] + x[5] * x[5]
                if turned < 1e-6 and shifted < (small * scale) ** 2:
                    break
