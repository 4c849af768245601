"""The default: many candidates on few points, the likeliest refined by the field, and judged.

Algorithm 1 finds the nearest optimum, and knows no better. Here it has the last
word only: a lattice of turns of the start is registered quickly on a coarse
level, each end is held against what both sensors saw, the best are registered
again on a finer level, and the few that free space contradicts least go through
match, reject and align with everything that is known.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3
from hmrf_icp.align import Aligner
from hmrf_icp.cloud import PointCloud
from hmrf_icp.confidence import confidence
from hmrf_icp.criteria import StoppingRule
from hmrf_icp.evidence import Judge
from hmrf_icp.icp import Iteration, Loop, Method, Outcome
from hmrf_icp.reject import Rejector
from hmrf_icp.resolution import Reduced, reduced
from hmrf_icp.starts import Annealer, Level, distinct, turned
from hmrf_icp.surface import Surface, surface_of

Array = NDArray[np.float64]

ASKED_EARLY, ASKED_LATE = 1000, 4000
"""Points of each cloud that are held against the other's view: of many poses, and of the last."""


COARSE = Level(600, 2500, 40, 8, (0.15, 0.08, 0.04, 0.02), 4)
MIDDLE = Level(1500, 6000, 56, 3, (0.04, 0.03, 0.02, 0.015), 4)

FEWER = 4
"""The finalists are compared on this many times fewer source points than the winner has."""

TIE = 0.005
"""Scores that differ by less are equal."""

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
    coarse, middle
        How the candidates are registered before that.
    kept, finalists
        Candidates that go on to the middle level, and to Algorithm 1.
    points
        Points of each cloud that Algorithm 1 sees at most; clouds of more are
        thinned out, and their labels filled in from the points that were kept.
    """

    method: Method
    turn: float = math.radians(40.0)
    apart: float = math.radians(20.0)
    coarse: Level = COARSE
    middle: Level = MIDDLE
    kept: int = 20
    finalists: int = 3
    points: int = 20_000

    def run(
        self,
        source: PointCloud,
        target: PointCloud,
        init: Array,
        on_iteration: Callable[[Iteration], None] | None = None,
    ) -> Outcome:
        """Register; see :func:`hmrf_icp.register`."""
        many, onto = reduced(source, self.points), reduced(target, self.points)
        few = reduced(many.cloud, self.points // FEWER)
        judge = Judge(many.cloud, onto.cloud, ASKED_LATE)

        loop = Loop(few.cloud, onto.cloud, self.method)
        rough = [
            loop(pose, on_iteration, SHORT)
            for pose in (init, *self.candidates(many.cloud, onto.cloud, init))
        ]
        worth = [judge(outcome.transformation).score for outcome in rough]
        # Between poses that are equally likely, the one that the start leads to: what no
        # evidence tells apart, such as two places along a bare wall, is not for us to choose.
        likeliest = rough[0 if worth[0] >= max(worth) - TIE else int(np.argmax(worth))]
        fine = Loop(many.cloud, onto.cloud, self.method)(likeliest.transformation, on_iteration)
        verdict = judge(fine.transformation)
        outcome = replace(
            fine,
            em_iterations=likeliest.em_iterations + fine.em_iterations,
            history=likeliest.history + fine.history,
            verdict=verdict,
            confidence=confidence(verdict),
        )
        return spread(outcome, many)

    def with_parts(
        self,
        reject: Rejector | None = None,
        align: Aligner | None = None,
        criteria: StoppingRule | None = None,
    ) -> CoarseToFine:
        """Return the same with some of the parts of Algorithm 1 replaced."""
        return replace(self, method=self.method.with_parts(reject, align, criteria))

    def candidates(self, source: PointCloud, target: PointCloud, init: Array) -> Array:
        """Poses (K, 4, 4) worth refining, the likeliest first."""
        judge = Judge(source, target, ASKED_EARLY)
        size = surface_of(target).size

        pivot = se3.transform(init, centre(surface_of(source)))
        starts = turned(init, pivot, self.turn, self.apart)
        poses = Annealer(source, target, self.coarse)(starts)
        worth = np.array([judge(pose).balance for pose in poses])
        poses = poses[distinct(poses, worth, self.kept, 0.05, 0.03 * size)]

        poses = Annealer(source, target, self.middle)(poses)
        worth = np.array([judge(pose).score for pose in poses])
        return np.asarray(poses[distinct(poses, worth, self.finalists, 0.01, 0.01 * size)])


def centre(surface: Surface) -> Array:
    """Centre (3,) of a surface, each point by its area."""
    return np.asarray(surface.area @ surface.points / surface.area.sum())


def spread(outcome: Outcome, few: Reduced) -> Outcome:
    """Give every source point the label and the match of the one that stood for it."""
    if few.standing is None:
        return outcome
    labels = replace(outcome.labels, z=outcome.labels.z[few.standing])
    matches = replace(
        outcome.matches,
        index=outcome.matches.index[few.standing],
        distance=outcome.matches.distance[few.standing],
        evidence=None,
    )
    return replace(outcome, labels=labels, matches=matches)
