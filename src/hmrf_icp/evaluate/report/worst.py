"""The runs that a reader should look at: the largest errors, the failures least expected."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.evaluate.report.cost_tables import overlap_words, three_digits
from hmrf_icp.evaluate.report.runs import ReportedStart
from hmrf_icp.evaluate.report.study import Study

UNEXPECTED = "Failed with the most overlap"
LARGEST = "Failed with the largest error"


@dataclass(frozen=True)
class WorstRun:
    """One run, by its index in the study's rows.

    Attributes
    ----------
    index
        Of the row.
    reason
        Why it is shown.
    title, facts
        For people.
    """

    index: int
    reason: str
    title: str
    facts: str


def worst_runs(study: Study, count: int) -> list[WorstRun]:
    """Choose runs of the headline method, no pair twice.

    All of them failed. Half are those at the highest overlap, which should not have
    happened; the others are those with the largest translation error.

    Parameters
    ----------
    study
        The evaluation.
    count
        At most so many.
    """
    runs = study.runs
    mine = np.flatnonzero(runs.of(study.headline.name))
    missed = mine[~study.solved[mine]]
    by_overlap = missed[np.argsort(-runs["overlap"][missed], kind="stable")]
    chosen = _one_a_pair(study, by_overlap, -(-count // 2), set())
    finite = missed[np.isfinite(runs["error_m"][missed])]
    by_error = finite[np.argsort(-runs["error_m"][finite], kind="stable")]
    taken = {str(runs["pair"][i]) for i in chosen}
    largest = _one_a_pair(study, by_error, count - len(chosen), taken)
    return [_described(study, i, UNEXPECTED) for i in chosen] + [
        _described(study, i, LARGEST) for i in largest
    ]


def _one_a_pair(study: Study, order: NDArray[np.intp], count: int, taken: set[str]) -> list[int]:
    chosen: list[int] = []
    for index in order.tolist():
        if len(chosen) == count:
            break
        pair = str(study.runs["pair"][index])
        if pair not in taken:
            taken.add(pair)
            chosen.append(index)
    return chosen


def _described(study: Study, index: int, reason: str) -> WorstRun:
    row = study.runs.where(np.array([index]))
    start = ReportedStart(float(row["angle"][0]), float(row["translation"][0]))
    scene = study.scenes.get(str(row["pair"][0]), "")
    title = f"Source {row['source'][0]} to target {row['target'][0]}"
    title = f"{scene}: {title[0].lower()}{title[1:]}" if scene else title
    facts = [f"Overlap {overlap_words(float(row['overlap'][0]))}", start.short]
    if str(row["axis"][0]):
        facts[-1] += f" (axis {row['axis'][0]})"
    if row.failed[0]:
        facts.append(f"no pose: {row['failure'][0] or 'no reason given'}")
    else:
        facts.append(
            f"error {three_digits(float(row['error_m'][0]))} m and "
            f"{three_digits(float(row['error_rad'][0]))} rad"
        )
    for column, word in (("iterations", "iterations"), ("confidence", "confidence")):
        value = float(row[column][0])
        if np.isfinite(value):
            facts.append(f"{value:g} {word}" if word == "iterations" else f"{word} {value:.2f}")
    if row["converged"][0] == 0:
        facts.append("says that it did not converge")
    facts.append(f"row {row.line[0]} of results.csv")
    return WorstRun(index, reason, title, "; ".join(facts))
