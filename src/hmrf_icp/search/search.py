"""The search for one pair of clouds: candidates, the few likeliest of them registered and judged.

Poses to start from are registered quickly on a coarse level, and the start itself on a finer
one from several scales down. Each end is held against what both sensors saw, and the few
likeliest, by that and by how near they are to the start, go through match, reject and
align with everything that is known.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import islice
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3, threads
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.lazy import cached_property
from hmrf_icp.loop.degeneracy import NOISE_ALONE
from hmrf_icp.loop.icp import Iteration, Loop, LoopResult, Method
from hmrf_icp.loop.polish import polish
from hmrf_icp.loop.surface_metrics import SurfaceMetric
from hmrf_icp.search.candidates import Annealer, Level, distinct, near, shifted, turned
from hmrf_icp.search.confidence import confidence, log_odds
from hmrf_icp.search.everywhere import everywhere
from hmrf_icp.search.start_prior import FALL, FALL_ANYWHERE, StartPrior
from hmrf_icp.search.visibility import Visibility, VisibilityTest

Array = NDArray[np.float64]

TESTED_FIRST, TESTED_EARLY, TESTED_LATE = 250, 1000, 4000
"""Points of each cloud that are held against the other's view: of all poses, of those that may
become candidates, and of the last.
"""

HOPELESS = 0.01
"""Confidence of the best end so far below which nobody refines it before others were tried."""

FROM_START = 3
"""Candidates that are taken of where the start leads from its scales."""

HELD_LONGER = 4
"""Poses that are held against more points, for each candidate that is taken of them."""

FEWER = 4
"""The finalists are compared on this many times fewer source points than the winner has."""

PRUNE_MARGIN = 4.0
"""A candidate whose log posterior odds are this far below the best so far is not tried."""

RETURN_MARGIN = 1.0
"""Log-odds that a pose may lose by going back to the start along a free direction, and by going
through Algorithm 1: that it agrees with a few points more somewhere else is no evidence.
"""

LAST_MARGIN = 0.1
"""Log-odds that the last steps may cost. Where the noise is as it is taken to be they cost 0.02 at
the most; maps that a lens bends lose 0.2 to 2 where a part of them pulls the pose to itself.
"""

SAME_ANGLE, SAME_SHIFT = 0.03, 0.02
"""Radians and share of the target's size within which two poses lead to the same place."""

SHORT = 8
"""Iterations for a finalist: the right one needs no more, and the others lead nowhere."""


class Plan(Protocol):
    """What a search is asked to do; see :class:`hmrf_icp.search.coarse_to_fine.CoarseToFine`."""

    @property
    def method(self) -> Method:
        """Algorithm 1."""

    @property
    def turn(self) -> float:
        """Largest turn of the start, radians."""

    @property
    def turn_step(self) -> float:
        """Edge of the lattice of turns, radians."""

    @property
    def shift(self) -> float:
        """Shift of the start, a share of the target's size."""

    @property
    def coarse(self) -> Level:
        """How starts are registered."""

    @property
    def close(self) -> Level:
        """How the given start is."""

    @property
    def finalists(self) -> int:
        """Candidates that go on."""

    @property
    def points(self) -> int:
        """Points of each cloud at the most."""


class Search:
    """The search for one pair of clouds from one start: what it needs, and what it has found."""

    def __init__(
        self,
        plan: Plan,
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
        self._test_first, self._test_early, self._test_late = (
            VisibilityTest(self._source, self._target, count)
            for count in (TESTED_FIRST, TESTED_EARLY, TESTED_LATE)
        )
        self._close = Annealer(self._source, self._target, plan.close)
        self._on_iteration = on_iteration

        size = self._target.surface.size
        middle = se3.transform(init, self._source.surface.centre)
        fall = FALL if near else FALL_ANYWHERE
        self._prior = StartPrior(init, middle, size, fall)
        self._turns = turned(init, middle, plan.turn, plan.turn_step)

        self._candidates: list[Candidate] = []
        self._ends: list[Judged] = []
        self._best: Judged | None = None

    @cached_property
    def _coarse(self) -> Annealer:
        """Prepared when the first start is turned: most searches end before."""
        return Annealer(self._source, self._target, self._plan.coarse)

    def farther(self) -> Iterator[Starts]:
        """More starts, one kind after the other, for as long as somebody asks for them."""
        most = self._plan.finalists
        # Turns of nothing in particular are worth trying where trying is cheap.
        if self._near or self._test_late.views:
            yield Starts(self._turns, 0, most, False)
        if self._near:
            yield Starts(shifted(self._turns, self._plan.shift * self._prior.size), 0, most, False)
            return
        for poses in everywhere(self._source, self._target):
            if len(poses):
                yield Starts(poses, 1, 2 * most, True)

    def from_start(self) -> Judged:
        """Return the likeliest end of the start as it is, and of where it leads."""
        start = self._prior.start
        # The start has a place beside them, whatever the annealing makes of it.
        candidates = [Candidate(start, self._log_posterior(start, self._test_early))]
        poses = self._close.from_each_scale(start)
        log_posterior = self._log_posteriors(poses, len(poses), 0)
        rows = self._new(poses, log_posterior, FROM_START, [])
        return self._gone_on(
            [*candidates, *(Candidate(poses[row], log_posterior[row]) for row in rows)]
        )

    def among(self, starts: Starts) -> Judged:
        """Return the likeliest end of all starts so far and these."""
        poses = self._coarse(starts.poses, starts.scale)
        # Hypotheses come with an order of their own, which sees what the test does not.
        by_order = starts.most // 3 if starts.ordered else 0
        log_posterior = self._log_posteriors(poses, HELD_LONGER * starts.most, by_order)
        rows = self._new(poses, log_posterior, starts.most - by_order, [])
        rows += self._new(poses, -np.arange(len(poses), dtype=np.float64), by_order, poses[rows])
        return self._gone_on([Candidate(poses[row], log_posterior[row]) for row in rows])

    def _new(self, poses: Array, score: Array, most: int, beside: Iterable[Array]) -> list[int]:
        """Rows of the poses of the highest score (K,), but for those tried or ``beside``."""
        there = [*(candidate.pose for candidate in self._candidates), *beside]
        rows = distinct(poses, score, there, SAME_ANGLE, SAME_SHIFT * self._prior.size)
        return list(islice(rows, most))

    def _gone_on(self, candidates: Sequence[Candidate]) -> Judged:
        self._candidates += candidates
        self._ends += self._tried(candidates)
        likely = max((end.confidence for end in self._ends), default=1.0)
        if self._best is None and likely < HOPELESS:
            return likeliest(self._ends)
        return self._refined()

    def end(self) -> Judged:
        """Return the likeliest end of all starts."""
        return self._refined()

    def _log_posteriors(self, poses: Array, most: int, first: int) -> Array:
        """Log posterior odds (K,) of poses (K, 4, 4) on some points, the likeliest on more.

        Those are the ``most`` likeliest on few points, and the first ``first`` of them all.
        """

        def asked(rows: NDArray[np.intp], test: VisibilityTest) -> Array:
            def some(piece: NDArray[np.intp]) -> list[float]:
                return [self._log_posterior(poses[row], test) for row in piece]

            return np.array([x for piece in threads.current().over(some, rows, 8) for x in piece])

        every = np.arange(len(poses))
        if len(poses) <= most:
            return asked(every, self._test_early)
        log_posterior = asked(every, self._test_first)
        order = np.argsort(-log_posterior, kind="stable")
        rows = np.union1d(order[:most], every[:first])
        # What was not asked for longer is below all that was.
        log_posterior -= np.ptp(log_posterior) + 1e6
        log_posterior[rows] = asked(rows, self._test_early)
        return log_posterior

    def _log_posterior(self, pose: Array, test: VisibilityTest) -> float:
        return log_odds(test(pose)) + self._prior(pose)

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
        worse = polished.log_posterior < end.log_posterior - LAST_MARGIN
        return end if worse else polished

    def _judged(self, loop: LoopResult) -> Judged:
        pose = loop.transformation
        return Judged(loop, self._test_late(pose), self._prior(pose))


class Starts(NamedTuple):
    """Poses (K, 4, 4) to start from, and how.

    Attributes
    ----------
    poses
        Source to target.
    scale
        Number of the coarse level's scale from which they are registered down.
    most
        Candidates that are taken of them at the most.
    ordered
        Whether the likeliest come first.
    """

    poses: Array
    scale: int
    most: int
    ordered: bool


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
        if not self.loop.labels.inlier.any():
            return 0.0  # whatever views agree on, not a point lies on the other cloud
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
