"""Distributions of the distance between a point and its match, for inliers and for outliers.

Each is a frozen value with the same three abilities: fitted to weighted
distances by maximum likelihood (the M-step of a mixture), its logarithmic
density (what the E-step needs), and its parameters. Scales have a floor
that follows the distances, so that distances ten times as large give
parameters ten times as large and nothing else, and nothing ever gives NaN.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.errors import InputError

Array = NDArray[np.float64]

SCALE_FLOOR = 1e-6
"""Smallest scale, as a share of the largest distance: identical clouds have none of their own."""

SCALE_FLOOR_ABSOLUTE = 1e-15
"""Smallest scale where every distance is zero, metres."""

ZERO = 1e-9
"""Distance, as a share of the distribution's own scale, that stands for 0 under a logarithm."""

LOG_NOTHING = -700.0
"""Logarithmic density outside of a uniform distribution: no infinity to subtract from another."""

LOG_DEVIATION_FLOOR = 0.05
"""Smallest deviation of the logarithm: equal distances have none of their own."""

SHAPES = (0.25, 400.0)
"""Range of the gamma distribution's shape: a pole at 0, to a deviation of 5 % of the mean."""

NEWTON_STEPS = 8
"""Most Newton steps of a fit without closed form; four are usual."""


class Residual(Protocol):
    """A distribution of distances."""

    name: ClassVar[str]
    units: ClassVar[Mapping[str, str]]
    """Unit of every parameter, ``"m"`` or ``""``; as many as there are free parameters."""

    def fit(self, y: Array, weight: Array, smallest: float = 0.0) -> Residual:
        """Fit by weighted maximum likelihood.

        Parameters
        ----------
        y
            (M,) distances of 0 or more, metres.
        weight
            (M,) weights of 0 or more. Where they add up to nothing, the
            distribution stays as it is.
        smallest
            Floor under the scale, metres, beside 1e-6 of the largest distance.
        """

    def log_density(self, y: Array) -> Array:
        """Logarithm of the density, 1/m, at distances (M,) in metres; always finite."""

    @property
    def parameters(self) -> Mapping[str, float]:
        """Value of every parameter, in the units of ``units``."""

    @property
    def mean(self) -> float:
        """Expected distance, metres."""


class _Named:
    """What all have in common: parameters are the fields, counted by their units."""

    name: ClassVar[str]
    units: ClassVar[Mapping[str, str]]

    @property
    def parameters(self) -> Mapping[str, float]:
        """Value of every parameter, in the units of ``units``."""
        return MappingProxyType({key: float(getattr(self, key)) for key in self.units})


def dot(a: Array, b: Array) -> float:
    """Sum of products, in one thread: waking a second one takes longer than the sum."""
    return float(np.einsum("i,i->", a, b))


def least_scale(y: Array, smallest: float) -> float:
    """Floor under a scale fitted to distances, metres."""
    return max(smallest, SCALE_FLOOR * float(y.max(initial=0.0)), SCALE_FLOOR_ABSOLUTE)


@dataclass(frozen=True)
class Gaussian(_Named):
    """Normal distribution on the whole line (Stechschulte and Heckman 2017; both components)."""

    mu: float = 0.0
    sigma: float = 1.0

    name: ClassVar[str] = "gaussian"
    units: ClassVar[Mapping[str, str]] = MappingProxyType({"mu": "m", "sigma": "m"})

    def fit(self, y: Array, weight: Array, smallest: float = 0.0) -> Gaussian:
        """Take the weighted mean and standard deviation."""
        total = weight.sum()
        if total <= 0.0:
            return self
        mu = dot(weight, y) / total
        sigma = float(np.sqrt(dot(weight, (y - mu) ** 2) / total))
        return Gaussian(mu, max(sigma, least_scale(y, smallest)))

    def log_density(self, y: Array) -> Array:
        """Logarithm of the density, 1/m."""
        return -0.5 * ((y - self.mu) / self.sigma) ** 2 - math.log(
            self.sigma * math.sqrt(2 * math.pi)
        )

    @property
    def mean(self) -> float:
        """Expected distance, metres."""
        return self.mu


@dataclass(frozen=True)
class Logistic(_Named):
    """Logistic distribution on the whole line, with tails longer than a normal's.

    The outliers of the follow-up (Stechschulte, Ahmed and Heckman, ICRA 2019).
    """

    mu: float = 0.0
    scale: float = 1.0

    name: ClassVar[str] = "logistic"
    units: ClassVar[Mapping[str, str]] = MappingProxyType({"mu": "m", "scale": "m"})

    def fit(self, y: Array, weight: Array, smallest: float = 0.0) -> Logistic:
        """Climb the likelihood by Newton's method.

        With a = 1/scale and b = mu/scale the log-likelihood
        sum w (log a - t - 2 log(1 + exp(-t))), t = a y - b, is concave, so
        that steps halved until they climb arrive. They start from the moments, or from
        the present parameters where those are likelier, as within EM.
        """
        total = weight.sum()
        if total <= 0.0:
            return self
        floor = least_scale(y, smallest)
        mean = dot(weight, y) / total
        deviation = float(np.sqrt(dot(weight, (y - mean) ** 2) / total))
        if deviation * math.sqrt(3) / math.pi <= floor:
            return Logistic(mean, floor)
        x, w = (y - mean) / deviation, weight / total
        a, b = math.pi / math.sqrt(3), 0.0
        best = _logistic_likelihood(x, w, a, b)
        present = deviation / self.scale, (self.mu - mean) / self.scale
        likelihood = _logistic_likelihood(x, w, *present)
        if likelihood > best:
            best, (a, b) = likelihood, present
        for _ in range(NEWTON_STEPS):
            half = np.tanh(0.5 * (a * x - b))
            curve = 0.5 * w * (1.0 - half**2)
            by_a, by_b = 1.0 / a - dot(w * half, x), float((w * half).sum())
            h_aa, h_ab, h_bb = 1.0 / a**2 + dot(curve, x**2), -dot(curve, x), curve.sum()
            determinant = float(h_aa * h_bb - h_ab**2)
            if determinant <= 0.0:
                break
            step_a = float(h_bb * by_a - h_ab * by_b) / determinant
            step_b = float(h_aa * by_b - h_ab * by_a) / determinant
            for _ in range(NEWTON_STEPS):
                tried = a + step_a, b + step_b
                likelihood = _logistic_likelihood(x, w, *tried)
                if likelihood >= best:
                    break
                step_a, step_b = 0.5 * step_a, 0.5 * step_b
            else:
                break
            gained, best, (a, b) = likelihood - best, likelihood, tried
            if gained < 1e-12:
                break
        return Logistic(mean + deviation * float(b / a), max(deviation / float(a), floor))

    def log_density(self, y: Array) -> Array:
        """Logarithm of the density, 1/m."""
        t = np.abs(y - self.mu) / self.scale
        return -t - 2.0 * np.log1p(np.exp(-t)) - math.log(self.scale)

    @property
    def mean(self) -> float:
        """Expected distance, metres."""
        return self.mu


def _logistic_likelihood(x: Array, w: Array, a: float, b: float) -> float:
    if a <= 0.0:
        return -math.inf
    t = np.abs(a * x - b)
    return math.log(a) - dot(w, t + 2.0 * np.log1p(np.exp(-t)))


@dataclass(frozen=True)
class HalfNormal(_Named):
    """Normal distribution about 0, folded: an error in one direction (Daniel 1959)."""

    sigma: float = 1.0

    name: ClassVar[str] = "half-normal"
    units: ClassVar[Mapping[str, str]] = MappingProxyType({"sigma": "m"})

    def fit(self, y: Array, weight: Array, smallest: float = 0.0) -> HalfNormal:
        """Take the weighted root mean square."""
        total = weight.sum()
        if total <= 0.0:
            return self
        return HalfNormal(max(float(np.sqrt(dot(weight, y**2) / total)), least_scale(y, smallest)))

    def log_density(self, y: Array) -> Array:
        """Logarithm of the density, 1/m."""
        return -0.5 * (y / self.sigma) ** 2 - math.log(self.sigma * math.sqrt(math.pi / 2))

    @property
    def mean(self) -> float:
        """Expected distance, metres."""
        return self.sigma * math.sqrt(2 / math.pi)


@dataclass(frozen=True)
class LogNormal(_Named):
    """Distribution whose logarithm is normal: many small errors multiplied (Galton 1879).

    Parameters
    ----------
    median
        exp of the mean logarithm, metres.
    spread
        Standard deviation of the logarithm.
    """

    median: float = 1.0
    spread: float = 1.0

    name: ClassVar[str] = "log-normal"
    units: ClassVar[Mapping[str, str]] = MappingProxyType({"median": "m", "spread": ""})

    def fit(self, y: Array, weight: Array, smallest: float = 0.0) -> LogNormal:
        """Take the weighted mean and deviation of the logarithm; distances count from the floor."""
        total = weight.sum()
        if total <= 0.0:
            return self
        logarithm = np.log(np.maximum(y, least_scale(y, smallest)))
        mean = dot(weight, logarithm) / total
        spread = float(np.sqrt(dot(weight, (logarithm - mean) ** 2) / total))
        return LogNormal(math.exp(mean), max(spread, LOG_DEVIATION_FLOOR))

    def log_density(self, y: Array) -> Array:
        """Logarithm of the density, 1/m."""
        logarithm = np.log(np.maximum(y, ZERO * self.median) / self.median)
        return (
            -0.5 * (logarithm / self.spread) ** 2
            - logarithm
            - math.log(self.median * self.spread * math.sqrt(2 * math.pi))
        )

    @property
    def mean(self) -> float:
        """Expected distance, metres."""
        return self.median * math.exp(0.5 * self.spread**2)


@dataclass(frozen=True)
class Exponential(_Named):
    """Exponential distribution, without memory: the least that a mean distance says (Jaynes 1957).

    Parameters
    ----------
    scale
        The mean, metres.
    """

    scale: float = 1.0

    name: ClassVar[str] = "exponential"
    units: ClassVar[Mapping[str, str]] = MappingProxyType({"scale": "m"})

    def fit(self, y: Array, weight: Array, smallest: float = 0.0) -> Exponential:
        """Take the weighted mean."""
        total = weight.sum()
        if total <= 0.0:
            return self
        return Exponential(max(dot(weight, y) / total, least_scale(y, smallest)))

    def log_density(self, y: Array) -> Array:
        """Logarithm of the density, 1/m."""
        return -y / self.scale - math.log(self.scale)

    @property
    def mean(self) -> float:
        """Expected distance, metres."""
        return self.scale


@dataclass(frozen=True)
class Gamma(_Named):
    """Gamma distribution, from a pole at 0 to a bell (fit: Minka 2002, generalised Newton)."""

    shape: float = 1.0
    scale: float = 1.0

    name: ClassVar[str] = "gamma"
    units: ClassVar[Mapping[str, str]] = MappingProxyType({"shape": "", "scale": "m"})

    def fit(self, y: Array, weight: Array, smallest: float = 0.0) -> Gamma:
        """Match the mean, and the mean logarithm by Newton steps on 1/shape."""
        total = weight.sum()
        if total <= 0.0:
            return self
        from scipy.special import digamma, zeta

        floor = least_scale(y, smallest)
        mean = max(dot(weight, y) / total, floor)
        logarithm = dot(weight, np.log(np.maximum(y, floor))) / total
        gap = max(math.log(mean) - logarithm, 0.5 / SHAPES[1])
        shape = min(max(0.5 / gap, SHAPES[0]), SHAPES[1])
        for _ in range(NEWTON_STEPS):
            before = shape
            # zeta(2, .) is the derivative of the digamma function.
            slope = shape**2 * (1.0 / shape - float(zeta(2.0, shape)))
            inverse = 1.0 / shape + (math.log(shape) - gap - float(digamma(shape))) / slope
            shape = SHAPES[1] if inverse <= 0.0 else min(max(1.0 / inverse, SHAPES[0]), SHAPES[1])
            if abs(shape - before) <= 1e-10 * before:
                break
        return Gamma(shape, mean / shape)

    def log_density(self, y: Array) -> Array:
        """Logarithm of the density, 1/m."""
        x = np.maximum(y / self.scale, ZERO)
        constant = math.lgamma(self.shape) + math.log(self.scale)
        return np.asarray((self.shape - 1.0) * np.log(x) - x - constant)

    @property
    def mean(self) -> float:
        """Expected distance, metres."""
        return self.shape * self.scale


@dataclass(frozen=True)
class Uniform(_Named):
    """Anything from 0 to a maximum is as likely (Banfield and Raftery 1993, for noise points)."""

    maximum: float = 1.0

    name: ClassVar[str] = "uniform"
    units: ClassVar[Mapping[str, str]] = MappingProxyType({"maximum": "m"})

    def fit(self, y: Array, weight: Array, smallest: float = 0.0) -> Uniform:
        """Take the largest distance that has any weight."""
        weighted = y[weight > 0.0]
        if weighted.size == 0:
            return self
        return Uniform(max(float(weighted.max()), least_scale(y, smallest)))

    def log_density(self, y: Array) -> Array:
        """Logarithm of the density, 1/m."""
        inside = -math.log(self.maximum)
        return np.where((y >= 0.0) & (y <= self.maximum), inside, inside + LOG_NOTHING)

    @property
    def mean(self) -> float:
        """Expected distance, metres."""
        return 0.5 * self.maximum


_BY_NAME: dict[str, Residual] = {
    kind.name: kind()
    for kind in (Gaussian, Logistic, HalfNormal, LogNormal, Exponential, Gamma, Uniform)
}


def names() -> tuple[str, ...]:
    """Names that :func:`residual` knows."""
    return tuple(_BY_NAME)


def residual(named: str | Residual) -> Residual:
    """Look a distribution up by name; an instance is returned as it is.

    Raises
    ------
    InputError
        There is none of that name.
    """
    if not isinstance(named, str):
        return named
    if named not in _BY_NAME:
        raise InputError(f"residual: unknown {named!r}, expected one of {', '.join(names())}")
    return _BY_NAME[named]
