"""The default: many candidates on few points, the likeliest refined by the field, and judged.

Algorithm 1 converges to a local optimum. Here it comes last: a lattice of turns of the
start is registered quickly on a coarse level, and the start itself on a finer one from
several scales down; each end is held against what both sensors saw, and the few
likeliest, by that and by how near they are to the start, go through match, reject and
align with everything that is known.
Where what comes out is not to be believed, the same is done from shifted starts as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.clouds.surface import Surface
from hmrf_icp.loop.align import Aligner
from hmrf_icp.loop.criteria import StoppingRule
from hmrf_icp.loop.degeneracy import NOISE_ALONE
from hmrf_icp.loop.icp import Iteration, Loop, LoopResult, Method
from hmrf_icp.loop.match import Matches
from hmrf_icp.loop.placed import Placed
from hmrf_icp.loop.polish import polish
from hmrf_icp.loop.reject import Labels, Rejector
from hmrf_icp.loop.surface_metrics import SurfaceMetric
from hmrf_icp.search.candidates import Annealer, Level, distinct, near, shifted, turned
from hmrf_icp.search.confidence import confidence, log_odds
from hmrf_icp.search.everywhere import everywhere
from hmrf_icp.search.start_prior import FALL, FALL_ANYWHERE, StartPrior
from hmrf_icp.search.visibility import Visibility, VisibilityTest
from hmrf_icp.search.visible_match import VisibleMatch

Array = NDArray[np.float64]

TESTED_EARLY, TESTED_LATE = 1000, 4000
"""Points of each cloud that are held against the other's view: of many poses, and of the last."""

COARSE = Level(600, 2500, 40, 8, (0.15, 0.08, 0.04, 0.02), 4)
CLOSE = Level(1500, 6000, 56, 3, (0.15, 0.08, 0.04, 0.03, 0.02, 0.015), 8)

FEWER = 4
"""The finalists are compared on this many times fewer source points than the winner has."""

CONVINCED = 0.5
"""Confidence from which no further starts are tried: more likely right than not."""

PRUNE_MARGIN = 4.0
"""A candidate whose log posterior odds are this far below the best so far is not tried."""

RETURN_MARGIN = 1.0
"""Log-odds that a pose may lose by going back to the start along a free direction, and by going
through Algorithm 1: that it agrees with a few points more somewhere else is no evidence.
"""

SAME_ANGLE, SAME_SHIFT = 0.03, 0.02
"""Radians and share of the target's size within which two poses lead to the same place."""

SHORT = 8
"""Iterations for a finalist: the right one needs no more, and the others lead nowhere."""


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
        source, target = self.viewed(source), self.viewed(target)
        search = Search(self, source, target, init, near, on_iteration)
        end = search.among(search.turns)
        for more in search.farther():
            if end.confidence >= CONVINCED:
                break
            end = search.among(*more)
        end = search.polished(search.no_worse(end))
        return SearchResult(end.loop, end.visibility, end.confidence, self)

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
    """

    loop: LoopResult
    visibility: Visibility
    confidence: float
    plan: CoarseToFine

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
        source, target = self.plan.viewed(source), self.plan.viewed(target)
        method, rows = self.plan.method, source.representatives(self.plan.points)
        if isinstance(method.match, VisibleMatch):
            placed = Placed.at(self.loop.transformation, source.points)
            evidence = method.match.evidence(source, target)(placed, matches)
            matches = replace(matches, label_log_odds=evidence)
        before = replace(self.loop.labels, z=self.loop.labels.z[rows])
        return method.reject.prepare(source, target)(matches, before)


class Search:
    """The search for one pair of clouds from one start: what it needs, and what it has found."""

    def __init__(
        self,
        plan: CoarseToFine,
        source: PreparedCloud,
        target: PreparedCloud,
        init: Array,
        near: bool,
        on_iteration: Callable[[Iteration], None] | None,
    ) -> None:
        self._plan, self._near = plan, near
        self._source, self._target = (cloud.downsampled(plan.points) for cloud in (source, target))
        few = self._source.downsampled(plan.points // FEWER)
        self._rough = Loop(few, self._target, plan.method)
        self._fine = Loop(self._source, self._target, plan.method)
        self._test_early = VisibilityTest(self._source, self._target, TESTED_EARLY)
        self._test_late = VisibilityTest(self._source, self._target, TESTED_LATE)
        self._coarse, self._close = (
            Annealer(self._source, self._target, level) for level in (plan.coarse, plan.close)
        )
        self._on_iteration = on_iteration

        size = self._target.surface.size
        middle = se3.transform(init, centre(self._source.surface))
        fall = FALL if near else FALL_ANYWHERE
        self._prior = StartPrior(init, middle, size, fall)
        self.turns = turned(init, middle, plan.turn, plan.turn_step)
        self.shifts = shifted(self.turns, plan.shift * size)

        self._candidates: list[Candidate] = []
        self._ends: list[Judged] = []
        self._best: Judged | None = None

    def farther(self) -> Iterator[tuple[Array, int, int]]:
        """More starts, from how fine a scale they go, and how many are tried at the most."""
        if self._near:
            yield self.shifts, 0, self._plan.finalists
            return
        for poses in everywhere(self._source, self._target):
            if len(poses):
                yield poses, 1, 2 * self._plan.finalists
        yield self.shifts, 0, self._plan.finalists

    def among(self, starts: Array, first: int = 0, most: int | None = None) -> Judged:
        """Return the likeliest end of all starts so far, these (K, 4, 4) and the given one."""
        candidates = self._new_candidates(starts, first, most or self._plan.finalists)
        self._candidates += candidates
        self._ends += self._tried(candidates)
        return self._refined()

    def _new_candidates(self, starts: Array, scale: int, most: int) -> list[Candidate]:
        """Poses that starts lead to, but to none that was tried; at first the given start too."""
        prior, poses = self._prior, self._coarse(starts, scale)
        first = not self._candidates
        if first:
            poses = np.concatenate([self._close.from_each_scale(prior.start), poses])
        log_posterior = np.array([self._log_posterior(pose) for pose in poses])
        before = [candidate.pose for candidate in self._candidates]
        rows = distinct(poses, log_posterior, before, SAME_ANGLE, SAME_SHIFT * prior.size)
        found = [Candidate(poses[i], log_posterior[i]) for i in islice(rows, most)]
        # The start as it is has a place beside them, whatever a coarse level makes of it.
        return (
            [Candidate(prior.start, self._log_posterior(prior.start)), *found] if first else found
        )

    def _log_posterior(self, pose: Array) -> float:
        return log_odds(self._test_early(pose)) + self._prior(pose)

    def _tried(self, candidates: Sequence[Candidate]) -> list[Judged]:
        """Run Algorithm 1 from the candidates on few points.

        The likeliest goes first; those below the prune margin of what it leads to are left out.
        """
        ends: list[Judged] = []
        best = -math.inf if self._best is None else self._best.log_posterior
        for pose, log_posterior in sorted(candidates, key=lambda one: -one.log_posterior):
            if log_posterior < best - PRUNE_MARGIN:
                break
            end = self._judged(self._rough(pose, self._on_iteration, SHORT))._replace(
                candidate=pose
            )
            best = max(best, end.log_posterior)
            if not any(self._same(end, other) for other in (*self._ends, *ends)):
                ends.append(end)
        return ends

    def _same(self, one: Judged, other: Judged) -> bool:
        poses = one.loop.transformation, other.loop.transformation
        return near(*poses, SAME_ANGLE, SAME_SHIFT * self._prior.size)

    def _refined(self) -> Judged:
        """Run the likeliest to the end; the next too while it is likelier than what came out."""
        while self._ends:
            end = likeliest(self._ends)
            if self._best is not None and end.log_posterior <= self._best.log_posterior:
                break
            self._ends.remove(end)
            refined = self._unmoved(self._continued(end, end.loop.transformation))
            self._best = refined if self._best is None else likeliest([self._best, refined])
        assert self._best is not None
        return self._best

    def _unmoved(self, end: Judged) -> Judged:
        """Take back what the search did along directions of which nothing is known."""
        last = end.loop.last
        if last is None or last.degenerate is None or last.weakest is None:
            return end
        if last.weakest >= NOISE_ALONE:
            return end
        pose = self._prior.nearest(end.loop.transformation, last.degenerate)
        back = self._continued(end, pose)
        return back if back.log_posterior >= end.log_posterior - RETURN_MARGIN else end

    def _continued(self, end: Judged, pose: Array) -> Judged:
        """Run Algorithm 1 to the end from a pose that an earlier end led to."""
        before = len(end.loop.history)
        fine = self._fine(pose, self._on_iteration, after=before)
        return self._judged(after(end.loop, fine))._replace(candidate=end.candidate)

    def no_worse(self, end: Judged) -> Judged:
        """Return the candidate that an end came from where that was likelier than the end is."""
        pose = end.candidate
        if pose is None:
            return end
        least = end.log_posterior + RETURN_MARGIN
        if log_odds(self._test_late(pose)) + self._prior(pose) <= least:
            return end  # Whatever the surfaces say of it, which can only be against it.
        there = self._judged(self._fine.at(pose))
        return there if there.log_posterior > least else end

    def polished(self, end: Judged) -> Judged:
        """Take the last steps, where the loop has arrived and the metric looks at surfaces."""
        metric = self._plan.method.align
        if not end.loop.converged or not isinstance(metric, SurfaceMetric):
            return end
        loop = polish(end.loop, self._source, self._target, metric, self._on_iteration)
        polished = self._judged(loop)
        worse = polished.log_posterior < end.log_posterior - RETURN_MARGIN
        return end if worse else polished

    def _judged(self, loop: LoopResult) -> Judged:
        pose = loop.transformation
        return Judged(loop, self._test_late(pose), self._prior(pose))


class Candidate(NamedTuple):
    """A pose (4, 4) that may be tried, and its log posterior odds on few points."""

    pose: Array
    log_posterior: float


class Judged(NamedTuple):
    """Where a loop ended, what both sensors say of it, and what the start said before.

    ``candidate`` (4, 4) is the pose that the first loop began at.
    """

    loop: LoopResult
    visibility: Visibility
    prior: float
    candidate: Array | None = None

    @property
    def confidence(self) -> float:
        """Probability that the pose is right without the prior of the start."""
        return confidence(self.visibility, self.loop.weakest)

    @property
    def log_posterior(self) -> float:
        """Log-odds of the pose, with all that is known."""
        return log_odds(self.visibility, self.loop.weakest) + self.prior


def likeliest(ends: Sequence[Judged]) -> Judged:
    """Choose the one for which evidence and start together speak most."""
    return max(ends, key=lambda end: end.log_posterior)


def after(before: LoopResult, loop: LoopResult) -> LoopResult:
    """Give a result the history of the loop that its start came from."""
    return replace(
        loop,
        em_iterations=before.em_iterations + loop.em_iterations,
        history=(*before.history, *loop.history),
    )


def centre(surface: Surface) -> Array:
    """Centre (3,) of a surface, each point by its area."""
    return np.asarray(surface.area @ surface.points / surface.area.sum())
