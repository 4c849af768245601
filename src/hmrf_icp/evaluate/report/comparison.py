"""The paper's numbers beside those of this evaluation."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.evaluate.report.cost_tables import three_digits
from hmrf_icp.evaluate.report.methods import family_label
from hmrf_icp.evaluate.report.published import (
    PAPER_ANGLE,
    PAPER_ORDER,
    PUBLISHED_MAXIMA,
    Maximum,
    PaperRows,
)
from hmrf_icp.evaluate.report.runs import ReportedStart, angle_label
from hmrf_icp.evaluate.report.statistics import DECILES, decile, decile_label, median
from hmrf_icp.evaluate.report.study import Study
from hmrf_icp.evaluate.report.tables import NOTHING, Cell, Group, Row, Table

FIELD = "hmrf"
"""The paper's method in ``results.csv``."""


def paper_start(study: Study) -> ReportedStart | None:
    """Return the start of the paper's plots, a turn by pi/30 alone, if it was run."""
    for start in study.starts:
        if start.translation == 0 and math.isclose(start.angle, PAPER_ANGLE, rel_tol=1e-3):
            return start
    return None


def maxima_table(study: Study) -> Table | None:
    """Put the published maxima of HMRF-ICP beside ours; None without such runs."""
    start = paper_start(study)
    if start is None or FIELD not in study.runs.methods:
        return None
    ours = study.runs.where(study.runs.begun_at(start) & study.runs.of(FIELD))
    headline = study.headline
    columns = ["paper, max (m)", "paper, max (rad)"]
    columns += ["HMRF here, max (m)", "HMRF here, max (rad)"]
    columns += ["HMRF here, median (m)", "HMRF here, median (rad)"]
    other = None
    if headline.name != FIELD:
        columns += [f"{headline.label} here, max (m)", f"{headline.label} here, max (rad)"]
        other = study.runs.where(study.runs.begun_at(start) & study.runs.of(headline.name))
    columns.append("runs here")

    def row(published: Maximum) -> Row:
        cells = [Cell(f"{published.metres:g}"), Cell(f"{published.radians:g}")]
        here = ours.where((ours["overlap"] >= published.low) & (ours["overlap"] < published.high))
        cells += [_largest(here[c]) for c in ("error_m", "error_rad")]
        cells += [Cell(three_digits(median(here[c]))) for c in ("error_m", "error_rad")]
        if other is not None:
            those = other.where(
                (other["overlap"] >= published.low) & (other["overlap"] < published.high)
            )
            cells += [_largest(those[c]) for c in ("error_m", "error_rad")]
        return Row(published.regime, [*cells, Cell(str(len(here)))])

    groups = [
        Group(
            f"{sequence.capitalize()} sequence in the paper",
            [row(published) for published in PUBLISHED_MAXIMA if published.sequence == sequence],
        )
        for sequence in ("shark", "desk")
    ]
    return Table(
        name="published-maxima",
        caption=f"Largest errors of HMRF-ICP: in the paper on its two sequences, here on "
        f"{study.dataset}, started {start.label} from the true pose",
        corner="Overlap",
        columns=columns,
        groups=groups,
        notes=[
            "Different scenes: the paper's two sequences are its own, so its numbers are a scale "
            "to read ours by, not a target."
        ],
    )


def comparable_starts(study: Study, paper: PaperRows) -> Iterator[tuple[ReportedStart, float]]:
    """Our starts that a released file can be held against, with the angle of its rows.

    A turn alone, by an angle that the file has. A file that does not say how
    its starts were turned is held against the paper's pi/30, or else our
    smallest turn.
    """
    if paper.angle is None:
        turned = [start for start in study.starts if start.given and start.translation == 0]
        start = paper_start(study) or (turned[0] if turned else None)
        if start is not None:
            yield start, start.angle
        return
    for start in study.starts:
        if start.translation == 0 and paper.started_at(start.angle).any():
            yield start, start.angle


def medians_table(
    study: Study, paper: PaperRows, start: ReportedStart | None, angle: float, column: str
) -> Table:
    """Medians by decile of overlap, the paper's over ours, for one kind of error.

    Parameters
    ----------
    study, paper
        This evaluation, and a released file.
    start
        Our start; None where there is none to compare with.
    angle
        Which rows of the file, radians.
    column
        ``error_m`` or ``error_rad``.
    """
    published = paper.metres if column == "error_m" else paper.radians
    chosen = paper.started_at(angle)
    their_decile = decile(paper.overlap)
    groups = []
    for number in range(DECILES - 1, -1, -1):
        rows = chosen & (their_decile == number)
        if rows.any():
            label = f"{decile_label(number)}: paper ({_rows(int(rows.sum()))})"
            lines = [Row(label, [_median(published[m][rows]) for m in paper.methods])]
            if start is not None:
                lines.append(_our_row(study, paper, start, number, column))
            groups.append(Group("", lines))
    unit = "m" if column == "error_m" else "rad"
    kind = "translation" if column == "error_m" else "rotation"
    turned = "" if paper.angle is None else f", rows turned by {angle_label(angle)}"
    notes = [
        "Paper: medians of the runs that the file has a number for; how many failed stands behind."
    ]
    if paper.angle is None:
        notes.append("The file does not say how far its starts were turned.")
    exact = {m: int(np.count_nonzero(published[m][chosen] == 0)) for m in paper.methods}
    notes += [
        f"The file has {count} errors of exactly 0 for {family_label(m)}, taken as they are."
        for m, count in exact.items()
        if count
    ]
    return Table(
        name=f"paper-{paper.name}-{column.replace('_', '-')}"
        + ("" if start is None else f"-{start.slug}"),
        caption=f"Median {kind} error ({unit}) by overlap: {paper.name}{turned}, and "
        f"{study.dataset}"
        + ("" if start is None else f" started {start.label} from the true pose"),
        corner="Overlap",
        columns=[family_label(method) for method in paper.methods],
        groups=groups,
        notes=notes,
    )


def decile_medians(
    overlap: NDArray[np.float64], errors: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Middles of the deciles that have a finite error, and the median error in each."""
    place = decile(overlap)
    middles, medians = [], []
    for number in range(DECILES):
        value = median(errors[place == number])
        if value is not None:
            middles.append((number + 0.5) / DECILES)
            medians.append(value)
    return np.array(middles), np.array(medians)


def _our_row(study: Study, paper: PaperRows, start: ReportedStart, number: int, column: str) -> Row:
    runs = study.runs.where(study.runs.begun_at(start) & (study.runs.decile == number))
    cells = [
        _median(runs[column][runs.of(m)]) if m in PAPER_ORDER else NOTHING for m in paper.methods
    ]
    counts = {int(runs.of(m).sum()) for m in PAPER_ORDER if m in study.runs.methods}
    return Row(f"{decile_label(number)}: here ({_rows(max(counts, default=0))})", cells)


def _rows(count: int) -> str:
    return f"{count} {'run' if count == 1 else 'runs'}"


def _median(errors: NDArray[np.float64]) -> Cell:
    failed = int(np.count_nonzero(~np.isfinite(errors)))
    detail = f"{failed} of {errors.size} failed" if failed else ""
    return Cell(three_digits(median(errors)), detail=detail)


def _largest(errors: NDArray[np.float64]) -> Cell:
    finite = errors[np.isfinite(errors)]
    failed = errors.size - finite.size
    detail = f"{failed} without a pose" if failed else ""
    return Cell(three_digits(float(finite.max())), detail=detail) if finite.size else NOTHING
