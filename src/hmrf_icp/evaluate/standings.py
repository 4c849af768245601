"""Who solved how much, in a few numbers a method."""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hmrf_icp.evaluate.protocol import Start
from hmrf_icp.evaluate.results import read_rows

METRES, RADIANS = 0.05, 0.05
"""A run is solved when it ends within these of the true pose, if its pair has no criterion."""

_COLUMNS = ("method", "angle", "translation", "error_m", "error_rad", "right", "seconds")


@dataclass
class Tally:
    """Runs of one method from one start."""

    runs: int = 0
    solved: int = 0

    @property
    def recall(self) -> float:
        """Share of the runs that were solved."""
        return self.solved / self.runs


@dataclass
class Standing:
    """One method.

    Attributes
    ----------
    by_start
        Its runs, start by start.
    error_m
        Of the runs that it solved, metres.
    seconds
        Of all its runs.
    failures
        Runs that gave no pose.
    """

    method: str
    by_start: dict[Start, Tally] = field(default_factory=dict)
    error_m: array[float] = field(default_factory=lambda: array("d"))
    seconds: array[float] = field(default_factory=lambda: array("d"))
    failures: int = 0

    @property
    def median_error_m(self) -> float | None:
        """Median translation error of what it solved, metres."""
        return float(np.median(self.error_m)) if self.error_m else None

    @property
    def median_seconds(self) -> float:
        """Median time of a run."""
        return float(np.median(self.seconds))


def standings(results: Path) -> list[Standing]:
    """Read ``results.csv``; methods in the order in which they come."""
    found: dict[str, Standing] = {}
    for method, angle, translation, error_m, error_rad, right, seconds in read_rows(
        results, _COLUMNS
    ):
        standing = found.setdefault(method, Standing(method))
        tally = standing.by_start.setdefault(Start.of_cells(angle, translation), Tally())
        tally.runs += 1
        standing.seconds.append(float(seconds))
        if not error_m:
            standing.failures += 1
        elif right == "True" if right else _within(error_m, error_rad):
            tally.solved += 1
            standing.error_m.append(float(error_m))
    return list(found.values())


def _within(error_m: str, error_rad: str) -> bool:
    return float(error_m) <= METRES and float(error_rad) <= RADIANS
