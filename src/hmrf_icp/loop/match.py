"""Match: the closest target point of every source point (paper, step 1 of the iteration)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import kept
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.errors import InputError
from hmrf_icp.loop.placed import Placed

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
    """Nearest neighbours from a k-d tree on the target (Algorithm 1, BuildKdTree).

    Parameters
    ----------
    slack
        A match may be farther than the closest point by this share of its distance;
        0 is exact. A point far from everything has many target points at nearly the
        same distance, and telling which is the closest takes most of the time.
    """

    slack: float = 0.0

    def __post_init__(self) -> None:
        """Check the slack."""
        if not 0.0 <= self.slack < math.inf:
            raise InputError(f"slack: expected a share of 0 or more, got {self.slack}")

    def prepare(self, source: PointCloud, target: PointCloud) -> Match:
        """Build the tree of the target's observed points."""
        tree, slack = tree_of(target), self.slack

        def match(source: Placed) -> Matches:
            distance, index = tree.query(np.ascontiguousarray(source.points), eps=slack)
            return Matches(index.astype(np.intp), distance)

        return match


def tree_of(cloud: PointCloud) -> KDTree:
    """k-d tree of a cloud's observed points; built once a cloud."""

    def build() -> KDTree:
        from pykdtree.kdtree import KDTree

        return KDTree(cloud.observed_points)

    return kept.once(cloud, "tree", build)
