"""The default: many candidates on few points, the likeliest refined by the field, and judged.

Algorithm 1 finds the nearest optimum, and knows no better. Here it has the last
word only: a lattice of turns of the start is registered quickly on a coarse
level, and the start itself on a finer one from several scales down; each end is
held against what both sensors saw, and the few likeliest, by that and by how near
they are to the start, go through match, reject and align with everything that is known.
Where what comes out is not to be believed, the same is done from shifted starts as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3
from hmrf_icp.align import Aligner
from hmrf_icp.cloud import PointCloud
from hmrf_icp.confidence import confidence, log_odds
from hmrf_icp.criteria import StoppingRule
from hmrf_icp.degeneracy import NOISE_ALONE
from hmrf_icp.evidence import Judge, Verdict
from hmrf_icp.icp import Iteration, Loop, Method, Outcome
from hmrf_icp.prior import StartPrior
from hmrf_icp.reject import Rejector
from hmrf_icp.resolution import reduced, standing
from hmrf_icp.starts import Annealer, Level, distinct, near, shifted, turned
from hmrf_icp.surface import Surface, surface_of

Array = NDArray[np.float64]

ASKED_EARLY, ASKED_LATE = 1000, 4000
"""Points of each cloud that are held against the other's view: of many poses, and of the last."""

COARSE = Level(600, 2500, 40, 8, (0.15, 0.08, 0.04, 0.02), 4)
CLOSE = Level(1500, 6000, 56, 3, (0.15, 0.08, 0.04, 0.03, 0.02, 0.015), 8)

FEWER = 4
"""The finalists are compared on this many times fewer source points than the winner has."""

CONVINCED = 0.5
"""Confidence from which no further starts are tried: more likely right than not."""

HOPELESS = 4.0
"""A candidate whose log-odds are as much worse than the best so far is not tried."""

SLACK = 1.0
"""Log-odds that a pose may lose by going back to the start along a free direction.

That it agrees with a little more somewhere else along a wall is no evidence.
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
    turn, apart
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
    """

    method: Method
    turn: float = math.radians(40.0)
    apart: float = math.radians(20.0)
    shift: float = 0.3
    coarse: Level = COARSE
    close: Level = CLOSE
    finalists: int = 6
    points: int = 20_000

    def run(
        self,
        source: PointCloud,
        target: PointCloud,
        init: Array,
        on_iteration: Callable[[Iteration], None] | None = None,
    ) -> Outcome:
        """Register; see :func:`hmrf_icp.register`."""
        search = Search(self, source, target, init, on_iteration)
        end = search.among(search.turns)
        if end.confidence < CONVINCED:
            end = search.among(search.shifts)
        outcome = spread(end.outcome, standing(source, self.points))
        return replace(outcome, verdict=end.verdict, confidence=end.confidence)

    def with_parts(
        self,
        reject: Rejector | None = None,
        align: Aligner | None = None,
        criteria: StoppingRule | None = None,
    ) -> CoarseToFine:
        """Return the same with some of the parts of Algorithm 1 replaced."""
        return replace(self, method=self.method.with_parts(reject, align, criteria))


class Search:
    """The search for one pair of clouds from one start: what it needs, and what it has found."""

    def __init__(
        self,
        plan: CoarseToFine,
        source: PointCloud,
        target: PointCloud,
        init: Array,
        on_iteration: Callable[[Iteration], None] | None,
    ) -> None:
        self._plan = plan
        self._source, self._target = (reduced(cloud, plan.points) for cloud in (source, target))
        few = reduced(self._source, plan.points // FEWER)
        self._rough = Loop(few, self._target, plan.method)
        self._fine = Loop(self._source, self._target, plan.method)
        self._asked_early = Judge(self._source, self._target, ASKED_EARLY)
        self._asked_late = Judge(self._source, self._target, ASKED_LATE)
        self._coarse, self._close = (
            Annealer(self._source, self._target, level) for level in (plan.coarse, plan.close)
        )
        self._on_iteration = on_iteration

        size = surface_of(self._target).size
        middle = se3.transform(init, centre(surface_of(self._source)))
        self._prior = StartPrior(init, middle, size)
        self.turns = turned(init, middle, plan.turn, plan.apart)
        self.shifts = shifted(self.turns, plan.shift * size)

        self._candidates: list[Candidate] = []
        self._ends: list[Judged] = []
        self._best: Judged | None = None

    def among(self, starts: Array) -> Judged:
        """Return the likeliest end of all starts so far, these (K, 4, 4) and the given one."""
        candidates = self._worth_trying(starts)
        self._candidates += candidates
        self._ends += self._tried(candidates)
        return self._refined()

    def _worth_trying(self, starts: Array) -> list[Candidate]:
        """Poses that starts lead to, but to none that was tried; at first the given start too."""
        prior, poses = self._prior, self._coarse(starts)
        first = not self._candidates
        if first:
            poses = np.concatenate([self._close.from_each_scale(prior.start), poses])
        worth = np.array([self._likelihood(pose) for pose in poses])
        before = [candidate.pose for candidate in self._candidates]
        rows = distinct(poses, worth, before, SAME_ANGLE, SAME_SHIFT * prior.size)
        found = [Candidate(poses[i], worth[i]) for i in islice(rows, self._plan.finalists)]
        # The start as it is has a place beside them, whatever a coarse level makes of it.
        return [Candidate(prior.start, self._likelihood(prior.start)), *found] if first else found

    def _likelihood(self, pose: Array) -> float:
        return log_odds(self._asked_early(pose)) + self._prior(pose)

    def _tried(self, candidates: Sequence[Candidate]) -> list[Judged]:
        """Run Algorithm 1 from the candidates on few points.

        The likeliest goes first, and the hopeless are left out once it is known how it fares.
        """
        ends: list[Judged] = []
        best = -math.inf if self._best is None else self._best.likelihood
        for pose, likelihood in sorted(candidates, key=lambda one: -one.likelihood):
            if likelihood < best - HOPELESS:
                break
            end = self._judged(self._rough(pose, self._on_iteration, SHORT))
            best = max(best, end.likelihood)
            if not any(self._same(end, other) for other in (*self._ends, *ends)):
                ends.append(end)
        return ends

    def _same(self, one: Judged, other: Judged) -> bool:
        poses = one.outcome.transformation, other.outcome.transformation
        return near(*poses, SAME_ANGLE, SAME_SHIFT * self._prior.size)

    def _refined(self) -> Judged:
        """Run the likeliest to the end; the next too while it is likelier than what came out."""
        while self._ends:
            end = likeliest(self._ends)
            if self._best is not None and end.likelihood <= self._best.likelihood:
                break
            self._ends.remove(end)
            refined = self._unmoved(self._continued(end, end.outcome.transformation))
            self._best = refined if self._best is None else likeliest([self._best, refined])
        assert self._best is not None
        return self._best

    def _unmoved(self, end: Judged) -> Judged:
        """Take back what the search did along directions of which nothing is known."""
        last = end.outcome.last
        if last is None or last.degenerate is None or last.weakest is None:
            return end
        if last.weakest >= NOISE_ALONE:
            return end
        pose = self._prior.nearest(end.outcome.transformation, last.degenerate)
        back = self._continued(end, pose)
        return back if back.likelihood >= end.likelihood - SLACK else end

    def _continued(self, end: Judged, pose: Array) -> Judged:
        """Run Algorithm 1 to the end from a pose that an earlier end led to."""
        return self._judged(after(end.outcome, self._fine(pose, self._on_iteration)))

    def _judged(self, outcome: Outcome) -> Judged:
        pose = outcome.transformation
        return Judged(outcome, self._asked_late(pose), self._prior(pose))


class Candidate(NamedTuple):
    """A pose (4, 4) that may be worth trying, and its log-odds as far as they can be told."""

    pose: Array
    likelihood: float


class Judged(NamedTuple):
    """Where a loop ended, what both sensors say of it, and what the start said before."""

    outcome: Outcome
    verdict: Verdict
    prior: float

    @property
    def confidence(self) -> float:
        """What the verdict is worth, whatever the start was."""
        return confidence(self.verdict, self.outcome.weakest)

    @property
    def likelihood(self) -> float:
        """Log-odds of the pose, with all that is known."""
        return log_odds(self.verdict, self.outcome.weakest) + self.prior


def likeliest(ends: Sequence[Judged]) -> Judged:
    """Choose the one for which evidence and start together speak most."""
    return max(ends, key=lambda end: end.likelihood)


def after(before: Outcome, outcome: Outcome) -> Outcome:
    """Give an outcome the history of the loop that its start came from."""
    shift = len(before.history)
    continued = (replace(one, iteration=one.iteration + shift) for one in outcome.history)
    return replace(
        outcome,
        em_iterations=before.em_iterations + outcome.em_iterations,
        history=(*before.history, *continued),
    )


def centre(surface: Surface) -> Array:
    """Centre (3,) of a surface, each point by its area."""
    return np.asarray(surface.area @ surface.points / surface.area.sum())


def spread(outcome: Outcome, rows: NDArray[np.intp]) -> Outcome:
    """Give every source point the label and the match of the one that stands for it."""
    labels = replace(outcome.labels, z=outcome.labels.z[rows])
    matches = replace(
        outcome.matches,
        index=outcome.matches.index[rows],
        distance=outcome.matches.distance[rows],
        evidence=None,
    )
    return replace(outcome, labels=labels, matches=matches)
