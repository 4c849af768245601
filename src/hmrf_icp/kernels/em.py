"""One pass of EM over the pixel grid: the E-step and the sums of the next M-step.

Each row is done in three short loops whose shape lets the compiler vectorise
them: one load of every array at one offset a loop (two offsets of one array
become a recurrence), and an exponential made of products only.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import ANY_ORDER, njit
from hmrf_icp.kernels.tanh import tanh_of_half

IN_WEIGHT, IN_FIRST, IN_SECOND, OUT_WEIGHT, OUT_FIRST, OUT_SECOND, CHANGED, CHANGED_TWO = range(8)
"""Columns of the sums that a pass gathers for every row.

Weight, first and second moment of the inliers and of the outliers, taken about
the means that the pass was called with (moments about zero lose a small
variance to rounding); how many signs differ from one step and two steps before.
"""

COLUMNS = 8


def _pass(scalar: Any) -> Any:
    """Build the pass for one precision."""
    zero, half, one, two = scalar(0), scalar(0.5), scalar(1), scalar(2)

    @njit(fastmath=ANY_ORDER, error_model="numpy")
    def em_pass(y: Any, observed: Any, z: Any, older: Any, new: Any, theta: Any, sums: Any) -> None:
        # z, older and new carry a margin of one pixel that stays 0, so that
        # a border pixel has fewer neighbours without a test in the loop.
        beta = scalar(theta[0])
        mean_in, precision_in = scalar(theta[1]), scalar(theta[2])
        mean_out, precision_out = scalar(theta[3]), scalar(theta[4])
        bias = scalar(theta[5])
        height, width = y.shape
        for i in range(height):
            up, here, down = z[i], z[i + 1], z[i + 2]
            before, out = older[i + 1], new[i + 1]
            distance, seen = y[i], observed[i]
            for j in range(width):
                out[j + 1] = up[j + 1] + down[j + 1] + here[j]
            for j in range(width):
                out[j + 1] += here[j + 2]
            in_0 = in_1 = in_2 = out_0 = out_1 = out_2 = zero
            changed = changed_two = zero
            for j in range(width):
                w = seen[j]
                d_in = distance[j] - mean_in
                d_out = distance[j] - mean_out
                log_odds = (
                    two * beta * out[j + 1]
                    + bias
                    - precision_in * d_in * d_in
                    + precision_out * d_out * d_out
                )
                value = w * tanh_of_half(log_odds)
                out[j + 1] = value
                p = half * (w + value)
                q = half * (w - value)
                in_0 += p
                in_1 += p * d_in
                in_2 += p * d_in * d_in
                out_0 += q
                out_1 += q * d_out
                out_2 += q * d_out * d_out
                changed += one if (value > zero) != (here[j + 1] > zero) else zero
                changed_two += one if (value > zero) != (before[j + 1] > zero) else zero
            row = sums[i]
            row[0], row[1], row[2] = in_0, in_1, in_2
            row[3], row[4], row[5] = out_0, out_1, out_2
            row[6], row[7] = changed, changed_two

    return em_pass


em_pass_double = _pass(np.float64)
em_pass_single = _pass(np.float32)
