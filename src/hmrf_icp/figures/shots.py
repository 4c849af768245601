"""What a film shows one after the other: states that were, and what is put between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hmrf_icp import se3
from hmrf_icp.figures.pair import Pair
from hmrf_icp.figures.states import State
from hmrf_icp.loop.icp import Iteration
from hmrf_icp.se3 import Array

Kind = Literal["start", "candidate", "between", "iteration", "result"]

START, CANDIDATE, RESULT = 0.8, 0.16, 2.2
"""Seconds that the start, a candidate of a search and the result stand."""

CANDIDATES = 20
"""Most candidates that are shown; of more, these evenly chosen."""


@dataclass(frozen=True, eq=False)
class Shot:
    """One picture of a film.

    Attributes
    ----------
    kind
        The start; where a candidate ended that was not kept; between two states, which never
        was and is interpolated; an iteration; the result.
    pose
        (4, 4) of the source, between the prepared clouds.
    probability
        (M,) of being an inlier; None where nobody decided.
    frames
        For how many frames it stands.
    number, of
        Which candidate or iteration, of how many.
    iteration
        What the iteration did; of one between two, the one before.
    place
        On the time line: iterations from the start, with what is between them.
    """

    kind: Kind
    pose: Array
    probability: Array | None
    frames: int
    number: int
    of: int
    iteration: Iteration | None
    place: float


def shots_of(
    pair: Pair, states: Sequence[State], tried: Sequence[Iteration], fps: int, seconds: float
) -> list[Shot]:
    """Lay out a film.

    Parameters
    ----------
    pair
        The clouds.
    states
        From the start to the result.
    tried
        Candidates that were not kept.
    fps
        Frames a second.
    seconds
        That the way from the start to the result takes, but for at least a frame an iteration.
    """
    start, *later = states
    of = len(later) - 1 if later[-1].iteration is None else len(later)

    def lasting(time: float) -> int:
        return max(1, round(time * fps))

    shots = [Shot("start", start.pose, start.probability, lasting(START), 0, of, None, 0.0)]
    some = np.unique(np.linspace(0, len(tried) - 1, min(CANDIDATES, len(tried))).astype(np.intp))
    for row in some.tolist():
        pose = pair.between(np.asarray(tried[row].transformation))
        each = lasting(CANDIDATE)
        shots.append(Shot("candidate", pose, None, each, row + 1, len(tried), tried[row], 0.0))
    steps = max(1, round(seconds * fps / len(later)))
    middle = pair.source.points.mean(axis=0)
    for number, (before, after) in enumerate(zip(states[:-1], later, strict=True)):
        for k in range(1, steps):
            pose = between(before.pose, after.pose, k / steps, middle)
            chance, place = before.probability, number + k / steps
            shots.append(Shot("between", pose, chance, 1, number, of, before.iteration, place))
        place = number + 1.0
        shots.append(
            Shot(
                "iteration",
                after.pose,
                after.probability,
                1,
                number + 1,
                of,
                after.iteration,
                place,
            )
        )
    end = later[-1]
    shots[-1] = Shot(
        "result", end.pose, end.probability, lasting(RESULT), of, of, end.iteration, len(later)
    )
    return shots


def between(one: Array, other: Array, share: float, middle: Array) -> Array:
    """Pose (4, 4) on the way from one to another: ``middle`` (3,) goes straight, and it turns."""
    turn = se3.log(se3.rigid(other[:3, :3] @ one[:3, :3].T, np.zeros(3)))[:3]
    rotation = se3.rotation_exp(share * turn) @ one[:3, :3]
    ends = se3.transform(one, middle[None])[0], se3.transform(other, middle[None])[0]
    there = (1.0 - share) * ends[0] + share * ends[1]
    return se3.rigid(rotation, there - rotation @ middle)
