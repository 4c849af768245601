"""What the rows of `speed.py` are made of: taking turns, and what comes out of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np


class Left(Exception):  # noqa: N818 - nothing went wrong
    """A row that cannot be measured here, and why."""


@dataclass(frozen=True)
class Setting:
    """How all rows are run.

    Parameters
    ----------
    data
        Folder of the shared data.
    threads
        That ours and the peer may use.
    quick
        Few pairs, few repeats.
    """

    data: Path
    threads: int
    quick: bool

    def some(self, full: int, quick: int) -> int:
        """Choose how many."""
        return quick if self.quick else full


@dataclass(frozen=True)
class Measured:
    """What a row says.

    Parameters
    ----------
    value
        Ratio or size that is held against the bound.
    ours, theirs
        Medians, seconds.
    count
        Pairs.
    note
        On the data and how it was measured.
    details
        More, for the JSON and the figure.
    """

    value: float
    ours: float | None = None
    theirs: float | None = None
    count: int = 1
    note: str = ""
    details: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Row:
    """One promise.

    Parameters
    ----------
    work, peer
        What is timed, and what it is divided by.
    bound
        What the value is to stay at or below; None where nothing is promised.
    run
        Measures it.
    unit
        Of value and bound; empty for a ratio.
    """

    work: str
    peer: str
    bound: float | None
    run: Callable[[Setting], Measured]
    unit: str = ""


Task = Callable[[], Any]


def seconds(task: Task) -> float:
    """Wall time of a task."""
    began = time.perf_counter()
    task()
    return time.perf_counter() - began


def in_turn(tasks: Iterable[tuple[Task, ...]], repeats: int) -> np.ndarray:
    """Time tasks that take turns: medians (pairs, tasks) over the repeats, seconds.

    Each runs once before, so that nothing is compiled or loaded in its time. Who goes first
    changes from turn to turn.
    """
    rows = []
    for group in tasks:
        for task in group:
            task()
        times = np.empty((repeats, len(group)))
        for turn in range(repeats):
            order = range(len(group))
            for place in order if turn % 2 == 0 else reversed(order):
                times[turn, place] = seconds(group[place])
        rows.append(np.median(times, axis=0))
    if not rows:
        raise Left("no pairs")
    return np.array(rows)


def against(times: np.ndarray, note: str = "", **details: Any) -> Measured:
    """Hold the first column of `in_turn` against the second, pair by pair."""
    ratios = times[:, 0] / times[:, 1]
    ours, theirs = np.median(times[:, :2], axis=0)
    worst = {"ratios": ratios.tolist(), "seconds": times.tolist()}
    return Measured(
        float(np.median(ratios)), float(ours), float(theirs), len(times), note, worst | details
    )
