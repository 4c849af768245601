"""The mean field: expected labels from what each point says and who its neighbours are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.errors import InputError
from hmrf_icp.field.graph import Neighbours, Update

Array = NDArray[np.float64]


def mean_field(
    log_odds: Array,
    z: Array,
    neighbours: Neighbours,
    beta: float | Array,
    steps: int = 20,
    *,
    update: Update = "simultaneous",
    tolerance: float = 0.0,
) -> Array:
    """Relax a field whose points have log-odds of their own to its expected labels.

    Each step sets ``z_i = tanh(beta sum_i' w_ii' z_i' + log_odds_i / 2)``, which
    is the paper's E-step with the Gaussians' log-ratio as ``log_odds``.

    Parameters
    ----------
    log_odds
        (M,) log P(+1) / P(-1) of every point by itself: likelihood ratio,
        prior, and any other evidence, added up. Infinities are allowed; beyond
        40, either way, a label is as certain as it gets.
    z
        (M,) labels to start from, in [-1, 1].
    neighbours
        A :class:`PixelGrid` or a :class:`NeighbourGraph` of M points.
    beta
        Strength of the field: a number, or one number a step (then ``steps`` is its length).
    steps
        Most steps.
    update
        ``"simultaneous"`` (the paper) or ``"sequential"`` (Celeux, Forbes and
        Peyrard 2003), in which a point sees what its neighbours have become
        within the step; it never climbs in free energy and settles in fewer steps.
    tolerance
        Stop when the labels move by this much or less on average in a step.

    Returns
    -------
    (M,) new labels in [-1, 1].

    Raises
    ------
    InputError
        Sizes differ, or an entry of ``log_odds`` or ``z`` is NaN.
    """
    log_odds = np.ascontiguousarray(log_odds, dtype=np.float64)
    z = np.ascontiguousarray(z, dtype=np.float64)
    if log_odds.shape != (neighbours.size,) or z.shape != (neighbours.size,):
        raise InputError(
            f"mean_field: expected log_odds and z of shape ({neighbours.size},), "
            f"got {log_odds.shape} and {z.shape}"
        )
    if np.isnan(log_odds).any() or np.isnan(z).any():
        raise InputError("mean_field: expected log_odds and z without NaN")
    strength = np.full(steps, beta) if np.ndim(beta) == 0 else np.asarray(beta, dtype=np.float64)
    strength = np.ascontiguousarray(strength, dtype=np.float64)
    return neighbours.steps(log_odds, z, strength, update, tolerance * neighbours.size)[0]
