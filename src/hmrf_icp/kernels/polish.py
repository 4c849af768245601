"""Of a few close target points, the one across from a source point; and how far both agree."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import njit
from hmrf_icp.kernels.normal_equations import OPTIONS, turned


@njit(**OPTIONS)
def across(
    points: Any,
    normals: Any,
    noise: Any,
    tilt: Any,
    onto: Any,
    onto_normals: Any,
    onto_noise: Any,
    onto_tilt: Any,
    near: Any,
    turn: Any,
    oriented: bool,
    least: float,
    beyond: float,
) -> Any:
    """Choose among the rows ``near`` (M, k) of the target the least far off along the surface.

    Returns the row chosen (M,), and the distance along the mean normal in deviations of the
    noise (M,): infinite where a normal is missing, faces the other way, or differs by
    more than ``beyond`` (a square) times what noise makes.
    """
    count, few = near.shape
    row = near[:, 0].copy()
    off = np.full(count, np.inf)
    for i in range(count):
        nx, ny, nz = turned(normals, i, turn)
        best = np.inf
        for j in range(few):
            k = near[i, j]
            mx, my, mz = onto_normals[k, 0], onto_normals[k, 1], onto_normals[k, 2]
            agree = nx * mx + ny * my + nz * mz
            if agree == 0.0 or (oriented and agree < 0.0):
                continue
            sign = 1.0 if agree > 0.0 else -1.0
            ax, ay, az = 0.5 * (mx + sign * nx), 0.5 * (my + sign * ny), 0.5 * (mz + sign * nz)
            square = ax * ax + ay * ay + az * az
            dx, dy, dz = (
                points[i, 0] - onto[k, 0],
                points[i, 1] - onto[k, 1],
                points[i, 2] - onto[k, 2],
            )
            along = ax * dx + ay * dy + az * dz
            aside = dx * dx + dy * dy + dz * dz - along * along / square
            if aside < best:
                best = aside
                row[i] = k
                apart = 0.5 * (tilt[i] * tilt[i] + onto_tilt[k] * onto_tilt[k])
                variance = noise[i] * noise[i] + onto_noise[k] * onto_noise[k] + 2.0 * least
                # Both normals have length 1: what half their difference has, half their sum lacks.
                differ = 1.0 - square > beyond * apart
                off[i] = np.inf if differ else abs(along) / math.sqrt(variance)
    return row, off
