"""The loop of Algorithm 1: match, reject, align, until the motion is small."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.errors import InputError
from hmrf_icp.frozen import FrozenDict, same
from hmrf_icp.loop.align import Align, Aligner, Step
from hmrf_icp.loop.criteria import Criteria, StoppingRule, at_most
from hmrf_icp.loop.match import Match, Matcher, Matches, checked
from hmrf_icp.loop.placed import Placed
from hmrf_icp.loop.reject import Labels, Reject, Rejector
from hmrf_icp.stages import stage

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Method:
    """A registration method: its three parts and when it stops.

    Examples
    --------
    >>> from hmrf_icp import Method, NearestNeighbour, Symmetric, X84
    >>> Method(NearestNeighbour(), X84(), Symmetric()).reject
    X84(deviations=5.2)
    """

    match: Matcher
    reject: Rejector
    align: Aligner
    criteria: StoppingRule = field(default_factory=Criteria)

    def run(
        self,
        source: PreparedCloud,
        target: PreparedCloud,
        init: Array,
        near: bool = True,
        on_iteration: Callable[[Iteration], None] | None = None,
    ) -> LoopResult:
        """Run Algorithm 1 with these parts."""
        return icp(source, target, init, self, on_iteration)

    def with_parts(
        self,
        reject: Rejector | None = None,
        align: Aligner | None = None,
        criteria: StoppingRule | None = None,
    ) -> Method:
        """Return this method with some of its parts replaced."""
        return Method(
            self.match,
            self.reject if reject is None else reject,
            self.align if align is None else align,
            self.criteria if criteria is None else criteria,
        )


@dataclass(frozen=True, eq=False)
class Iteration:
    """What one ICP iteration did.

    Attributes
    ----------
    iteration
        Its number, from 1.
    em_iterations
        EM steps it took; the first has those before the first motion too.
    inlier_share
        Inliers among the observed source points.
    step_translation, step_rotation
        Size of its motion, metres and radians.
    inlier_rmse
        Root mean square distance of the inliers before its motion, metres.
    parameters
        What the rejection learnt: means and deviations or a threshold, metres.
    transformation
        (4, 4) source to target, after its motion; None where nobody told.

    Examples
    --------
    >>> import numpy as np
    >>> import hmrf_icp
    >>> points = np.random.default_rng(0).uniform(size=(500, 3))
    >>> result = hmrf_icp.register(points, points + 0.01, rejector="x84")
    >>> [one.iteration for one in result.history] == list(range(1, result.iterations + 1))
    True
    """

    iteration: int
    em_iterations: int
    inlier_share: float
    step_translation: float
    step_rotation: float
    inlier_rmse: float
    parameters: Mapping[str, float]
    transformation: Array | None = None

    def __post_init__(self) -> None:
        """Take any mapping of parameters, and keep one that pickles."""
        if not isinstance(self.parameters, FrozenDict):
            object.__setattr__(self, "parameters", FrozenDict(self.parameters))

    def __eq__(self, other: object) -> bool:
        return same(self, other) if isinstance(other, Iteration) else NotImplemented

    def __hash__(self) -> int:
        return hash((self.iteration, self.step_translation, self.step_rotation))


@dataclass(frozen=True, eq=False)
class LoopResult:
    """Where the loop ended: the motion, the last matches and labels, and how it got there.

    ``last`` is the last :class:`~hmrf_icp.loop.align.Step` taken; None where there was none.
    ``stuck`` says that it ended because the inliers did not determine a motion.
    """

    transformation: Array
    matches: Matches
    labels: Labels
    converged: bool
    em_iterations: int
    last: Step | None
    history: tuple[Iteration, ...]
    stuck: bool = False

    @property
    def weakest(self) -> float | None:
        """How well the direction known least is known; see :class:`~hmrf_icp.loop.align.Step`."""
        return None if self.last is None else self.last.weakest


class Loop:
    """Algorithm 1 on one pair of clouds: its parts prepared once, run from any number of starts.

    Parameters
    ----------
    source, target
        The free and the fixed cloud.
    method
        The parts.
    """

    def __init__(self, source: PreparedCloud, target: PreparedCloud, method: Method) -> None:
        self._points = source.points
        self._onto = len(target.points)
        self._matcher: Match = method.match.prepare(source, target)
        self._reject: Reject = stage("reject")(method.reject.prepare(source, target))
        self._align: Align = stage("align")(method.align.prepare(source, target))
        self._criteria = method.criteria.on(target)

    def __call__(
        self,
        init: Array,
        on_iteration: Callable[[Iteration], None] | None = None,
        most: int | None = None,
        after: int = 0,
    ) -> LoopResult:
        """Run from ``init`` (4, 4), for at most ``most`` iterations if that is fewer.

        ``on_iteration`` is called after every iteration, for progress; ``after`` so many,
        that another loop did, they are numbered.

        Raises
        ------
        InputError
            The start is not finite, or what the matcher found are no matches.
        """
        if np.shape(init) != (4, 4) or not np.isfinite(init).all():
            raise InputError(f"init: expected a finite 4 x 4 matrix, got {init}")
        match, reject, align = self._match, self._reject, self._align
        criteria = self._criteria if most is None else at_most(self._criteria, most)

        source = Placed.at(init, self._points)
        matches = match(source)
        labels = reject(matches, None)
        em_before = em_iterations = labels.em_iterations

        history: list[Iteration] = []
        last: Step | None = None
        converged = stuck = False
        while not converged and len(history) < criteria.max_iterations:
            labels = reject(matches, labels)
            em_iterations += labels.em_iterations
            step = align(source, matches, labels)
            stuck = step is None or not np.isfinite(step.motion).all()
            if step is None or stuck:
                break
            last = step
            source = source.moved(step.motion)
            history.append(
                Iteration(
                    iteration=after + len(history) + 1,
                    em_iterations=em_before + labels.em_iterations,
                    inlier_share=float(labels.inlier.mean()),
                    step_translation=se3.translation_norm(step.motion),
                    step_rotation=se3.rotation_angle(step.motion),
                    inlier_rmse=rms(matches.distance[labels.inlier]),
                    parameters=labels.parameters,
                    transformation=source.transformation,
                )
            )
            em_before = 0
            matches = match(source)
            converged = criteria.met(step.motion)
            if on_iteration is not None:
                on_iteration(history[-1])
        return LoopResult(
            source.transformation,
            matches,
            labels,
            converged,
            em_iterations,
            last,
            tuple(history),
            stuck,
        )

    @stage("judged pose")
    def at(self, pose: Array) -> LoopResult:
        """Tell what the parts make of a pose (4, 4) without moving from it."""
        source = Placed.at(pose, self._points)
        matches = self._match(source)
        labels = self._reject(matches, self._reject(matches, None))
        step = self._align(source, matches, labels)
        last = None if step is None else replace(step, motion=np.eye(4))
        return LoopResult(pose, matches, labels, False, labels.em_iterations, last, ())

    @stage("match")
    def _match(self, source: Placed) -> Matches:
        return checked(self._matcher(source), len(self._points), self._onto)


def icp(
    source: PreparedCloud,
    target: PreparedCloud,
    init: Array,
    method: Method,
    on_iteration: Callable[[Iteration], None] | None = None,
) -> LoopResult:
    """Run Algorithm 1 with the parts of ``method``, once, from ``init`` (4, 4)."""
    return Loop(source, target, method)(init, on_iteration)


def rms(distance: Array) -> float:
    """Root mean square, 0 of nothing."""
    return float(np.sqrt(np.mean(distance**2))) if distance.size else 0.0
