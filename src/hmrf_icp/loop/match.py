"""Match: the closest target point of every source point (paper, step 1 of the iteration)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.errors import InputError
from hmrf_icp.loop.placed import Placed


@dataclass(frozen=True, eq=False)
class Matches:
    """Who is closest, one entry an observed source point.

    Attributes
    ----------
    index
        (M,) I_i, row of the closest point in the target's observed points.
    distance
        (M,) Y_i, the distance to it, metres.
    label_log_odds
        (M,) what is known of each label beside its distance, as the log-odds of
        having a counterpart, or None: the field adds it to the likelihood.
    """

    index: NDArray[np.intp]
    distance: NDArray[np.float64]
    label_log_odds: NDArray[np.float64] | None = None


class Match(Protocol):
    """Find the matches of the source where it is now."""

    def __call__(self, source: Placed) -> Matches:
        """Match."""


class Matcher(Protocol):
    """Prepare a :class:`Match` for one target; what can be built once is built here."""

    def prepare(self, source: PreparedCloud, target: PreparedCloud) -> Match:
        """Build the search structure."""


@dataclass(frozen=True)
class NearestNeighbour:
    """Nearest neighbours from a k-d tree on the target (Algorithm 1, BuildKdTree).

    Parameters
    ----------
    tolerance
        A match may be farther than the closest point by this share of its distance;
        0 is exact. A point far from everything has many target points at nearly the
        same distance, and telling which is the closest takes most of the time.
    """

    tolerance: float = 0.0

    def __post_init__(self) -> None:
        """Refuse a tolerance that is none."""
        if not 0.0 <= self.tolerance < math.inf:
            raise InputError(f"tolerance: expected a share of 0 or more, got {self.tolerance}")

    def prepare(self, source: PreparedCloud, target: PreparedCloud) -> Match:
        """Build the tree of the target's observed points."""
        tree, tolerance = target.tree, self.tolerance

        def match(source: Placed) -> Matches:
            distance, index = tree.query(np.ascontiguousarray(source.points), eps=tolerance)
            return Matches(index.astype(np.intp), distance)

        return match
