"""The random field in general: any cloud, any residuals, any beta, evidence of any other kind.

The paper's field (:mod:`hmrf_icp.field.paper`) is one choice of all of these: two
Gaussians, four pixel neighbours, beta = 2 throughout, no external field,
simultaneous updates, nine points in ten inliers at first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.errors import InputError
from hmrf_icp.field import mixture
from hmrf_icp.field.beta import LARGEST, BetaPrior, Schedule, most_likely
from hmrf_icp.field.graph import (
    NeighbourGraph,
    Neighbours,
    PixelGrid,
    Update,
    nearest_graph,
    ring_graph,
)
from hmrf_icp.field.residuals import Residual, residual
from hmrf_icp.frozen import FrozenDict
from hmrf_icp.loop.match import Matches
from hmrf_icp.loop.reject import Labels, Reject

Array = NDArray[np.float64]

CHOOSING = (0, 1, 4, 16, 64)
"""Iterations at which residual distributions are chosen; each takes a fraction of a second."""

PRIOR_SAMPLE = 5000
"""About so many points, evenly chosen, tell what there is to learn of the prior."""

OUTLIER_FLOOR = 10.0
"""Least scale of the outliers, in least scales of the inliers: with ``scale_floor`` as it is, the
target's spacing, within which a point without a counterpart is seldom of any."""

EVIDENT = 30
"""Points that the evidence must leave at least to be the first inliers."""


class Theta(NamedTuple):
    """What EM learns: the two distributions, and the prior of the labels."""

    inlier: Residual
    outlier: Residual
    prior: BetaPrior


@dataclass(frozen=True)
class MarkovField:
    """EM on a mixture of two residual distributions with a Markov random field prior.

    The log-odds of a point are log f_in(y) / f_out(y), plus the prior's, plus
    ``Matches.evidence`` where there is any, plus 2 beta sum w z over its
    neighbours. Scaling both clouds scales every length that is learnt, and
    changes no label.

    Parameters
    ----------
    residuals
        Distributions of the inliers' and of the outliers' distances, by name
        (:func:`hmrf_icp.field.residuals.names`) or instance; ``"auto"`` takes the pair with
        the best BIC, before the first motion and again at iterations 1, 4, 16...
    neighbours
        ``"grid"``, the pixels; ``"nearest"``, the nearest points; ``"ring"``, an organised
        spinning LiDAR, (beams, azimuths); a graph of the source's observed
        points; ``"auto"``, the grid where there is one and the nearest where not.
    beta
        Strength of the field: a number, a :class:`Schedule` over the ICP
        iterations, or ``"estimate"``, by maximum pseudo-likelihood at every EM step.
    update
        ``"simultaneous"`` (the paper) or ``"sequential"`` (Celeux, Forbes and Peyrard 2003).
    share
        BetaPrior share of inliers that the neighbours aside would leave: a number in
        (0, 1), 0.5 being the paper's none, or ``"learn"``.
    initial
        Share of the points that start as inliers: the nearest of those that no evidence
        speaks against.
    first_steps, steps
        Most EM steps before the first motion, and within each ICP iteration.
    scale_floor
        Least inlier scale, as a share of the target's point spacing: two
        samplings of one surface are seldom closer.
    share_floor
        Least prior share of either label.

    Raises
    ------
    InputError
        A parameter is out of its range, or a name is unknown.

    Examples
    --------
    >>> import numpy as np
    >>> import hmrf_icp
    >>> x, y = np.random.default_rng(0).uniform(-1.0, 1.0, (2, 2000))
    >>> hills = np.column_stack([x, y, 0.2 * np.sin(3.0 * x) * np.cos(4.0 * y)])
    >>> result = hmrf_icp.register(hills - 0.01, hills, rejector=hmrf_icp.MarkovField(beta=1.0))
    >>> bool(np.median(result.inlier_probability) > 0.5)
    True
    """

    residuals: tuple[str | Residual, str | Residual] | Literal["auto"] = ("half-normal", "uniform")
    neighbours: Literal["auto", "grid", "nearest", "ring"] | NeighbourGraph | PixelGrid = "auto"
    beta: float | Schedule | Literal["estimate"] = field(default_factory=Schedule)
    update: Update = "sequential"
    share: float | Literal["learn"] = "learn"
    initial: float = 0.5
    first_steps: int = 50
    steps: int = 20
    scale_floor: float = 0.1
    share_floor: float = 0.01

    def __post_init__(self) -> None:
        """Refuse what the model has no meaning for."""
        if self.residuals != "auto":
            if isinstance(self.residuals, str) or len(self.residuals) != 2:
                raise InputError(
                    'residuals: expected "auto" or a pair (inliers, outliers), '
                    f"got {self.residuals!r}"
                )
            for one in self.residuals:
                residual(one)
        if isinstance(self.neighbours, str) and self.neighbours not in _NEIGHBOURS:
            raise InputError(
                f"neighbours: expected a graph or one of {', '.join(_NEIGHBOURS)}, "
                f"got {self.neighbours!r}"
            )
        if isinstance(self.beta, str):
            if self.beta != "estimate":
                raise InputError(f'beta: expected a number or "estimate", got {self.beta!r}')
        elif not isinstance(self.beta, Schedule) and not 0.0 <= self.beta < math.inf:
            raise InputError(f"beta: expected a finite number of 0 or more, got {self.beta}")
        if self.update not in ("simultaneous", "sequential"):
            raise InputError(
                f'update: expected "simultaneous" or "sequential", got {self.update!r}'
            )
        if isinstance(self.share, str):
            if self.share != "learn":
                raise InputError(f'share: expected a number or "learn", got {self.share!r}')
        elif not 0.0 < self.share < 1.0:
            raise InputError(f"share: expected a number between 0 and 1, got {self.share}")
        if not 0.0 < self.initial <= 1.0:
            raise InputError(f"initial: expected a share in (0, 1], got {self.initial}")
        if self.first_steps < 0 or self.steps < 0:
            raise InputError(
                "first_steps, steps: expected numbers of EM steps of 0 or more, "
                f"got {self.first_steps}, {self.steps}"
            )
        if not 0.0 <= self.scale_floor < math.inf:
            raise InputError(f"scale_floor: expected a number of 0 or more, got {self.scale_floor}")
        if not 0.0 < self.share_floor < 0.5:
            raise InputError(f"share_floor: expected a share in (0, 0.5), got {self.share_floor}")

    def prepare(self, source: PreparedCloud, target: PreparedCloud) -> Reject:
        """Lay out the neighbours of the source, and measure the spacing of the target.

        Raises
        ------
        InputError
            The neighbours asked for are not the source's.
        """
        return _Em(
            self,
            neighbours_of(source, self.neighbours),
            self.scale_floor * target.neighbour_distance,
        )


_NEIGHBOURS = ("auto", "grid", "nearest", "ring")


def neighbours_of(
    source: PreparedCloud,
    kind: Literal["auto", "grid", "nearest", "ring"] | NeighbourGraph | PixelGrid = "auto",
) -> Neighbours:
    """Find the neighbours of a cloud's observed points.

    Raises
    ------
    InputError
        A grid is asked of a cloud without one, or a graph has another number of points.
    """
    if not isinstance(kind, str):
        if kind.size != len(source):
            raise InputError(
                f"neighbours: a graph of {kind.size} points for a source of {len(source)} observed"
            )
        return kind
    if kind == "nearest" or (kind == "auto" and not source.cloud.organised):
        return nearest_graph(source.points)
    if not source.cloud.organised:
        raise InputError(
            f"source: {kind!r} neighbours need a cloud organised as an image, (H, W, 3), "
            f'got {source.cloud!r}; neighbours="nearest" takes any'
        )
    return ring_graph(source.cloud.observed) if kind == "ring" else PixelGrid(source.cloud.observed)


def initial_labels(matches: Matches, share: float) -> Array:
    """Return z^(0): +1 for the nearest ``share`` of those the evidence does not speak against."""
    y = matches.distance
    open_to_it = np.ones(y.size, dtype=np.bool_)
    if matches.label_log_odds is not None:
        allowed = matches.label_log_odds >= 0
        if np.count_nonzero(allowed) >= EVIDENT:
            open_to_it = allowed
    near = y <= np.percentile(y[open_to_it], 100.0 * share)
    return np.where(near & open_to_it, 1.0, -1.0)


class _Em:
    """EM for one pair of clouds.

    What a decision hands to the next is in its labels, but for the kinds of the
    distributions where those are chosen: no number says what they are.
    """

    def __init__(self, model: MarkovField, neighbours: Neighbours, smallest: float) -> None:
        self._model = model
        self._neighbours = neighbours
        self._smallest = smallest
        self._chosen: tuple[Residual, Residual] | None = None

    def __call__(self, matches: Matches, before: Labels | None) -> Labels:
        """Label."""
        model, y = self._model, matches.distance
        if before is None:
            iteration, steps = 0, model.first_steps
            z = initial_labels(matches, model.initial)
        else:
            iteration, steps = int(before.parameters.get("iteration", 0.0)) + 1, model.steps
            z = before.z
        evidence = np.zeros_like(y) if matches.label_log_odds is None else matches.label_log_odds
        if np.isnan(evidence).any():
            raise InputError("label_log_odds: expected log-odds without NaN; 0 says nothing")

        inlier, outlier = self._kinds(y, iteration)
        # A component without weight keeps what it was; at first that is a fit to everything.
        theta = Theta(inlier, outlier, self._first_prior(iteration))
        theta = self._fitted(theta, y, np.ones_like(y), np.ones_like(y))
        older = z
        taken, converged = 0, False
        while taken < steps and not converged:
            taken += 1
            theta = self.m_step(theta, y, z)
            oldest, older = older, z
            z = self.e_step(theta, y, older, evidence)
            sign = z > 0
            converged = np.array_equal(sign, older > 0) or np.array_equal(sign, oldest > 0)
        return Labels(z, taken, self._report(theta, iteration), converged or steps == 0)

    def m_step(self, theta: Theta, y: Array, z: Array) -> Theta:
        """M-step: fit both distributions to the distances (M,), weighed by the labels (M,)."""
        fitted = self._fitted(theta, y, 0.5 * (1.0 + z), 0.5 * (1.0 - z))
        return fitted._replace(prior=self._prior(theta.prior, z))

    def e_step(self, theta: Theta, y: Array, z: Array, evidence: Array) -> Array:
        """E-step: expected labels (M,) from the distances, the evidence and the neighbours'."""
        likelihood = theta.inlier.log_density(y) - theta.outlier.log_density(y)
        log_odds = likelihood + theta.prior.log_odds + evidence
        beta = np.array([theta.prior.beta])
        labels, _ = self._neighbours.steps(log_odds, z, beta, self._model.update, -1.0)
        return labels

    def _fitted(self, theta: Theta, y: Array, inside: Array, outside: Array) -> Theta:
        """Fit each distribution with its weights (M,).

        Where every distance is far below the floor, as of a cloud on itself, both
        distributions would end at one floor and say nothing, or the opposite.
        """
        return theta._replace(
            inlier=theta.inlier.fit(y, inside, self._smallest),
            outlier=theta.outlier.fit(y, outside, OUTLIER_FLOOR * self._smallest),
        )

    def _kinds(self, y: Array, iteration: int) -> tuple[Residual, Residual]:
        """Kinds of the distributions; where they are chosen, at iterations 0, 1, 4, 16..."""
        if self._model.residuals != "auto":
            first, second = self._model.residuals
            return residual(first), residual(second)
        if self._chosen is None or iteration in CHOOSING:
            best = mixture.choose(y, initial=self._model.initial, smallest=self._smallest)
            self._chosen = best.inlier, best.outlier
        return self._chosen

    def _first_prior(self, iteration: int) -> BetaPrior:
        """Give the prior that does not depend on labels yet."""
        beta, share = self._model.beta, self._model.share
        if isinstance(beta, Schedule):
            beta = beta.at(iteration)
        return BetaPrior(
            0.0 if isinstance(beta, str) else float(beta),
            0.0 if isinstance(share, str) else math.log(share / (1.0 - share)),
        )

    def _prior(self, prior: BetaPrior, z: Array) -> BetaPrior:
        """M-step of the prior: what is to be learnt of it, by maximum pseudo-likelihood."""
        learn_beta, learn_share = self._model.beta == "estimate", self._model.share == "learn"
        if not (learn_beta or learn_share):
            return prior
        some = slice(None, None, max(1, z.size // PRIOR_SAMPLE))
        return most_likely(
            z[some],
            self._neighbours.sums(z)[some],
            prior,
            learn_beta=learn_beta,
            learn_share=learn_share,
            largest=LARGEST,
            share_floor=self._model.share_floor,
        )

    @staticmethod
    def _report(theta: Theta, iteration: int) -> FrozenDict:
        """Say what was learnt: lengths in metres; beta, share and shapes without a unit."""
        learnt = {f"inlier_{k}": v for k, v in theta.inlier.parameters.items()}
        learnt |= {f"outlier_{k}": v for k, v in theta.outlier.parameters.items()}
        learnt["beta"] = theta.prior.beta
        learnt["share"] = 1.0 / (1.0 + math.exp(-theta.prior.log_odds))
        learnt["iteration"] = float(iteration)
        return FrozenDict(learnt)
