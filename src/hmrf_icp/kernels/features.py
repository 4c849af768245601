"""Fast point feature histograms: how the normals about a point turn."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import njit
from hmrf_icp.kernels.surface import eigenvalues_and_normal

BINS = 11
"""Bins of each of the three angles."""


@njit(error_model="numpy")
def within(cells: Any, span: Any, points: Any, x: Any, reach: float, low: Any, found: Any) -> int:
    """List the points (M, 3) within ``reach`` of x (3,); return how many.

    ``cells`` are their cells' numbers (edge ``reach``, ``low`` the corner, ``span`` cells along
    each axis), ascending, and the points are in the same order: a line of three cells along
    the last axis stands together.
    """
    count = 0
    a = math.floor((x[0] - low[0]) / reach)
    b = math.floor((x[1] - low[1]) / reach)
    c = math.floor((x[2] - low[2]) / reach)
    first, last = max(c - 1, 0), min(c + 1, span[2] - 1)
    if first > last:
        return 0
    square = reach * reach
    for i in range(max(a - 1, 0), min(a + 2, span[0])):
        for j in range(max(b - 1, 0), min(b + 2, span[1])):
            line = (i * span[1] + j) * span[2]
            k = np.searchsorted(cells, line + first)
            while k < len(cells) and cells[k] <= line + last:
                dx, dy, dz = points[k, 0] - x[0], points[k, 1] - x[1], points[k, 2] - x[2]
                if dx * dx + dy * dy + dz * dz <= square and count < len(found):
                    found[count] = k
                    count += 1
                k += 1
    return count


@njit(error_model="numpy")
def thin(points: Any, normals: Any, starts: Any, order: Any) -> Any:
    """Mean point and normal of each cell: ``order`` lists rows cell by cell from ``starts``.

    Normals are added up with the sign of the first, so that they may have none.
    """
    count = len(starts) - 1
    where, facing = np.zeros((count, 3)), np.zeros((count, 3))
    for cell in range(count):
        first = order[starts[cell]]
        n = starts[cell + 1] - starts[cell]
        for m in range(starts[cell], starts[cell + 1]):
            k = order[m]
            cosine = 0.0
            for axis in range(3):
                where[cell, axis] += points[k, axis] / n
                cosine += normals[k, axis] * normals[first, axis]
            sign = 1.0 if cosine >= 0.0 else -1.0
            for axis in range(3):
                facing[cell, axis] += sign * normals[k, axis]
        length = math.sqrt(facing[cell, 0] ** 2 + facing[cell, 1] ** 2 + facing[cell, 2] ** 2)
        if length > 0.0:
            facing[cell] /= length
    return where, facing


@njit(error_model="numpy")
def smooth_normals(points: Any, normals: Any, cells: Any, span: Any, reach: float, low: Any) -> Any:
    """Planes fitted to the points within ``reach``, with the sign that ``normals`` have."""
    out = np.zeros_like(points)
    found = np.empty(len(points), np.int64)
    for i in range(len(points)):
        n = within(cells, span, points, points[i], reach, low, found)
        out[i] = normals[i]
        if n < 5:
            continue
        sx = sy = sz = xx = xy = xz = yy = yz = zz = 0.0
        for m in range(n):
            k = found[m]
            x, y, z = (
                points[k, 0] - points[i, 0],
                points[k, 1] - points[i, 1],
                points[k, 2] - points[i, 2],
            )
            sx, sy, sz = sx + x, sy + y, sz + z
            xx, xy, xz = xx + x * x, xy + x * y, xz + x * z
            yy, yz, zz = yy + y * y, yz + y * z, zz + z * z
        _, _, _, nx, ny, nz = eigenvalues_and_normal(
            xx / n - sx * sx / n**2,
            xy / n - sx * sy / n**2,
            xz / n - sx * sz / n**2,
            yy / n - sy * sy / n**2,
            yz / n - sy * sz / n**2,
            zz / n - sz * sz / n**2,
        )
        if nx == 0.0 and ny == 0.0 and nz == 0.0:
            continue
        sign = 1.0 if nx * normals[i, 0] + ny * normals[i, 1] + nz * normals[i, 2] >= 0.0 else -1.0
        out[i, 0], out[i, 1], out[i, 2] = sign * nx, sign * ny, sign * nz
    return out


@njit(error_model="numpy")
def simple(points: Any, normals: Any, cells: Any, span: Any, reach: float, low: Any) -> Any:
    """Simplified histograms (M, 33): the angles between each point and those within ``reach``."""
    out = np.zeros((len(points), 3 * BINS), np.float32)
    found = np.empty(len(points), np.int64)
    for i in range(len(points)):
        n = within(cells, span, points, points[i], reach, low, found)
        ux, uy, uz = normals[i, 0], normals[i, 1], normals[i, 2]
        used = 0
        for m in range(n):
            k = found[m]
            if k == i:
                continue
            dx, dy, dz = (
                points[k, 0] - points[i, 0],
                points[k, 1] - points[i, 1],
                points[k, 2] - points[i, 2],
            )
            length = math.sqrt(dx * dx + dy * dy + dz * dz)
            if length <= 0.0:
                continue
            dx, dy, dz = dx / length, dy / length, dz / length
            nx, ny, nz = normals[k, 0], normals[k, 1], normals[k, 2]
            phi = ux * dx + uy * dy + uz * dz
            vx, vy, vz = dy * uz - dz * uy, dz * ux - dx * uz, dx * uy - dy * ux
            norm = math.sqrt(vx * vx + vy * vy + vz * vz)
            if norm <= 1e-9:
                continue
            vx, vy, vz = vx / norm, vy / norm, vz / norm
            wx, wy, wz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
            alpha = vx * nx + vy * ny + vz * nz
            theta = math.atan2(wx * nx + wy * ny + wz * nz, ux * nx + uy * ny + uz * nz)
            used += 1
            vote(out[i], 0, (alpha + 1.0) * 0.5 * BINS, False)
            vote(out[i], BINS, (phi + 1.0) * 0.5 * BINS, False)
            vote(out[i], 2 * BINS, (theta / math.pi + 1.0) * 0.5 * BINS, True)
        if used > 0:
            for m in range(3 * BINS):
                out[i, m] /= used
    return out


@njit(error_model="numpy", inline="always")
def vote(out: Any, begin: int, place: float, wraps: bool) -> None:
    """Share one vote between the two bins whose middles are next to ``place``."""
    place -= 0.5
    low = math.floor(place)
    share = place - low
    high = low + 1
    if wraps:
        low, high = low % BINS, high % BINS
    else:
        low, high = min(max(low, 0), BINS - 1), min(max(high, 0), BINS - 1)
    out[begin + low] += 1.0 - share
    out[begin + high] += share


@njit(error_model="numpy")
def gather(simple: Any, points: Any, cells: Any, span: Any, reach: float, low: Any, at: Any) -> Any:
    """Histograms (K, 33) at the places ``at`` (K, 3): those about it, by one over the distance."""
    out = np.zeros((len(at), simple.shape[1]), np.float32)
    found = np.empty(len(points), np.int64)
    for i in range(len(at)):
        n = within(cells, span, points, at[i], reach, low, found)
        total = 0.0
        for m in range(n):
            k = found[m]
            dx, dy, dz = points[k, 0] - at[i, 0], points[k, 1] - at[i, 1], points[k, 2] - at[i, 2]
            w = reach / max(math.sqrt(dx * dx + dy * dy + dz * dz), 0.05 * reach)
            total += w
            for b in range(simple.shape[1]):
                out[i, b] += w * simple[k, b]
        if total > 0.0:
            for b in range(simple.shape[1]):
                out[i, b] /= total
    return out
