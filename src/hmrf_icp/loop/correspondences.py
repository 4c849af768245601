"""Who matches whom under the pose that was found: every source point, and exactly.

A search thins clouds out and is content with matches that are almost the closest.
What is told of the points afterwards is worked out again, at the pose returned, when
somebody asks.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.overlap import overlap
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.lazy import cached_property
from hmrf_icp.loop.match import Matches
from hmrf_icp.loop.placed import Placed
from hmrf_icp.loop.reject import Labels

Array = NDArray[np.float64]

Decide = Callable[[Matches], Labels]
"""The last decision about who is an inlier, for all source points where they ended."""


class Matched(NamedTuple):
    """One entry an observed source point.

    Attributes
    ----------
    row, onto
        Rows of the point and of its match in all points of its cloud, ``points.reshape(-1, 3)``.
    distance
        Between the two, metres.
    probability
        P(Z = +1).
    """

    row: NDArray[np.intp]
    onto: NDArray[np.intp]
    distance: Array
    probability: Array


class Correspondences:
    """Matches, labels and overlap of two clouds under one pose, each worked out at most once.

    It keeps both clouds until then. A copy, and what comes out of a pickle, holds the
    numbers and no cloud.

    Parameters
    ----------
    source, target
        The clouds.
    transformation
        (4, 4) the pose, source to target.
    decide
        Who is an inlier there.
    """

    def __init__(
        self, source: PreparedCloud, target: PreparedCloud, transformation: Array, decide: Decide
    ) -> None:
        self._source, self._target = source, target
        self._pose, self._decide = transformation, decide
        self.shape = source.cloud.shape

    @property
    def clouds(self) -> tuple[PreparedCloud, PreparedCloud] | None:
        """Source and target as they were registered; None of a copy or what was pickled."""
        held = self.__dict__
        return (held["_source"], held["_target"]) if "_source" in held else None

    @property
    def pose(self) -> Array | None:
        """(4, 4) the pose between these two; None likewise."""
        pose: Array | None = self.__dict__.get("_pose")
        return pose

    @cached_property
    def matched(self) -> Matched:
        """The closest target point of every source point, and the label of each."""
        placed = Placed.at(self._pose, self._source.points)
        matches = closest(placed, self._target)
        labels = self._decide(matches)
        row, onto = (np.flatnonzero(one.cloud.observed) for one in (self._source, self._target))
        return Matched(row, onto[matches.index], matches.distance, labels.probability)

    @cached_property
    def overlap(self) -> float:
        """Share of the source's surface that has a counterpart in the target's."""
        return overlap(self._source, self._target, self._pose)

    def on_grid(self, values: NDArray[Any]) -> NDArray[Any]:
        """Lay one value an observed point out in the source's shape, NaN elsewhere."""
        laid = np.full(self.shape, np.nan)
        laid.reshape(-1)[self.matched.row] = values
        return laid

    def __eq__(self, other: object) -> bool:
        from hmrf_icp.frozen import same

        return (
            isinstance(other, Correspondences)
            and self.overlap == other.overlap
            and same(self.matched, other.matched)
        )

    __hash__ = None  # type: ignore[assignment]

    def __getstate__(self) -> dict[str, Any]:
        return {"shape": self.shape, "matched": self.matched, "overlap": self.overlap}


def closest(source: Placed, target: PreparedCloud) -> Matches:
    """Match every source point with the target point that is closest, exactly."""
    distance, index = target.tree.query(np.ascontiguousarray(source.points))
    return Matches(index.astype(np.intp), distance)
