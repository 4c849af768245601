"""The default: many candidates on few points, the likeliest refined by the field, and judged.

Algorithm 1 converges to a local optimum. Here it comes last. The start comes first; where
what it leads to does not convince, turns of it follow, then shifts of these if the pose is near
the start, and hypotheses from everywhere if nothing is known.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import threads
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.clouds.sensor_view import SensorView
from hmrf_icp.loop.align import Aligner
from hmrf_icp.loop.criteria import StoppingRule
from hmrf_icp.loop.icp import Iteration, LoopResult, Method
from hmrf_icp.loop.match import Matches
from hmrf_icp.loop.placed import Placed
from hmrf_icp.loop.reject import Labels, Rejector
from hmrf_icp.search.candidates import Level
from hmrf_icp.search.search import Judged, Search
from hmrf_icp.search.visibility import Visibility
from hmrf_icp.search.visible_match import VisibleMatch

Array = NDArray[np.float64]

COARSE = Level(600, 2500, 40, 8, (0.15, 0.08, 0.04, 0.02), 4)
CLOSE = Level(1500, 6000, 56, 3, (0.15, 0.08, 0.04, 0.03, 0.02, 0.015), 8)

CONVINCED_AT_ONCE = 0.9
"""Confidence of what the start itself leads to from which it is not even turned."""

CONVINCED, CONVINCED_NEAR_UNSEEN, CONVINCED_UNSEEN = 0.5, 0.9, 0.75
"""Confidence from which no further starts are tried: with free space, and without it, near a start
and everywhere.

Free space leaves a pose that is more likely right than not few rivals; without it something
similar a step away, such as an object half its size off, can be as likely. Hypotheses from
everywhere have it among them, turns of a start do not.
"""


@dataclass(frozen=True)
class CoarseToFine:
    """Candidates from a lattice of turns, judged by what the sensors saw, refined by the field.

    Every length is a share of the target's size, of its noise or of its spacing:
    a scene ten times as large is registered in the same way.

    Parameters
    ----------
    method
        Algorithm 1 that the last candidates go through.
    turn, turn_step
        How far the start is turned, and the edge of the lattice of turns, radians.
    shift
        How far it is shifted as well, each way along each axis, where turns alone do
        not convince: a share of the target's size.
    coarse
        How the turned and shifted starts are registered before that.
    close
        How the start itself is, from each of the scales down.
    finalists
        Candidates that go on to Algorithm 1, beside the start as it is.
    points
        Points of each cloud that Algorithm 1 sees at most; clouds of more are
        thinned out, and their labels filled in from the points that were kept.
    assume_viewpoints
        Whether a place to look from is looked for where no viewpoint is known.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from hmrf_icp import CoarseToFine, presets
    >>> fewer = replace(presets.preset("robust"), points=5000)
    >>> isinstance(fewer, CoarseToFine)
    True
    """

    method: Method
    turn: float = math.radians(40.0)
    turn_step: float = math.radians(20.0)
    shift: float = 0.3
    coarse: Level = COARSE
    close: Level = CLOSE
    finalists: int = 6
    points: int = 20_000
    assume_viewpoints: bool = True

    def run(
        self,
        source: PreparedCloud,
        target: PreparedCloud,
        init: Array,
        near: bool = True,
        on_iteration: Callable[[Iteration], None] | None = None,
    ) -> SearchResult:
        """Register; see :func:`hmrf_icp.register`."""
        source, target = threads.current().map(self.viewed, (source, target))
        one, other = threads.current().map(sided, (source, target))
        end: Judged | None = None
        if one is not None and other is not None and (one is not source or other is not target):
            end = self._searched(one, other, init, near, on_iteration)
            if end.confidence >= enough(end, near):
                return self._told(end, sided=True)
        # Sides of a cloud that is turned inside out contradict the right pose: do without.
        plain = self._searched(source, target, init, near, on_iteration)
        if end is not None and end.log_posterior > plain.log_posterior:
            return self._told(end, sided=True)
        return self._told(plain, sided=False)

    def _told(self, end: Judged, sided: bool) -> SearchResult:
        return SearchResult(end.loop, end.visibility, end.confidence, self, sided)

    def _searched(
        self,
        source: PreparedCloud,
        target: PreparedCloud,
        init: Array,
        near: bool,
        on_iteration: Callable[[Iteration], None] | None,
    ) -> Judged:
        threads.current().map(self._ready, (source, target))
        search = Search(self, source, target, init, near, on_iteration)
        end = search.from_start()
        if end.confidence < CONVINCED_AT_ONCE:
            for more in search.farther():
                if search.among(more).confidence >= enough(end, near):
                    break
        return search.polished(search.no_worse(search.end()))

    def _ready(self, viewed: PreparedCloud) -> None:
        """Work out what any search needs of a cloud, whatever the other is."""
        few = viewed.downsampled(self.points)
        if few.range_image is None:
            few.border  # noqa: B018
        few.tree  # noqa: B018

    def viewed(self, cloud: PreparedCloud) -> PreparedCloud:
        """Return a cloud from a place to look from, where places are assumed."""
        return cloud.viewed if self.assume_viewpoints else cloud

    def with_parts(
        self,
        reject: Rejector | None = None,
        align: Aligner | None = None,
        criteria: StoppingRule | None = None,
    ) -> CoarseToFine:
        """Return the same with some of the parts of Algorithm 1 replaced."""
        return replace(self, method=self.method.with_parts(reject, align, criteria))


def sided(cloud: PreparedCloud) -> PreparedCloud | None:
    """Return a cloud of which it is known which side was seen, by its normals at the last."""
    cloud = cloud.sided
    return cloud if cloud.seen_from.known or cloud.seen_from.sides else None


def enough(end: Judged, near: bool) -> float:
    """Confidence from which no further starts are tried."""
    if end.visibility.views:
        return CONVINCED
    return CONVINCED_NEAR_UNSEEN if near else CONVINCED_UNSEEN


@dataclass(frozen=True, eq=False)
class SearchResult:
    """What the search chose.

    Attributes
    ----------
    loop
        Where Algorithm 1 ended from the best candidate: of the points that it was given,
        which are those of the thinned source where ``plan.points`` are fewer.
    visibility
        What both sensors saw of that pose.
    confidence
        Probability in [0, 1] that it is right.
    plan
        The search.
    sided
        Whether it went by the sides that the clouds' normals tell.
    """

    loop: LoopResult
    visibility: Visibility
    confidence: float
    plan: CoarseToFine
    sided: bool = False

    def seen(self, cloud: PreparedCloud) -> PreparedCloud:
        """Return one of the clouds as the search saw it."""
        viewed = self.plan.viewed(cloud)
        return viewed.sided if self.sided else viewed

    def seen_from(self, cloud: PreparedCloud) -> SensorView:
        """Say where one of the clouds was seen from, and why its normals were not used."""
        view = self.seen(cloud).seen_from
        if view.known or view.sides:
            return view
        sides = self.plan.viewed(cloud).sides
        if sides is None:
            return view
        why = sides.text or "the other cloud has none that bear them out"
        return replace(view, text=f"{view.text}; normals not used: {why}")

    def labels(self, source: PreparedCloud, target: PreparedCloud, matches: Matches) -> Labels:
        """Decide once more where the search ended, for every source point.

        It starts from the label that the point standing for it has.

        Parameters
        ----------
        source, target
            The clouds, as they were given to the search.
        matches
            Of all source points under the pose.
        """
        source, target = self.seen(source), self.seen(target)
        method, rows = self.plan.method, source.representatives(self.plan.points)
        onto = matches.index if target.order is None else target.order[matches.index]
        matches = Matches(source.as_here(onto), source.as_here(matches.distance))
        if isinstance(method.match, VisibleMatch):
            placed = Placed.at(self.loop.transformation, source.points)
            evidence = method.match.evidence(source, target)(placed, matches)
            matches = replace(matches, label_log_odds=evidence)
        before = replace(self.loop.labels, z=self.loop.labels.z[source.as_here(rows)])
        labels = method.reject.prepare(source, target)(matches, before)
        return replace(labels, z=source.as_given(labels.z))
