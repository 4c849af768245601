"""Whether a method knows when it failed: its own score against the outcome of its runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hmrf_icp.evaluate.report.cast import Band
from hmrf_icp.evaluate.report.methods import ReportedMethod
from hmrf_icp.evaluate.report.runs import Mask
from hmrf_icp.evaluate.report.statistics import Array, area_under_roc, reliability
from hmrf_icp.evaluate.report.study import Study
from hmrf_icp.evaluate.report.tables import NOTHING, Cell, Group, Row, Table

LOW_OVERLAP = 0.2
"""Below this the usual score, the share of points with a neighbour, tells little."""


SURE = 0.5
"""A run that is told this or more counts as told."""


@dataclass(frozen=True, eq=False)
class Score:
    """What one method, or several, said of some runs, and how those ended.

    Attributes
    ----------
    label
        Of the method.
    column
        ``confidence`` or ``fitness``.
    value
        (N,) the score.
    solved, low
        (N,) whether the run succeeded, and whether its overlap is below 0.2.
    """

    label: str
    column: str
    value: Array
    solved: Mask
    low: Mask

    def area(self, low_only: bool = False) -> float | None:
        """Area under the ROC curve; None without a success or without a failure."""
        keep = self.low if low_only else np.ones_like(self.low)
        return area_under_roc(self.value[keep], self.solved[keep])


def score_of(study: Study, methods: Sequence[str], label: str, column: str) -> Score | None:
    """Collect a score over all runs that have one; None where none has."""
    runs = study.runs
    keep = np.isin(runs["method"], list(methods)) & np.isfinite(runs[column])
    if not keep.any():
        return None
    return Score(
        label, column, runs[column][keep], study.solved[keep], runs["overlap"][keep] < LOW_OVERLAP
    )


def own_score(study: Study, method: ReportedMethod) -> Score | None:
    """Return a method's confidence, or else its fitness; None where it tells neither."""
    for column in ("confidence", "fitness"):
        score = score_of(study, [method.name], method.label, column)
        if score is not None:
            return score
    return None


def pooled_fitness(study: Study) -> Score | None:
    """Return the fitness of all peers at all settings, as one score."""
    return score_of(study, [p.name for p in study.roster.peers], "all peers together", "fitness")


def confident(study: Study) -> list[Score]:
    """Return the scores of the methods that give a confidence."""
    found = (
        score_of(study, [method.name], method.label, "confidence")
        for method in study.roster.methods
    )
    return [score for score in found if score is not None]


def confidence_table(study: Study, bands: Sequence[Band], name: str = "confidence") -> Table | None:
    """How well each method's score tells its successes from its failures; None without scores."""
    groups = []
    for band in bands:
        members = [own_score(study, method) for method in band.methods]
        if band is bands[-1]:
            members.append(pooled_fitness(study))
        rows = []
        for score in members:
            if score is None:
                continue
            calibration = NOTHING
            if score.column == "confidence":
                error = reliability(np.clip(score.value, 0, 1), score.solved).calibration_error
                calibration = Cell(f"{error:.3f}")
            rows.append(
                Row(
                    score.label,
                    [
                        Cell(score.column),
                        _area(score, low_only=False),
                        _area(score, low_only=True),
                        calibration,
                        Cell(str(score.value.size)),
                    ],
                    strong=score.column == "confidence",
                )
            )
        if rows:
            groups.append(Group(band.heading, rows))
    if not groups:
        return None
    return Table(
        name=name,
        caption="Does a method know when it failed? Area under the ROC curve of its own score",
        corner="Method",
        columns=[
            "score",
            "all overlaps",
            f"overlap below {LOW_OVERLAP:g}",
            "calibration error",
            "runs with a score",
        ],
        groups=groups,
        notes=[
            "1 is a score that always tells a success from a failure, 0.5 one that tells nothing; "
            "a dash stands where there were only successes, or only failures. Fitness is the share "
            "of points that a method takes for matched, confidence its own estimate that the pose "
            "is right; calibration error is the mean distance between that and how often it was."
        ],
    )


def _area(score: Score, low_only: bool) -> Cell:
    area = score.area(low_only)
    return NOTHING if area is None else Cell(f"{area:.3f}", max(0.0, 2 * area - 1))
