"""The hidden Markov random field of the paper: labels that agree with their pixel neighbours.

Z_i in {-1, +1} says whether source pixel i has a counterpart. Its prior is the
Gibbs distribution with energy H(z) = -beta sum_{i~i'} z_i z_i' over the four
neighbours; Y_i given Z_i is Gaussian; EM with the mean-field approximation
finds the expected labels and the parameters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.errors import InputError
from hmrf_icp.field.residuals import dot
from hmrf_icp.frozen import FrozenDict
from hmrf_icp.loop.match import Matches
from hmrf_icp.loop.reject import Labels, Reject

Array = NDArray[np.float64]

SIGMA_FLOOR = 1e-6
"""Smallest sigma, as a share of the largest distance: identical clouds have none of their own."""

SIGMA_FLOOR_ABSOLUTE = 1e-15
"""Smallest sigma where every distance is zero, metres."""


class Theta(NamedTuple):
    """Parameters of the two Gaussians, metres; sigma is a standard deviation."""

    mu_in: float
    sigma_in: float
    mu_out: float
    sigma_out: float


@dataclass(frozen=True)
class HiddenMarkovRandomField:
    """The paper's rule: EM on a two-Gaussian mixture with a Markov random field prior.

    A component that loses all its weight keeps the parameters of the step
    before (at the first step, the mean and deviation of all distances), and
    every sigma is at least 1e-6 of the largest distance, so that neither two
    identical clouds nor a target that covers everything gives NaN.

    Parameters
    ----------
    beta
        Strength of the agreement between neighbours, 0 for none. The paper uses 2.
    outliers
        Share of the points, those with the largest distances, that start as outliers.
    first_steps, steps
        Most EM steps before the first motion, and within each ICP iteration; 0
        leaves the labels as they are.
    precision
        ``"double"`` as published, or ``"single"``, less than half the time:
        z then differs by less than 1e-4, as measured on a VGA pair
        (``benchmarks/em_iteration.py`` measures both).

    Raises
    ------
    InputError
        A parameter is out of its range.

    Examples
    --------
    >>> from hmrf_icp import HiddenMarkovRandomField, presets
    >>> presets.preset("paper").reject == HiddenMarkovRandomField()
    True
    """

    beta: float = 2.0
    outliers: float = 0.1
    first_steps: int = 600
    steps: int = 20
    precision: Literal["double", "single"] = "double"

    def __post_init__(self) -> None:
        """Refuse what the model has no meaning for."""
        if not 0.0 <= self.beta < np.inf:
            raise InputError(f"beta: expected a finite number of 0 or more, got {self.beta}")
        if not 0.0 <= self.outliers < 1.0:
            raise InputError(f"outliers: expected a share in [0, 1), got {self.outliers}")
        if self.first_steps < 0 or self.steps < 0:
            raise InputError(
                "first_steps, steps: expected numbers of EM steps of 0 or more, "
                f"got {self.first_steps}, {self.steps}"
            )
        if self.precision not in ("double", "single"):
            raise InputError(f'precision: expected "double" or "single", got {self.precision!r}')

    def prepare(self, source: PreparedCloud, target: PreparedCloud) -> Reject:
        """Lay out the grid of the source.

        Raises
        ------
        InputError
            The source is not organised: the paper's neighbours are pixels.
        """
        if not source.cloud.organised:
            raise InputError(
                "source: the paper's random field needs a cloud organised as an image, (H, W, 3), "
                f"got {source.cloud!r}; make it with PointCloud.from_depth, or choose another "
                "rejector"
            )
        grid = Grid(source.cloud.observed, self.precision)

        def reject(matches: Matches, before: Labels | None) -> Labels:
            y = matches.distance
            if before is None:
                return grid.em(y, initial_labels(y, self.outliers), self.beta, self.first_steps)
            return grid.em(y, before.z, self.beta, self.steps)

        return reject


def initial_labels(distance: Array, outliers: float) -> Array:
    """z^(0): -1 for distances above the (1 - outliers) quantile, +1 for the rest."""
    return np.where(distance > np.percentile(distance, 100.0 * (1.0 - outliers)), -1.0, 1.0)


def m_step(y: Array, z: Array) -> Theta:
    """M-step from labels: weighted mean and standard deviation of each component."""
    theta = []
    for weight in (0.5 * (1.0 + z), 0.5 * (1.0 - z)):
        total = weight.sum()
        if total <= 0.0:
            weight, total = np.ones_like(y), float(y.size)
        mu = dot(weight, y) / total
        theta += [mu, math.sqrt(dot(weight, (y - mu) ** 2) / total)]
    return Theta(*theta)


class Grid:
    """EM over one pixel grid; the working arrays are allocated once and used by every step.

    Parameters
    ----------
    observed
        (H, W), where there is a label. An unobserved pixel adds nothing to its
        neighbours or to the M-step: its z is 0 throughout.
    precision
        Of the E-step; the sums of the M-step are added up in double precision.
    """

    def __init__(self, observed: NDArray[np.bool_], precision: str) -> None:
        from hmrf_icp.kernels import em

        dtype = np.float64 if precision == "double" else np.float32
        self._pass = em.em_pass_double if precision == "double" else em.em_pass_single
        self._columns = em
        height, width = observed.shape
        self._mask = observed
        self._observed = observed.astype(dtype)
        self._y = np.zeros((height, width), dtype)
        self._z = [np.zeros((height + 2, width + 2), dtype) for _ in range(3)]
        self._sums = np.zeros((height, em.COLUMNS))

    def em(self, y: Array, z: Array, beta: float, most_steps: int) -> Labels:
        """Run EM until every sign is that of one or of two steps before.

        Parameters
        ----------
        y, z
            (M,) distances (m) and labels of the observed pixels.
        beta
            Strength of the field.
        most_steps
            Steps after which it stops in any case.
        """
        newest, older, oldest = self._z
        self._y[self._mask] = y
        newest[1:-1, 1:-1][self._mask] = z
        # The first step has only one step before it: what it is compared with twice is itself.
        older[...] = newest
        floor = max(SIGMA_FLOOR * float(y.max()), SIGMA_FLOOR_ABSOLUTE)
        theta = floored(m_step(y, z), floor)
        learnt, taken, converged = theta, 0, most_steps == 0
        while taken < most_steps:
            taken += 1
            learnt = theta
            newest, older, oldest = self._e_step(theta, beta, newest, older, oldest)
            sums = self._sums.sum(axis=0)
            if sums[self._columns.CHANGED] == 0 or sums[self._columns.CHANGED_TWO] == 0:
                converged = True
                break
            theta = floored(self._m_step(sums, theta), floor)
        values = newest[1:-1, 1:-1][self._mask].astype(np.float64)
        return Labels(values, taken, FrozenDict(learnt._asdict()), converged)

    def _e_step(
        self, theta: Theta, beta: float, z: Array, older: Array, spare: Array
    ) -> tuple[Array, Array, Array]:
        """E-step: the new field, the present one, and an array to write the next one in."""
        constants = np.array(
            [
                beta,
                theta.mu_in,
                0.5 / theta.sigma_in**2,
                theta.mu_out,
                0.5 / theta.sigma_out**2,
                np.log(theta.sigma_out / theta.sigma_in),
            ]
        )
        self._pass(self._y, self._observed, z, older, spare, constants, self._sums)
        return spare, z, older

    def _m_step(self, sums: Array, before: Theta) -> Theta:
        """M-step from the sums of the E-step's pass, which are about the means before."""
        c = self._columns
        theta: list[float] = []
        for weight, first, second, mu, sigma in (
            (c.IN_WEIGHT, c.IN_FIRST, c.IN_SECOND, before.mu_in, before.sigma_in),
            (c.OUT_WEIGHT, c.OUT_FIRST, c.OUT_SECOND, before.mu_out, before.sigma_out),
        ):
            total = float(sums[weight])
            if total > 0.0:
                shift = float(sums[first]) / total
                variance = float(sums[second]) / total - shift**2
                theta += [mu + shift, float(np.sqrt(max(variance, 0.0)))]
            else:
                theta += [mu, sigma]
        return Theta(*theta)


def floored(theta: Theta, floor: float) -> Theta:
    """Keep both standard deviations at ``floor`` metres or above."""
    return theta._replace(
        sigma_in=max(theta.sigma_in, floor), sigma_out=max(theta.sigma_out, floor)
    )
