"""How well surfaces hold the pose: what their normals know of it, and what noise makes up."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import njit
from hmrf_icp.kernels.normal_equations import OPTIONS, SUMS, add_row, mean

BEYOND = 9.0
"""Times its mean that the square of a difference of normals is disagreement and not noise.

Three root mean squares, squared. Noise alone, about two tangents, has an exponential
distribution and gets there once in 8,000 matches: exp(-9). Little hangs on it: bare
surfaces and rooms are told apart with anything from 2 to 9. At 2 the noise itself is
cut short; from 16 on, wrong matches pass for noise and rooms seem free to move.
"""

DISAGREE = 0.3
"""Half a difference of normals, beyond noise, at which a match counts half.

Two surfaces that cross are no measurement of either.
"""


@njit(**OPTIONS)
def geometry(
    points: Any,
    normals: Any,
    onto: Any,
    onto_normals: Any,
    row: Any,
    weight: Any,
    apart: Any,
    trust: Any,
    centre: Any,
) -> Any:
    """Sum what surfaces know of the pose, and what noise in their normals makes up.

    Two sums: with half the sum of the normals of a match, and with half their
    difference. Where the square of that is more than ``BEYOND`` times ``apart`` (M,), what
    noise makes of it, it is shortened to ``apart``. Only the first sum has a gradient and
    a cost that mean something. Then the same two again, each match counted by the ``trust`` (M,)
    that its normals deserve, and for less where they disagree.
    """
    truth = np.zeros(SUMS)
    noise = np.zeros(SUMS)
    trusted = np.zeros(SUMS)
    trusted_noise = np.zeros(SUMS)
    for i in range(points.shape[0]):
        w = weight[i]
        if w == 0.0:
            continue
        k = row[i]
        x, y, z = points[i, 0] - centre[0], points[i, 1] - centre[1], points[i, 2] - centre[2]
        sx, sy, sz = normals[i, 0], normals[i, 1], normals[i, 2]
        nx, ny, nz = onto_normals[k, 0], onto_normals[k, 1], onto_normals[k, 2]
        ux, uy, uz = mean(sx, sy, sz, nx, ny, nz)
        residual = (
            ux * (points[i, 0] - onto[k, 0])
            + uy * (points[i, 1] - onto[k, 1])
            + uz * (points[i, 2] - onto[k, 2])
        )
        add_row(truth, x, y, z, ux, uy, uz, residual, w)
        dx, dy, dz = nx - ux, ny - uy, nz - uz
        square = dx * dx + dy * dy + dz * dz
        sure = w * trust[i]
        if square > BEYOND * apart[i]:
            shorter = math.sqrt(apart[i] / square)
            dx, dy, dz = shorter * dx, shorter * dy, shorter * dz
            sure /= 1.0 + (square / DISAGREE**2) ** 2
        add_row(noise, x, y, z, dx, dy, dz, 0.0, w)
        add_row(trusted, x, y, z, ux, uy, uz, residual, sure)
        add_row(trusted_noise, x, y, z, dx, dy, dz, 0.0, sure)
    return truth, noise, trusted, trusted_noise
