"""Points of a depth map laid out in its pixels again, by the slopes of the rays they stand on.

``combs`` (2, 2) turn slopes into pixels: x / |z| times its first number, less its second, is the
column, and y / z the row likewise.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import njit


@njit(error_model="numpy")
def extent(points: Any, combs: Any, off: float) -> Any:
    """Tell the first column and row, and the last of both, (4,), that points (N, 3) stand in.

    NaN where one is farther than ``off`` from the middle of its pixel, or behind the camera.
    """
    ends = np.array([np.inf, np.inf, -np.inf, -np.inf])
    forward = points[0, 2] > 0.0
    for i in range(points.shape[0]):
        z = points[i, 2]
        x = points[i, 0] / abs(z) * combs[0, 0] - combs[0, 1]
        y = points[i, 1] / z * combs[1, 0] - combs[1, 1]
        u, v = np.rint(x), np.rint(y)
        if not (abs(x - u) <= off and abs(y - v) <= off and (z > 0.0) == forward):
            ends[:] = np.nan
            break
        ends[0], ends[1] = min(ends[0], u), min(ends[1], v)
        ends[2], ends[3] = max(ends[2], u), max(ends[3], v)
    return ends


@njit(error_model="numpy")
def lay(points: Any, combs: Any, first: Any, image: Any, place: Any) -> Any:
    """Lay points (N, 3) out in an ``image`` (H, W, 3) of NaN whose first pixel is ``first`` (2,).

    ``place`` (N,) becomes the pixel of each, row * W + column. Returns how many found theirs empty.
    """
    alone = 0
    for i in range(points.shape[0]):
        z = points[i, 2]
        u = int(np.rint(points[i, 0] / abs(z) * combs[0, 0] - combs[0, 1]) - first[0])
        v = int(np.rint(points[i, 1] / z * combs[1, 0] - combs[1, 1]) - first[1])
        place[i] = v * image.shape[1] + u
        if np.isnan(image[v, u, 0]):
            alone += 1
        image[v, u, 0], image[v, u, 1], image[v, u, 2] = points[i, 0], points[i, 1], z
    return alone
