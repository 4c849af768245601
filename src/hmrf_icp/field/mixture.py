"""Two distributions of distances in one: inliers and outliers, and which pair fits the data best.

No field here: every point is independent, as in a plain mixture. It is
what the choice of distributions is made by (the paper's conclusion asks for
one), and what a figure of the distances shows.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.errors import InputError
from hmrf_icp.field.residuals import Residual, dot, names, residual

Array = NDArray[np.float64]

SHARE_FLOOR = 0.01
"""Least share of either component: below it, a component fits a handful of points or none."""

SUMMARY = 256
"""Quantiles that stand for all distances when pairs are compared."""

EM_STEPS = 100
"""Most EM steps of a fit."""

SETTLED = 1e-5
"""Gain in log-likelihood a point below which EM has settled."""


@dataclass(frozen=True)
class Mixture:
    """Inliers with probability ``share``, outliers with the rest.

    Attributes
    ----------
    inlier, outlier
        The components.
    share
        Prior probability of being an inlier.
    log_likelihood
        Logarithmic density of the points it was fitted to, added up.
    points
        That number.
    """

    inlier: Residual
    outlier: Residual
    share: float
    log_likelihood: float = -math.inf
    points: int = 0

    def log_odds(self, y: Array) -> Array:
        """(M,) log P(inlier | y) / P(outlier | y)."""
        prior = math.log(self.share / (1.0 - self.share))
        return self.inlier.log_density(y) - self.outlier.log_density(y) + prior

    def probability(self, y: Array) -> Array:
        """(M,) P(inlier | y)."""
        return np.asarray(0.5 + 0.5 * np.tanh(0.5 * self.log_odds(y)))

    def log_density(self, y: Array) -> Array:
        """(M,) logarithm of the density of all distances, 1/m."""
        return np.asarray(
            np.logaddexp(
                self.inlier.log_density(y) + math.log(self.share),
                self.outlier.log_density(y) + math.log(1.0 - self.share),
            )
        )

    @property
    def bic(self) -> float:
        """Bayesian information criterion (Schwarz 1978); the smaller, the better.

        -2 log-likelihood + (free parameters, the share among them) log(points).
        A change of units adds one constant to all mixtures of the same points.
        """
        free = len(self.inlier.units) + len(self.outlier.units) + 1
        return free * math.log(max(self.points, 1)) - 2.0 * self.log_likelihood

    def nearer(self, y: Array) -> bool:
        """Whether the inliers are the nearer component.

        Their mean is the smaller one, and the nearest tenth of the distances is
        likelier theirs than the farthest tenth, and than all on average.
        """
        if not self.inlier.mean < self.outlier.mean:
            return False
        probability = self.probability(np.sort(y))
        tenth = max(1, y.size // 10)
        near, far = float(probability[:tenth].mean()), float(probability[-tenth:].mean())
        return near > far and near >= self.share


def fit(
    y: Array,
    inlier: str | Residual,
    outlier: str | Residual,
    *,
    weight: Array | None = None,
    initial: float = 0.5,
    smallest: float = 0.0,
    steps: int = EM_STEPS,
) -> Mixture:
    """Fit a mixture by EM.

    Parameters
    ----------
    y
        (M,) distances of 0 or more, metres.
    inlier, outlier
        Distributions, by name or instance; only their kinds matter.
    weight
        (M,) how many points each distance stands for, more than 0; None for one.
    initial
        Share of the distances, the nearest, that start as inliers.
    smallest
        Floor under the scales, metres.
    steps
        Most EM steps.

    Raises
    ------
    InputError
        There are no distances, or some are negative or not finite.
    """
    y = checked(y)
    weight = np.ones_like(y) if weight is None else weight
    total = float(weight.sum())
    near = weight * (y <= np.quantile(y, initial))
    # Fitted to everything first, for the component that has no point of its own to start from.
    mixture = Mixture(
        residual(inlier).fit(y, weight, smallest).fit(y, near, smallest),
        residual(outlier).fit(y, weight, smallest).fit(y, weight - near, smallest),
        min(max(float(near.sum()) / total, SHARE_FLOOR), 1.0 - SHARE_FLOOR),
    )
    before = -math.inf
    for _ in range(steps):
        probability = mixture.probability(y)
        mixture = Mixture(
            mixture.inlier.fit(y, weight * probability, smallest),
            mixture.outlier.fit(y, weight * (1.0 - probability), smallest),
            min(max(dot(weight, probability) / total, SHARE_FLOOR), 1.0 - SHARE_FLOOR),
        )
        likelihood = dot(weight, mixture.log_density(y)) / total
        if likelihood - before < SETTLED:
            break
        before = likelihood
    return replace(mixture, log_likelihood=dot(weight, mixture.log_density(y)), points=round(total))


def compare(
    y: Array,
    inliers: Iterable[str | Residual] | None = None,
    outliers: Iterable[str | Residual] | None = None,
    *,
    initial: float = 0.5,
    smallest: float = 0.0,
    summary: int = SUMMARY,
) -> tuple[Mixture, ...]:
    """Fit every pair of distributions; the best by BIC first.

    Pairs whose inliers are not the nearer component come after all others.

    Parameters
    ----------
    y
        (M,) distances of 0 or more, metres.
    inliers, outliers
        Distributions to try; None tries all.
    initial
        Share of the points, the nearest, that start as inliers.
    smallest
        Floor under the scales, metres.
    summary
        More points than this are stood for by as many quantiles, each worth an
        equal part of the points: a choice takes a fraction of a second then.

    Raises
    ------
    InputError
        There are no distances, some are negative or not finite, or a name is unknown.
    """
    y = checked(y)
    weight = np.ones_like(y)
    if y.size > summary:
        # The largest is one point among many, and no quantile: a uniform distribution ends there.
        few = np.append(np.quantile(y, (np.arange(summary) + 0.5) / summary), y.max())
        weight = np.append(np.full(summary, (y.size - 1) / summary), 1.0)
        y = few
    found: list[tuple[bool, float, Mixture]] = []
    seconds = names() if outliers is None else tuple(outliers)
    for first in names() if inliers is None else inliers:
        for second in seconds:
            fitted = fit(y, first, second, weight=weight, initial=initial, smallest=smallest)
            found.append((not fitted.nearer(y), fitted.bic, fitted))
    return tuple(mixture for _, _, mixture in sorted(found, key=lambda entry: entry[:2]))


def choose(
    y: Array,
    inliers: Iterable[str | Residual] | None = None,
    outliers: Iterable[str | Residual] | None = None,
    *,
    initial: float = 0.5,
    smallest: float = 0.0,
) -> Mixture:
    """Find the pair of distributions that the distances speak for; see :func:`compare`."""
    return compare(y, inliers, outliers, initial=initial, smallest=smallest)[0]


def checked(y: Array) -> Array:
    """Distances as floating point.

    Raises
    ------
    InputError
        There are none, or some are negative or not finite.
    """
    y = np.asarray(y, dtype=np.float64).ravel()
    if y.size == 0:
        raise InputError("distances: expected at least one, got none")
    if not np.isfinite(y).all() or y.min() < 0.0:
        raise InputError("distances: expected finite numbers of 0 or more")
    return y
