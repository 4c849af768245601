"""The states that a registration went through: where the source was, and its labels there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.figures.pair import Pair
from hmrf_icp.loop.icp import Iteration
from hmrf_icp.loop.placed import Placed
from hmrf_icp.presets import Registrar
from hmrf_icp.result import RegistrationResult
from hmrf_icp.se3 import Array

SAME_TURN = 1e-6
"""Radians within which a turn is the one that was told."""

SEEN = 20_000
"""Points of the source at most whose labels are decided anew for a film."""


@dataclass
class Recording:
    """What a registration told while it ran; give it to ``register`` as ``on_iteration``.

    A film of a search shows with it where the candidates ended that were tried and not kept, and
    the viewer every pose that was passed through.

    Parameters
    ----------
    iterations
        Those told so far.
    also
        Somebody else who wants to be told, such as a progress bar.

    Examples
    --------
    >>> import numpy as np
    >>> import hmrf_icp
    >>> from hmrf_icp import plot
    >>> points = np.random.default_rng(0).uniform(-1.0, 1.0, size=(3000, 3))
    >>> points[:, 2] = 0.2 * np.sin(4.0 * points[:, 0]) + 0.3 * np.cos(3.0 * points[:, 1])
    >>> recording = plot.Recording()
    >>> result = hmrf_icp.register(points - [0.02, 0.0, 0.01], points, on_iteration=recording)
    >>> recording.iterations[-1] == result.history[-1]
    True
    """

    iterations: list[Iteration] = field(default_factory=list)
    also: Callable[[Iteration], None] | None = None

    def __call__(self, iteration: Iteration) -> None:
        """Keep an iteration."""
        self.iterations.append(iteration)
        if self.also is not None:
            self.also(iteration)

    def tried(self, result: RegistrationResult) -> tuple[Iteration, ...]:
        """Last iteration of each loop that did not lead to the result, in their order.

        An iteration belongs to the loop of the one before where its number is the next and its
        step leads on from there.
        """
        kept = {id(one) for one in self.iterations if one in result.history}
        return tuple(
            one
            for one, following in zip(self.iterations, [*self.iterations[1:], None], strict=True)
            if id(one) not in kept and one.transformation is not None and _ends(one, following)
        )


def _ends(one: Iteration, following: Iteration | None) -> bool:
    """Whether a loop ended with an iteration, by what was told next."""
    return following is None or not follows(one, following)


def follows(one: Iteration, following: Iteration) -> bool:
    """Whether an iteration leads on from another: by its number, and by how far it turned."""
    if following.iteration != one.iteration + 1:
        return False
    before, after = one.transformation, following.transformation
    if before is None or after is None:
        return True
    turned = se3.rotation_angle(after @ se3.inverse(before))
    return abs(turned - following.step_rotation) <= SAME_TURN


@dataclass(frozen=True, eq=False)
class State:
    """One state of the loop.

    Attributes
    ----------
    pose
        (4, 4) of the source, between the prepared clouds.
    probability
        (M,) of being an inlier, one entry an observed source point.
    iteration
        The iteration that led there; None of the start.
    """

    pose: Array
    probability: Array
    iteration: Iteration | None


def states_of(
    pair: Pair, result: RegistrationResult, start: Array, method: Registrar
) -> list[State]:
    """Go through the poses of a registration again, and decide at each who is an inlier.

    Match and reject are those of the method, and each decision starts from the one before, as
    in Algorithm 1: of a method that is Algorithm 1 alone these are its labels. A search thins
    the clouds out to be fast, and its labels on the way are those of fewer points; here they
    are decided for all (:data:`SEEN` at most). At the last pose stand those of the result.

    Parameters
    ----------
    pair
        The clouds.
    result
        Whose history is gone through.
    start
        (4, 4) the start, between the prepared clouds.
    method
        As it was given to ``register``.
    """
    decide = _Decisions(pair, method)
    poses = [start]
    told = [one for one in result.history if one.transformation is not None]
    poses += [pair.between(np.asarray(one.transformation)) for one in told]
    states = [State(start, decide(start, first=True), None)]
    for iteration, pose in zip(told[:-1], poses[1:-1], strict=True):
        states.append(State(pose, decide(pose), iteration))
    last = told[-1] if told else None
    states.append(State(pair.pose, result.correspondences.matched.probability, last))
    return states


class _Decisions:
    """Labels of the source's points at one pose after the other."""

    def __init__(self, pair: Pair, method: Registrar) -> None:
        self._source, target, rows = _as_the_method_sees(pair, method)
        self._rows: NDArray[np.intp] = rows
        loop: Any = getattr(method, "method", method)  # the loop within, where more is round it
        self._match = loop.match.prepare(self._source, target)
        self._reject = loop.reject.prepare(self._source, target)
        self._labels: Any = None

    def __call__(self, pose: Array, first: bool = False) -> Array:
        """Decide at a pose, twice at the ``first``, as the loop does."""
        matches = self._match(Placed.at(pose, self._source.points))
        if first:
            self._labels = self._reject(matches, None)
        self._labels = self._reject(matches, self._labels)
        return np.asarray(self._labels.probability[self._rows])


def _as_the_method_sees(
    pair: Pair, method: Registrar
) -> tuple[PreparedCloud, PreparedCloud, NDArray[np.intp]]:
    """Clouds from where a search assumes they were seen, and no more points than are needed."""
    source, target = pair.source, pair.target
    viewed = getattr(method, "viewed", None)
    if viewed is None:
        # The paper's field wants the whole grid.
        return source, target, np.arange(len(source))
    source, target = viewed(source), viewed(target)
    return source.downsampled(SEEN), target.downsampled(SEEN), source.representatives(SEEN)
