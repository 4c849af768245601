"""The hyperbolic tangent of an E-step, by an exponential that is made of products only.

A call of the library's own would keep the loops that need it from being vectorised.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numba.extending import overload

from hmrf_icp.kernels.compiled import ANY_ORDER


def tanh_of_half(log_odds: Any) -> Any:
    """tanh(log_odds / 2) in the precision of its argument; for compiled callers only."""
    raise NotImplementedError


def _of_precision(scalar: Any, limit: float, halvings: int) -> Any:
    """Write it for one precision.

    ``exp(x) = exp(x / 2**k) ** (2**k)`` by a polynomial and ``k`` squarings:
    1e-13 off in double precision with k = 10, 4e-6 in single with k = 6.
    Beyond ``limit``, the hyperbolic tangent of half of it is 1 to the last digit.
    """
    half, one = scalar(0.5), scalar(1)
    low, high, scale = scalar(-limit), scalar(limit), scalar(0.5**halvings)
    c3, c4, c5, c6, c7 = (scalar(1 / n) for n in (6, 24, 120, 720, 5040))
    double = halvings > 6

    def tanh_of_half(log_odds: Any) -> Any:
        log_odds = high if log_odds > high else log_odds
        log_odds = low if log_odds < low else log_odds
        x = log_odds * scale
        tail = c5 + x * (c6 + x * c7) if double else c5
        e = one + x * (one + x * (half + x * (c3 + x * (c4 + x * tail))))
        for _ in range(halvings):
            e *= e
        return (e - one) / (e + one)

    return tanh_of_half


@overload(tanh_of_half, jit_options={"fastmath": ANY_ORDER, "error_model": "numpy"})
def _choose(log_odds: Any) -> Any:
    if log_odds == types.float32:
        return _of_precision(np.float32, 18.0, 6)
    return _of_precision(np.float64, 40.0, 10)
