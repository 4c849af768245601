"""Match: the closest target point of every source point (paper, step 1 of the iteration)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import kept
from hmrf_icp.cloud import PointCloud
from hmrf_icp.placed import Placed

if TYPE_CHECKING:
    from pykdtree.kdtree import KDTree


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
    """Find the matches of the source where it is now."""

    def __call__(self, source: Placed) -> Matches:
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
        tree = tree_of(target)

        def match(source: Placed) -> Matches:
            distance, index = tree.query(np.ascontiguousarray(source.points))
            return Matches(index.astype(np.intp), distance)

        return match


def tree_of(cloud: PointCloud) -> KDTree:
    """k-d tree of a cloud's observed points; built once a cloud."""

    def build() -> KDTree:
        from pykdtree.kdtree import KDTree

        return KDTree(cloud.observed_points)

    return kept.once(cloud, "tree", build)
