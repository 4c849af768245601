"""Planes fitted to the neighbours of every point."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import njit

MINIMUM = 6
"""Neighbours below which no plane is fitted."""

LINES = np.array([n.bit_count() for n in range(32)])
"""Ones of a binary number: rows or columns of a window. A plane fits any two of them."""

JUMP = 4.0
"""A neighbour farther than this many pixel footprints a pixel is behind a jump in depth."""

NARROW = 0.25
"""A patch whose deviation one way is less than this share of that the other way is a line."""

CHAIN = 0.4
"""Points whose share within half the distance of the last is more than this are a chain.

On a surface it is a quarter, on a line a half.
"""

GRAZING = 0.15
"""Smallest cosine of incidence by which a pixel's area is enlarged."""


@njit(error_model="numpy")
def eigenvalues_and_normal(a: Any, b: Any, c: Any, d: Any, e: Any, f: Any) -> Any:
    """Eigenvalues, rising, of [[a, b, c], [b, d, e], [c, e, f]], and the first one's unit vector.

    Eigenvalues in closed form; the vector is the longest cross product of two
    rows of the matrix less the eigenvalue. A zero vector where they are all alike.
    """
    mean = (a + d + f) / 3.0
    spread = (a - mean) ** 2 + (d - mean) ** 2 + (f - mean) ** 2 + 2.0 * (b * b + c * c + e * e)
    p = math.sqrt(spread / 6.0)
    if p <= 1e-14 * abs(mean) or p == 0.0:
        return mean, mean, mean, 0.0, 0.0, 0.0
    ka, kd, kf, kb, kc, ke = (a - mean) / p, (d - mean) / p, (f - mean) / p, b / p, c / p, e / p
    half = 0.5 * (ka * (kd * kf - ke * ke) - kb * (kb * kf - ke * kc) + kc * (kb * ke - kd * kc))
    angle = math.acos(min(1.0, max(-1.0, half))) / 3.0
    low = mean + 2.0 * p * math.cos(angle + 2.0 * math.pi / 3.0)
    high = mean + 2.0 * p * math.cos(angle)
    middle = 3.0 * mean - low - high
    a, d, f = a - low, d - low, f - low
    x1, y1, z1 = b * e - c * d, c * b - a * e, a * d - b * b
    x2, y2, z2 = b * f - c * e, c * c - a * f, a * e - b * c
    x3, y3, z3 = d * f - e * e, e * c - b * f, b * e - d * c
    n1 = x1 * x1 + y1 * y1 + z1 * z1
    n2 = x2 * x2 + y2 * y2 + z2 * z2
    n3 = x3 * x3 + y3 * y3 + z3 * z3
    x, y, z, n = x1, y1, z1, n1
    if n2 > n:
        x, y, z, n = x2, y2, z2, n2
    if n3 > n:
        x, y, z, n = x3, y3, z3, n3
    if n <= 0.0:
        return low, middle, high, 0.0, 0.0, 0.0
    s = 1.0 / math.sqrt(n)
    return low, middle, high, x * s, y * s, z * s


NO_POINTS = (0.0,) * 9
"""Sums of an empty patch: three of first powers, six of products."""


@njit(error_model="numpy")
def _with(sums: Any, x: float, y: float, z: float) -> Any:
    """Add a neighbour to the sums of a patch, (x, y, z) from the point whose patch it is."""
    sx, sy, sz, xx, xy, xz, yy, yz, zz = sums
    return (
        sx + x,
        sy + y,
        sz + z,
        xx + x * x,
        xy + x * y,
        xz + x * z,
        yy + y * y,
        yz + y * z,
        zz + z * z,
    )


# Inlined by Numba: left to LLVM, which does not do it, the window's fit takes 2 % longer.
@njit(error_model="numpy", inline="always")
def _plane(sums: Any, n: int, vx: float, vy: float, vz: float) -> Any:
    """Fit a plane to a patch of n points; (vx, vy, vz) leads from the viewpoint to it.

    Returns its unit normal towards the viewpoint, how far off the viewpoint is
    along that, the standard deviation left over, and those of the points within
    the plane, the smaller one first.
    """
    sx, sy, sz, xx, xy, xz, yy, yz, zz = sums
    k = 1.0 / n
    sx, sy, sz = sx * k, sy * k, sz * k
    low, middle, high, nx, ny, nz = eigenvalues_and_normal(
        xx * k - sx * sx,
        xy * k - sx * sy,
        xz * k - sx * sz,
        yy * k - sy * sy,
        yz * k - sy * sz,
        zz * k - sz * sz,
    )
    toward = -(nx * vx + ny * vy + nz * vz)
    sign = 1.0 if toward >= 0.0 else -1.0
    left_over = math.sqrt(max(low, 0.0) * n / (n - 3.0))
    return (
        sign * nx,
        sign * ny,
        sign * nz,
        abs(toward),
        left_over,
        math.sqrt(max(middle, 0.0)),
        math.sqrt(max(high, 0.0)),
    )


@njit(error_model="numpy")
def fit_window(points: Any, viewpoint: Any, angle: Any, stride: Any, radius: int) -> Any:
    """Fit planes in windows of an organised cloud (H, W, 3).

    ``angle`` (2,) is the step of the grid between rows and between columns, in radians,
    and ``stride`` (2,) takes every so manieth of them. Returns normals (H, W, 3) towards the
    viewpoint, standard deviation left over (H, W; NaN where no plane was fitted), areas (H, W)
    and the deviation of the points along the plane, the way they spread least (H, W).
    """
    height, width, _ = points.shape
    normals = np.zeros((height, width, 3))
    residual = np.full((height, width), np.nan)
    area = np.zeros((height, width))
    narrow = np.zeros((height, width))
    down, across = stride[0], stride[1]
    step = max(angle[0] * down, angle[1] * across)
    for i in range(height):
        for j in range(width):
            x0, y0, z0 = points[i, j, 0], points[i, j, 1], points[i, j, 2]
            if math.isnan(x0):
                continue
            vx, vy, vz = x0 - viewpoint[0], y0 - viewpoint[1], z0 - viewpoint[2]
            reach = math.sqrt(vx * vx + vy * vy + vz * vz)
            gate = JUMP * step * reach
            area[i, j] = angle[0] * angle[1] * reach * reach
            n = 0
            sums = NO_POINTS
            rows = columns = 0
            for u in range(-radius, radius + 1):
                for v in range(-radius, radius + 1):
                    row, column = i + u * down, j + v * across
                    if not (0 <= row < height and 0 <= column < width):
                        continue
                    x = points[row, column, 0] - x0
                    y = points[row, column, 1] - y0
                    z = points[row, column, 2] - z0
                    # False for a hole too: a comparison with NaN is.
                    if x * x + y * y + z * z <= (gate * max(abs(u), abs(v))) ** 2:
                        n += 1
                        rows |= 1 << (u + radius)
                        columns |= 1 << (v + radius)
                        sums = _with(sums, x, y, z)
            if n < MINIMUM or LINES[rows] < 3 or LINES[columns] < 3:
                continue
            nx, ny, nz, toward, residual[i, j], narrow[i, j], _ = _plane(sums, n, vx, vy, vz)
            normals[i, j, 0], normals[i, j, 1], normals[i, j, 2] = nx, ny, nz
            if reach > 0.0:
                area[i, j] /= max(toward / reach, GRAZING)
    return normals, residual, area, narrow


@njit(error_model="numpy")
def fit_neighbours(
    points: Any, index: Any, distance: Any, of: Any, counts: Any, viewpoint: Any
) -> Any:
    """Fit planes to the points listed as neighbours.

    ``index`` (R, K) are the neighbours of the points ``of`` (R,), the nearest first, and
    ``distance`` (R, K) how far they are. Of each the least of ``counts`` is taken that spreads
    over a surface. The points of a ring of a LiDAR stand on a line until the next ring is among
    them, and where the ring turns a corner that line spans a plane which is no surface.

    Returns normals (R, 3) towards the viewpoint, zero where none of ``counts`` spreads, standard
    deviation left over (R,; NaN where no plane was fitted), the count taken (R,), how
    far these reach (R,) and their deviation along the plane, the way they spread least (R,).
    """
    rows = index.shape[0]
    normals = np.zeros((rows, 3))
    residual = np.full(rows, np.nan)
    support = np.zeros(rows)
    reach = np.zeros(rows)
    width = np.zeros(rows)
    for r in range(rows):
        i = of[r]
        vx = points[i, 0] - viewpoint[0]
        vy = points[i, 1] - viewpoint[1]
        vz = points[i, 2] - viewpoint[2]
        sums = NO_POINTS
        m = near = 0
        for count in counts:
            while m < count:
                j = index[r, m]
                x = points[j, 0] - points[i, 0]
                y = points[j, 1] - points[i, 1]
                z = points[j, 2] - points[i, 2]
                sums = _with(sums, x, y, z)
                m += 1
            support[r], reach[r] = count, distance[r, count - 1]
            while near < count and distance[r, near] <= 0.5 * reach[r]:
                near += 1
            if count < MINIMUM or near > CHAIN * count:
                continue
            nx, ny, nz, _, left, narrow, wide = _plane(sums, count, vx, vy, vz)
            if narrow < NARROW * wide:
                continue
            normals[r, 0], normals[r, 1], normals[r, 2] = nx, ny, nz
            residual[r], width[r] = left, narrow
            break
    return normals, residual, support, reach, width
