"""The steps of a registration, in the order of time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.figures.states import follows
from hmrf_icp.loop.icp import Iteration

Array = NDArray[np.float64]

MOST_STEPS = 80
"""Steps of a story at the most: a page of more is too large to send, and nobody looks at them."""


REFINED = " refined"


@dataclass(frozen=True)
class Step:
    """A pose that was passed through.

    Attributes
    ----------
    transformation
        (4, 4) source to target, in the frames as given.
    title
        What it is: the start, a candidate's iteration, the result.
    run
        Number of the run of Algorithm 1 that it belongs to, from 1; 0 for the start and
        the result.
    chosen
        Whether it led to the pose returned.
    iteration
        What was reported of it; None for a pose that nobody reported.
    """

    transformation: Array
    title: str
    run: int
    chosen: bool
    iteration: Iteration | None = None


def steps(
    start: Array,
    end: Array,
    history: Sequence[Iteration],
    recorded: Sequence[Iteration] = (),
    most: int = MOST_STEPS,
) -> tuple[Step, ...]:
    """Lay out what happened between start and result, in the order of time.

    A search runs Algorithm 1 from one candidate after the other, and goes on with the
    likeliest: a run begins where the iterations are not numbered on.

    Parameters
    ----------
    start, end
        (4, 4) the pose that was begun at, and the one returned.
    history
        The iterations that led to ``end``.
    recorded
        All of them; none recorded where only these are known.
    most
        Steps at the most. Those that led to the result stay as long as there is room.
    """
    told = [one for one in (recorded or history) if one.transformation is not None]
    path = {_key(one) for one in history}
    middle: list[Step] = []
    for run, (name, iterations) in enumerate(_runs(told), 1):
        for one in iterations:
            assert one.transformation is not None
            title = f"{name}{one.iteration}"
            middle.append(Step(one.transformation, title, run, _key(one) in path, one))
    return (
        Step(start, "Start", 0, True),
        *_fewer(middle, most - 2),
        Step(end, "Result", 0, True, history[-1] if history else None),
    )


def _runs(told: Sequence[Iteration]) -> list[tuple[str, list[Iteration]]]:
    """Split what was told into runs of Algorithm 1, each with what its steps are called."""
    runs: list[tuple[str, list[Iteration]]] = []
    candidate = 0
    for one in told:
        if runs and follows(runs[-1][1][-1], one):
            runs[-1][1].append(one)
            continue
        candidate += one.iteration == 1
        before = next((name for name, run in runs if follows(run[-1], one)), None)
        if one.iteration == 1:
            name = f"Candidate {candidate}"
        else:
            name = "Refined" if before is None else f"{before.removesuffix(REFINED)}{REFINED}"
        runs.append((name, [one]))
    if len(runs) == 1:
        return [("Iteration ", runs[0][1])]
    return [(f"{name}, iteration ", run) for name, run in runs]


def _key(one: Iteration) -> tuple[int, bytes]:
    pose = one.transformation
    return one.iteration, b"" if pose is None else pose.tobytes()


def _fewer(steps: list[Step], most: int) -> list[Step]:
    """Leave out steps where there are too many: of those beside the path first, evenly."""
    over = len(steps) - most
    if over <= 0:
        return steps
    beside = [i for i, step in enumerate(steps) if not step.chosen]
    path = [i for i, step in enumerate(steps) if step.chosen]
    room = max(most - len(path), 0)
    kept = {*_evenly(beside, room), *_evenly(path, most - min(room, len(beside)))}
    return [step for i, step in enumerate(steps) if i in kept]


def _evenly(rows: list[int], count: int) -> list[int]:
    """Choose ``count`` of the rows, evenly, the last among them."""
    if count >= len(rows):
        return rows
    return [rows[-1 - (i * len(rows)) // count] for i in range(count)]
