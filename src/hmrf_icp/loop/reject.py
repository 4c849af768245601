"""Reject: the decision phi about who is an inlier, and the five rules the paper compares with.

Every rule looks at the distances Y alone. The paper's own, which also looks at
the neighbours in the image, is in :mod:`hmrf_icp.field.paper`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.clouds.tree import Tree
from hmrf_icp.frozen import FrozenDict
from hmrf_icp.loop.match import Matches

Array = NDArray[np.float64]

EQUAL = 1e-12
"""Share of the largest distance within which distances are equal: no bins fit between them."""


@dataclass(frozen=True, eq=False)
class Labels:
    """Who is an inlier, one entry an observed source point.

    Attributes
    ----------
    z
        (M,) expected label in [-1, 1]; the point is an inlier where z > 0.
    em_iterations
        EM steps that this decision took; 0 for a rule without a model.
    parameters
        What the decision learnt: means and deviations, or a threshold (metres).
    em_converged
        Whether EM settled before it ran out of steps; True of a rule without a model.
    """

    z: Array
    em_iterations: int = 0
    parameters: Mapping[str, float] = field(default_factory=lambda: FrozenDict({}))
    em_converged: bool = True

    def __post_init__(self) -> None:
        """Take any mapping of parameters, and keep one that pickles."""
        if not isinstance(self.parameters, FrozenDict):
            object.__setattr__(self, "parameters", FrozenDict(self.parameters))

    @property
    def inlier(self) -> NDArray[np.bool_]:
        """(M,) z > 0."""
        return np.asarray(self.z > 0)

    @property
    def probability(self) -> Array:
        """(M,) P(Z = +1) = (1 + z) / 2."""
        return np.asarray(0.5 * (1.0 + self.z))


class Reject(Protocol):
    """Label matches, given the labels of the iteration before (None before the first)."""

    def __call__(self, matches: Matches, before: Labels | None) -> Labels:
        """Label."""


class Rejector(Protocol):
    """Prepare a :class:`Reject` for one pair of clouds."""

    def prepare(self, source: PreparedCloud, target: PreparedCloud) -> Reject:
        """Build what depends on the clouds alone, such as who neighbours whom."""


def keep_below(distance: Array, threshold: float) -> Labels:
    """Label as inliers the points whose distance is at most ``threshold`` metres."""
    z = np.where(distance <= threshold, 1.0, -1.0)
    return Labels(z, parameters=FrozenDict({"threshold": float(threshold)}))


@dataclass(frozen=True)
class KeepAll:
    """No rejection: every point is an inlier (Besl and McKay 1992).

    Examples
    --------
    >>> import numpy as np
    >>> from hmrf_icp import KeepAll, register
    >>> points = np.random.default_rng(0).uniform(size=(500, 3))
    >>> register(points, points + 0.01, rejector=KeepAll()).fitness
    1.0
    """

    def prepare(self, source: PreparedCloud, target: PreparedCloud) -> Reject:
        """Nothing to prepare."""
        return lambda matches, before: Labels(np.ones_like(matches.distance))


@dataclass(frozen=True)
class KeepPercent:
    """Keep the closest points, 90 % of them (trimmed ICP, Chetverikov 2002).

    Examples
    --------
    >>> import numpy as np
    >>> from hmrf_icp import KeepPercent, register
    >>> points = np.random.default_rng(0).uniform(size=(500, 3))
    >>> register(points, points + 0.01, rejector=KeepPercent(80.0)).converged
    True
    """

    percent: float = 90.0

    def prepare(self, source: PreparedCloud, target: PreparedCloud) -> Reject:
        """Nothing to prepare."""
        return lambda matches, before: keep_below(
            matches.distance, float(np.percentile(matches.distance, self.percent))
        )


@dataclass(frozen=True)
class KeepSigma:
    """Keep what is below the mean plus 2.5 standard deviations (Masuda 1996).

    Examples
    --------
    >>> import numpy as np
    >>> from hmrf_icp import KeepSigma, register
    >>> points = np.random.default_rng(0).uniform(size=(500, 3))
    >>> register(points, points + 0.01, rejector=KeepSigma(2.0)).converged
    True
    """

    deviations: float = 2.5

    def prepare(self, source: PreparedCloud, target: PreparedCloud) -> Reject:
        """Nothing to prepare."""
        return lambda matches, before: keep_below(
            matches.distance,
            float(matches.distance.mean() + self.deviations * matches.distance.std()),
        )


@dataclass(frozen=True)
class X84:
    """Keep what is below the median plus 5.2 median absolute deviations (Fusiello 2002).

    Examples
    --------
    >>> import numpy as np
    >>> from hmrf_icp import X84, register
    >>> points = np.random.default_rng(0).uniform(size=(500, 3))
    >>> register(points, points + 0.01, rejector=X84(4.0)).converged
    True
    """

    deviations: float = 5.2

    def prepare(self, source: PreparedCloud, target: PreparedCloud) -> Reject:
        """Nothing to prepare."""

        def reject(matches: Matches, before: Labels | None) -> Labels:
            median = float(np.median(matches.distance))
            mad = float(np.median(np.abs(matches.distance - median)))
            return keep_below(matches.distance, median + self.deviations * mad)

        return reject


@dataclass(frozen=True)
class Dynamic:
    """A threshold that adapts to how good the registration is (Zhang 1994, section 3.2).

    The threshold starts at 20 D. After that, with the mean mu and deviation s
    of the distances that the last threshold kept: mu below D, mu + 3 s; below
    3 D, mu + 2 s; below 6 D, mu + s; otherwise the first valley of the
    histogram of distances after its highest peak.

    Parameters
    ----------
    scale
        D, metres: a distance that counts as a good registration. None takes
        the mean distance of the target's points to their nearest neighbour.

    Examples
    --------
    >>> import numpy as np
    >>> from hmrf_icp import Dynamic, register
    >>> points = np.random.default_rng(0).uniform(size=(500, 3))
    >>> register(points, points + 0.01, rejector=Dynamic(scale=0.02)).converged
    True
    """

    scale: float | None = None

    def prepare(self, source: PreparedCloud, target: PreparedCloud) -> Reject:
        """Measure D on the target where it is not given."""
        scale = self.scale if self.scale is not None else mean_neighbour_distance(target.points)

        def reject(matches: Matches, before: Labels | None) -> Labels:
            if before is None:
                return keep_below(matches.distance, 20.0 * scale)
            kept = matches.distance[matches.distance <= before.parameters["threshold"]]
            if kept.size == 0:
                kept = matches.distance
            return keep_below(matches.distance, self.threshold(kept, matches.distance, scale))

        return reject

    @staticmethod
    def threshold(kept: Array, distance: Array, scale: float) -> float:
        """Next threshold, metres, from the distances kept by the one before."""
        mean, deviation = float(kept.mean()), float(kept.std())
        if mean < scale:
            return mean + 3.0 * deviation
        if mean < 3.0 * scale:
            return mean + 2.0 * deviation
        if mean < 6.0 * scale:
            return mean + deviation
        return first_valley(distance)


def first_valley(distance: Array) -> float:
    """Position of the first local minimum after the highest peak of a histogram, metres.

    The bins are as many as Sturges' rule asks for, at least ten. With no
    valley after the peak the threshold is the largest distance, and so it is where
    all are equal but for rounding.
    """
    largest = float(distance.max())
    if largest - float(distance.min()) <= EQUAL * largest:
        return largest
    bins = max(10, int(np.ceil(np.log2(distance.size))) + 1)
    count, edge = np.histogram(distance, bins=bins)
    for i in range(int(np.argmax(count)) + 1, bins - 1):
        if count[i] <= count[i - 1] and count[i] < count[i + 1]:
            return float(0.5 * (edge[i] + edge[i + 1]))
    return float(edge[-1])


def mean_neighbour_distance(points: Array) -> float:
    """Mean distance of points (N, 3) to their nearest other point, metres."""
    distance, _ = Tree(points).query(points, k=2)
    return float(distance[:, 1].mean())
