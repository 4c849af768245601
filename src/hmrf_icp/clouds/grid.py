"""Neighbours on a grid of points: some pairs, spread over it, and how far apart they are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.cloud import at_most

Array = NDArray[np.float64]

PAIRS = 20_000
"""Pairs of neighbours that are enough to tell how far apart rows and columns are."""


def beside(points: Array) -> list[tuple[Array, Array]]:
    """Choose points (M, 3) of a grid (H, W, 3) and the next of their columns, and of their rows."""
    pairs = (points[:-1], points[1:]), (points[:, :-1], points[:, 1:])
    return [
        (at_most(near.reshape(-1, 3), PAIRS), at_most(far.reshape(-1, 3), PAIRS))
        for near, far in pairs
    ]


def lengths(vectors: Array) -> Array:
    """Length (M,) of vectors (M, 3); ``norm`` along the rows takes three times as long."""
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", vectors, vectors)))


def median(values: Array) -> float:
    """Median of those that are finite, 0 of none."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else 0.0
