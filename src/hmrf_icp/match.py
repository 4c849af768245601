"""Match: the closest target point of every source point (paper, step 1 of the iteration)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.cloud import PointCloud


@dataclass(frozen=True, eq=False)
class Matches:
    """Who is closest, one entry an observed source point.

    Attributes
    ----------
    index
        (M,) I_i, row of the closest point in the target's observed points.
    distance
        (M,) Y_i, the distance to it, metres.
    evidence
        (M,) what is known of each label beside its distance, as the log-odds of
        having a counterpart, or None: the field adds it to the likelihood.
    """

    index: NDArray[np.intp]
    distance: NDArray[np.float64]
    evidence: NDArray[np.float64] | None = None


class Match(Protocol):
    """Find the matches of source points that have been moved to (M, 3), metres."""

    def __call__(self, moved: NDArray[np.float64]) -> Matches:
        """Match."""


class Matcher(Protocol):
    """Prepare a :class:`Match` for one target; what can be built once is built here."""

    def prepare(self, source: PointCloud, target: PointCloud) -> Match:
        """Build the search structure."""


@dataclass(frozen=True)
class NearestNeighbour:
    """Exact nearest neighbours from a k-d tree on the target (Algorithm 1, BuildKdTree)."""

    def prepare(self, source: PointCloud, target: PointCloud) -> Match:
        """Build the tree of the target's observed points."""
        from pykdtree.kdtree import KDTree

        tree = KDTree(target.observed_points)

        def match(moved: NDArray[np.float64]) -> Matches:
            distance, index = tree.query(np.ascontiguousarray(moved))
            return Matches(index.astype(np.intp), distance)

        return match
