"""Tables of recall: which share of the runs each method solved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hmrf_icp.evaluate.report.cast import Band, everybody
from hmrf_icp.evaluate.report.methods import ReportedMethod
from hmrf_icp.evaluate.report.runs import Mask, ReportedStart, Runs
from hmrf_icp.evaluate.report.statistics import DECILES, Share, decile_label
from hmrf_icp.evaluate.report.study import Study
from hmrf_icp.evaluate.report.tables import NOTHING, Cell, Group, Row, Table

BEST_SINGLE = "best single peer setting"
ORACLE = "oracle"
MIXED = "all starts"


@dataclass(frozen=True)
class Slice:
    """Runs that one column of a table is about: a start (None: every start) and a decile."""

    start: ReportedStart | None = None
    decile: int | None = None

    def of(self, runs: Runs) -> Mask:
        """Return the mask of those runs."""
        mask = np.ones(len(runs), dtype=np.bool_)
        if self.start is not None:
            mask &= runs.begun_at(self.start)
        if self.decile is not None:
            mask &= runs.decile == self.decile
        return mask


def recall(study: Study, method: ReportedMethod, part: Slice) -> Share:
    """Successes and runs of one method."""
    return Share.of(study.solved[part.of(study.runs) & study.runs.of(method.name)])


def recall_table(study: Study, bands: Sequence[Band], name: str = "recall") -> Table:
    """Recall from every start, with the rows that hindsight would give."""
    parts = [Slice(start) for start in study.starts]
    columns = [start.label for start in study.starts]
    if len(parts) > 1:
        parts.append(Slice())
        columns.append(MIXED)
    return Table(
        name=name,
        caption=f"Recall by start; a run counts when {study.criterion}",
        corner="Method",
        columns=columns,
        groups=_groups(study, bands, parts, detailed=True),
        notes=_notes(study),
    )


def recall_by_decile_table(
    study: Study, bands: Sequence[Band], start: ReportedStart, name: str = "recall-by-overlap"
) -> Table:
    """Recall from one start, by decile of overlap."""
    begun = study.runs.where(study.runs.begun_at(start))
    deciles = [d for d in range(DECILES) if np.any(begun.decile == d)]
    columns = []
    for d in deciles:
        pairs = len(set(begun["pair"][begun.decile == d].tolist()))
        columns.append(f"{decile_label(d)}\n{pairs} {'pair' if pairs == 1 else 'pairs'}")
    parts = [Slice(start, d) for d in deciles] + [Slice(start)]
    return Table(
        name=f"{name}-{start.slug}",
        caption=f"Recall by overlap, {start.begun}",
        corner="Method",
        columns=[*columns, "all"],
        groups=_groups(study, bands, parts, detailed=False),
    )


def share_cell(share: Share, detailed: bool, strong: bool = False, before: str = "") -> Cell:
    """Write a share, shaded by its value; a dash where there was no run."""
    if share.value is None:
        return NOTHING
    detail = ""
    if detailed:
        low, high = share.interval
        detail = f"{before}{share.solved} of {share.runs}, {low:.2f}–{high:.2f}"
    elif before:
        detail = before.removesuffix("; ")
    return Cell(f"{share.value:.2f}", share.value, detail, strong)


def _groups(
    study: Study, bands: Sequence[Band], parts: Sequence[Slice], detailed: bool
) -> list[Group]:
    shares = {m.name: [recall(study, m, part) for part in parts] for m in everybody(bands)}
    # The best of a column is marked among what can be run; hindsight cannot.
    top = [max(row[i].value or 0.0 for row in shares.values()) for i in range(len(parts))]
    groups = []
    for band in bands:
        rows = [
            Row(
                method.label,
                [
                    share_cell(share, detailed, share.value == best and bool(best))
                    for share, best in zip(shares[method.name], top, strict=True)
                ],
                strong=method == study.headline,
            )
            for method in band.methods
        ]
        groups.append(Group(band.heading, rows))
    return groups + _hindsight_groups(study, parts, detailed)


def _hindsight_groups(study: Study, parts: Sequence[Slice], detailed: bool) -> list[Group]:
    groups = []
    for hindsight in study.hindsights:
        best_cells, oracle_cells = [], []
        oracle = hindsight.oracle(study.runs, study.success)
        for part in parts:
            # "Best setting" is one choice for all deciles of a start, not one a decile.
            chosen_on = study.runs.where(Slice(part.start).of(study.runs))
            chosen = hindsight.best(chosen_on, study.success)
            name = f"{chosen.label}; " if detailed or part.decile is None else ""
            best_cells.append(share_cell(recall(study, chosen, part), detailed, before=name))
            oracle_cells.append(share_cell(oracle.share(part.of(oracle.problems)), detailed))
        rows = [Row(BEST_SINGLE, best_cells), Row(ORACLE, oracle_cells)]
        groups.append(Group(f"In hindsight, of {hindsight.label}", rows))
    return groups


def _notes(study: Study) -> list[str]:
    notes = [
        "Behind each recall: solved runs of all runs, and the 95 % interval after Wilson. It takes "
        "runs as independent; those of one pair from different axes are not quite, so the true "
        "uncertainty is somewhat larger."
    ]
    if study.hindsights:
        notes.append(
            "Best single peer setting: of all peers and thresholds, the one that solves most runs "
            "of the column, known only afterwards. Oracle: a run counts as solved if any peer at "
            "any threshold solved it."
        )
    counts = {
        int(np.count_nonzero(study.runs.of(method.name)))
        for method in study.roster.methods
        if method.needs_start
    }
    if len(counts) > 1:
        notes.append(
            f"The methods have between {min(counts)} and {max(counts)} runs each: the evaluation "
            "was not finished, and rows with different counts should not be compared."
        )
    return notes
