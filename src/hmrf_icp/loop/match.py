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

Array = NDArray[np.float64]


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


def checked_rows(index: NDArray[np.integer], points: int, onto: int) -> NDArray[np.intp]:
    """Return rows of matches that compiled loops may follow.

    Parameters
    ----------
    index
        One row a source point.
    points, onto
        Points of the source and of the target.

    Raises
    ------
    InputError
        There are more rows or fewer than points, or one that the target does not have.
    """
    if index.shape != (points,) or index.dtype.kind not in "iu":
        raise InputError(
            f"matches: expected one row of the target for each of the {points} observed source "
            f"points, got {index.dtype} of shape {index.shape}"
        )
    if points and not (index.min() >= 0 and index.max() < onto):
        raise InputError(
            f"matches: expected rows of the target's {onto} observed points, 0 to {onto - 1}, "
            f"got {index.min()} to {index.max()}"
        )
    return np.ascontiguousarray(index, dtype=np.intp)


def checked(matches: Matches, points: int, onto: int) -> Matches:
    """Return matches that a matcher of any kind found, once they are known to be some.

    Raises
    ------
    InputError
        As :func:`checked_rows`, or the distances, or the log-odds, are not one number a point.
    """
    checked_rows(matches.index, points, onto)
    distance = matches.distance
    if distance.shape != (points,) or not (np.isfinite(distance) & (distance >= 0.0)).all():
        raise InputError(
            f"matches: expected {points} finite distances of 0 or more, metres; the matcher found "
            f"others (shape {distance.shape})"
        )
    evidence = matches.label_log_odds
    if evidence is not None and (evidence.shape != (points,) or np.isnan(evidence).any()):
        raise InputError(
            f"matches: expected label_log_odds of shape ({points},) without NaN, "
            f"got shape {evidence.shape}; 0 says nothing"
        )
    return matches


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

    Examples
    --------
    >>> import numpy as np
    >>> from hmrf_icp import NearestNeighbour, prepare
    >>> from hmrf_icp.loop.placed import Placed
    >>> points = np.random.default_rng(0).uniform(size=(500, 3))
    >>> match = NearestNeighbour().prepare(prepare(points), prepare(points))
    >>> match(Placed.at(np.eye(4), points[:3])).index
    array([0, 1, 2])
    """

    tolerance: float = 0.0

    def __post_init__(self) -> None:
        """Refuse a tolerance that is none."""
        if not 0.0 <= self.tolerance < math.inf:
            raise InputError(f"tolerance: expected a share of 0 or more, got {self.tolerance}")

    def prepare(self, source: PreparedCloud, target: PreparedCloud) -> Match:
        """Build the tree of the target's observed points."""
        if self.tolerance > 0.0:
            return KeptMatches(target, self.tolerance)
        tree = target.tree

        def match(source: Placed) -> Matches:
            distance, index = tree.query(source.points)
            return Matches(index, distance)

        return match


class KeptMatches:
    """Match points with almost the closest of a target, and keep what the next iteration may.

    A point that was at least b away from all of the target, and moves by m, is at least b - m
    away from it afterwards. Its match is kept for as long as that shows it to be within the
    tolerance, as neighbours are by Greenspan and Godin ("A nearest neighbor method for
    efficient ICP", 2001). Towards the end hardly a point has to look for another.

    Parameters
    ----------
    target
        The target.
    tolerance
        Above 0. Half of it is given to the search tree, the other half to motion.
    """

    def __init__(self, target: PreparedCloud, tolerance: float) -> None:
        self._tree, self._onto = target.tree, target.points
        self._tolerance = tolerance
        self._before: Array | None = None
        self._bound: Array = np.empty(0)
        self._row: NDArray[np.intp] = np.empty(0, np.intp)

    def __call__(self, source: Placed) -> Matches:
        """Match the source where it is now."""
        from hmrf_icp.kernels.compiled import read_only
        from hmrf_icp.kernels.kept import keep

        points = np.ascontiguousarray(source.points)
        if self._before is None or self._before.shape != points.shape:
            distance, self._row, self._bound = self._asked(points)
        else:
            distance, row = np.empty(len(points)), self._row.copy()
            moved = keep(
                points,
                self._before,
                read_only(self._onto),
                row,
                self._bound,
                1.0 + self._tolerance,
                distance,
            )
            if len(moved):
                distance[moved], row[moved], self._bound[moved] = self._asked(points[moved])
            self._row = row
        self._before = points
        return Matches(self._row, distance)

    def _asked(self, points: Array) -> tuple[Array, NDArray[np.intp], Array]:
        """Distances, rows, and what no point of the target is closer than."""
        half = 0.5 * self._tolerance
        distance, row = self._tree.query(points, eps=half)
        return distance, row, distance / (1.0 + half)
