"""beta, the strength of the agreement between neighbours: scheduled, or learnt from the labels."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.errors import InputError

Array = NDArray[np.float64]

LARGEST = 3.0
"""Largest estimate: labels without a single dissenter would have infinity."""

NEWTON_STEPS = 30
"""Most Newton steps of an estimate; from the estimate before, two or three are usual."""


@dataclass(frozen=True)
class Schedule:
    """beta that rises by the ICP iteration, from ``start`` before the first to ``end``.

    A strong field in the first iterations holds on to the first guess; one that
    comes in when the two kinds of distances have separated lets it go.

    Parameters
    ----------
    end
        beta from iteration ``iterations`` on.
    start
        beta before the first motion.
    iterations
        Over how many iterations it rises, in equal steps.

    Raises
    ------
    InputError
        One of them is negative or not finite.
    """

    end: float = 2.0
    start: float = 0.0
    iterations: int = 10

    def __post_init__(self) -> None:
        """Refuse what is no strength."""
        if not (0 <= self.end < math.inf and 0 <= self.start < math.inf and self.iterations >= 0):
            raise InputError(f"beta: expected numbers of 0 or more, got {self}")

    def at(self, iteration: int) -> float:
        """Beta of an ICP iteration; 0 is the decision before the first motion."""
        if iteration >= self.iterations:
            return self.end
        return self.start + (self.end - self.start) * iteration / self.iterations


@dataclass(frozen=True)
class BetaPrior:
    """BetaPrior of a label given its neighbours: P(+1) = 1 / (1 + exp(-2 beta s - log_odds)).

    Attributes
    ----------
    beta
        Strength of the field.
    log_odds
        External field that all points share; 0 prefers neither label.
    """

    beta: float
    log_odds: float = 0.0


def pseudo_likelihood(z: Array, sums: Array, prior: BetaPrior) -> float:
    """Log-pseudo-likelihood of expected labels, a point (Besag 1975).

    Parameters
    ----------
    z
        (M,) labels in [-1, 1]; a soft label counts as both, by its probabilities.
    sums
        (M,) sum_i' w_ii' z_i' over the neighbours.
    prior
        The parameters.
    """
    eta = 2.0 * prior.beta * sums + prior.log_odds
    return float((0.5 * (z - 1.0) * eta - np.logaddexp(0.0, -eta)).mean())


def most_likely(
    z: Array,
    sums: Array,
    start: BetaPrior,
    *,
    learn_beta: bool = True,
    learn_share: bool = True,
    largest: float = LARGEST,
    share_floor: float = 0.01,
) -> BetaPrior:
    """Maximise the pseudo-likelihood over beta, over the shared log-odds, or over both.

    The pseudo-likelihood is that of a logistic regression of each label on its
    neighbours, and concave. Newton's method with steps halved until they climb;
    beta is kept in [0, largest], the log-odds in the range of ``share_floor``.
    With beta = 0 the log-odds are those of the mean label, which is the
    M-step of a plain mixture.

    Parameters
    ----------
    z, sums
        (M,) labels in [-1, 1], and what their neighbours add up to.
    start
        Where to start; what is not learnt stays as it is there.
    learn_beta, learn_share
        What to learn.
    largest
        Upper bound of beta.
    share_floor
        Lower bound of either label's share, as log-odds.
    """
    bound = math.log((1.0 - share_floor) / share_floor)
    low, high = np.array([0.0, -bound]), np.array([largest, bound])
    learnt = np.array([learn_beta, learn_share])
    at = np.array([start.beta, start.log_odds])
    at = np.where(learnt, np.clip(at, low, high), at)
    best = pseudo_likelihood(z, sums, BetaPrior(*at))
    inputs = np.stack([2.0 * sums, np.ones_like(sums)])
    for _ in range(NEWTON_STEPS):
        half = np.tanh(0.5 * (at @ inputs))
        gradient = inputs @ (0.5 * (z - half)) / z.size
        curvature = (inputs * (0.25 * (1.0 - half**2))) @ inputs.T / z.size
        # What stands at a bound and would leave it does not move: an active set of two.
        held = ~learnt | ((at <= low) & (gradient <= 0.0)) | ((at >= high) & (gradient >= 0.0))
        if held.all():
            break
        free = ~held
        step = np.zeros(2)
        damped = curvature[np.ix_(free, free)] + 1e-12 * np.eye(int(free.sum()))
        step[free] = np.linalg.solve(damped, gradient[free])
        for _ in range(NEWTON_STEPS):
            tried = np.where(learnt, np.clip(at + step, low, high), at)
            likelihood = pseudo_likelihood(z, sums, BetaPrior(*tried))
            if likelihood >= best:
                break
            step = 0.5 * step
        else:
            break
        gained, best, at = likelihood - best, likelihood, tried
        if gained < 1e-10:
            break
    return BetaPrior(float(at[0]), float(at[1]))
