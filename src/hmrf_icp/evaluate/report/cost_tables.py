"""Tables of accuracy where a method succeeded, and of what it cost."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from hmrf_icp.evaluate.report.cast import Band
from hmrf_icp.evaluate.report.methods import ReportedMethod
from hmrf_icp.evaluate.report.recall_tables import MIXED, Slice
from hmrf_icp.evaluate.report.statistics import decile_label, median
from hmrf_icp.evaluate.report.study import Study
from hmrf_icp.evaluate.report.tables import NOTHING, Cell, Group, Row, Table


def three_digits(value: float | None) -> str:
    """Write a number with three significant digits, never as a power of ten."""
    if value is None or not np.isfinite(value):
        return NOTHING.text
    if value != 0 and abs(value) < 1e-5:
        return "< 0.00001"
    decimals = 0 if abs(value) >= 100 else 2 - int(np.floor(np.log10(abs(value)))) if value else 0
    return f"{value:.{max(0, decimals)}f}"


def overlap_words(overlap: float) -> str:
    """Write an overlap with two decimals, and with more where those say nothing."""
    return f"{overlap:.2f}" if overlap >= 0.01 else three_digits(overlap)


def accuracy_table(study: Study, bands: Sequence[Band], name: str = "accuracy") -> Table:
    """Median errors of the runs that succeeded, a start."""
    runs = study.runs
    parts = [Slice(start) for start in study.starts]
    labels = [start.label for start in study.starts]
    if len(parts) > 1:
        parts.append(Slice())
        labels.append(MIXED)

    def cells(method: ReportedMethod) -> list[Cell]:
        row = []
        for part in parts:
            mask = part.of(runs) & runs.of(method.name) & study.solved
            for column in ("error_m", "error_rad"):
                row.append(Cell(three_digits(median(runs[column][mask]))))
        return row

    return Table(
        name=name,
        caption="Median errors of the runs that succeeded",
        corner="Method",
        columns=[f"{label}: error ({unit})" for label in labels for unit in ("m", "rad")],
        groups=_by_band(study, bands, cells),
        notes=[
            "A method that solves only the easy runs looks accurate here: read beside its recall."
        ],
    )


def effort_table(study: Study, bands: Sequence[Band], name: str = "effort") -> Table:
    """List iterations and times of every method over all its runs."""
    runs = study.runs

    def cells(method: ReportedMethod) -> list[Cell]:
        mask = runs.of(method.name)
        times = runs["seconds"][mask]
        times = times[np.isfinite(times)]
        slow = float(np.quantile(times, 0.95)) if times.size else None
        converged = runs["converged"][mask]
        converged = converged[np.isfinite(converged)]
        return [
            _count(median(runs["iterations"][mask])),
            _count(median(runs["em_iterations"][mask])),
            Cell(three_digits(median(times))),
            Cell(three_digits(slow)),
            Cell(f"{converged.mean():.2f}") if converged.size else NOTHING,
            Cell(str(int(np.count_nonzero(runs.failed[mask])))),
        ]

    return Table(
        name=name,
        caption="Iterations and time, over all runs from all starts",
        corner="Method",
        columns=[
            "ICP iterations, median",
            "EM iterations, median",
            "time, median (s)",
            "time, 95 % below (s)",
            "says it converged",
            "runs without a pose",
        ],
        groups=_by_band(study, bands, cells),
        notes=[
            "A dash stands where a method has no such number or does not tell. That a method says "
            "it converged means that its steps became small, and not that its pose is right: how "
            "far to believe a pose is its confidence. Times are those of "
            "the machine named below, with the number of workers that the evaluation used."
        ],
    )


def failure_table(study: Study) -> Table | None:
    """Why runs gave no pose; None where all did."""
    runs = study.runs
    failed = np.flatnonzero(runs.failed)
    if not failed.size:
        return None
    counts = Counter(
        (str(runs["method"][i]), str(runs["failure"][i]) or "no reason given") for i in failed
    )
    labels = {method.name: method.label for method in study.roster.methods}
    rows = [
        Row(labels[method], [Cell(reason), Cell(str(count))])
        for (method, reason), count in counts.most_common(30)
    ]
    return Table(
        name="failures",
        caption="Runs that ended without a pose; they count as not solved",
        corner="Method",
        columns=["what it said", "runs"],
        groups=[Group("", rows)],
    )


def pairs_table(study: Study) -> Table:
    """How many pairs and runs stand in each decile of overlap."""
    runs = study.runs
    rows = []
    for number in range(9, -1, -1):
        mask = runs.decile == number
        pairs = len(set(runs["pair"][mask].tolist()))
        problems = len(np.unique(runs.problem[mask]))
        counts = (pairs, problems, int(np.count_nonzero(mask)))
        rows.append(Row(decile_label(number), [Cell(str(count)) for count in counts]))
    return Table(
        name="pairs",
        caption="What was run: pairs of frames by decile of overlap",
        corner="Overlap",
        columns=["pairs", "problems (pair, start and axis)", "runs of all methods"],
        groups=[Group("", rows)],
    )


def _by_band(
    study: Study, bands: Sequence[Band], cells: Callable[[ReportedMethod], Sequence[Cell]]
) -> list[Group]:
    return [
        Group(
            band.heading,
            [Row(m.label, cells(m), strong=m == study.headline) for m in band.methods],
        )
        for band in bands
    ]


def _count(value: float | None) -> Cell:
    return NOTHING if value is None else Cell(f"{value:g}")
