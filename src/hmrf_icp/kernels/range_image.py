"""Projection into a range image, and what it says about points."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import njit

AGREE, FRONT, BEHIND, OUTSIDE, OTHER = range(5)
"""What a view says of a point.

It stands on the surface that was seen there, facing the same way; in space
that was looked through; hidden behind what was seen; where nothing was seen;
or on the surface but facing another way.
"""

FACING = 0.8
"""Cosine between two normals above which they face the same way."""


@njit(error_model="numpy")
def project(projection: Any, x: float, y: float, z: float) -> Any:
    """Row, column (fractional pixels) and depth of a point in the view's frame; depth 0 if none."""
    x -= projection[5]
    y -= projection[6]
    z -= projection[7]
    a = projection[8] * x + projection[9] * y + projection[10] * z
    b = projection[11] * x + projection[12] * y + projection[13] * z
    c = projection[14] * x + projection[15] * y + projection[16] * z
    if projection[0] == 0.0:
        if c <= 0.0:
            return 0.0, 0.0, 0.0
        return (
            projection[2] * b / c + projection[4],
            projection[1] * a / c + projection[3],
            c,
        )
    reach = math.sqrt(a * a + b * b + c * c)
    if reach <= 0.0:
        return 0.0, 0.0, 0.0
    elevation = math.asin(min(1.0, max(-1.0, c / reach)))
    return (
        projection[2] * elevation + projection[4],
        projection[1] * math.atan2(b, a) + projection[3],
        reach,
    )


@njit(error_model="numpy")
def classify(
    points: Any,
    normals: Any,
    pose: Any,
    projection: Any,
    depth: Any,
    row: Any,
    tolerance: Any,
    facing: Any,
    code: Any,
) -> None:
    """Write what a view says of each point (M, 3), moved by pose (4, 4) into its frame.

    ``facing`` are the normals of the points that the view shows. A point agrees
    with the pixel it falls on or one of the eight around it; it is in front, or
    behind, only of all of them.
    """
    height, width = depth.shape
    wraps = projection[0] != 0.0
    for k in range(points.shape[0]):
        x = pose[0, 0] * points[k, 0] + pose[0, 1] * points[k, 1] + pose[0, 2] * points[k, 2]
        y = pose[1, 0] * points[k, 0] + pose[1, 1] * points[k, 1] + pose[1, 2] * points[k, 2]
        z = pose[2, 0] * points[k, 0] + pose[2, 1] * points[k, 1] + pose[2, 2] * points[k, 2]
        v, u, reach = project(projection, x + pose[0, 3], y + pose[1, 3], z + pose[2, 3])
        code[k] = OUTSIDE
        i, j = math.floor(v + 0.5), math.floor(u + 0.5)
        if reach <= 0.0 or i < 0 or i >= height or ((j < 0 or j >= width) and not wraps):
            continue
        nx = pose[0, 0] * normals[k, 0] + pose[0, 1] * normals[k, 1] + pose[0, 2] * normals[k, 2]
        ny = pose[1, 0] * normals[k, 0] + pose[1, 1] * normals[k, 1] + pose[1, 2] * normals[k, 2]
        nz = pose[2, 0] * normals[k, 0] + pose[2, 1] * normals[k, 1] + pose[2, 2] * normals[k, 2]
        near, far, cosine = np.inf, -np.inf, -2.0
        for a in range(max(i - 1, 0), min(i + 2, height)):
            for b in range(j - 1, j + 2):
                if wraps:
                    b %= width
                elif b < 0 or b >= width:
                    continue
                m = row[a, b]
                if m < 0:
                    continue
                seen, band = depth[a, b], tolerance[a, b]
                near = min(near, seen - band)
                far = max(far, seen + band)
                if abs(reach - seen) < band:
                    c = nx * facing[m, 0] + ny * facing[m, 1] + nz * facing[m, 2]
                    cosine = max(cosine, c)
        j = j % width if wraps else j
        if cosine > FACING:
            code[k] = AGREE
        elif cosine > -2.0:
            code[k] = OTHER
        elif row[i, j] < 0:
            code[k] = OUTSIDE
        elif reach < near:
            code[k] = FRONT
        elif reach > far:
            code[k] = BEHIND
