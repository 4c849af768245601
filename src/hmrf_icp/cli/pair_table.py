"""The table at the end of ``hmrf-icp register`` on many pairs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from rich.table import Table

from hmrf_icp.cli.ledger import BELIEVED, DOUBTFUL, FAILED, Row
from hmrf_icp.cli.pairs import labels
from hmrf_icp.cli.summary import length
from hmrf_icp.cli.tables import Name

STYLES = {BELIEVED: "green", DOUBTFUL: "yellow", FAILED: "red"}


def names_of(rows: Sequence[Row]) -> tuple[int, ...]:
    """Tell which columns of the table hold names."""
    return tuple(range(len(_named(rows))))


def pair_table(rows: Sequence[Row]) -> Table:
    """Make a row of each pair: what it is called, whether to believe it, and the numbers.

    Target and start have columns where there are several.
    """
    table = Table(box=None, padding=(0, 1, 0, 0))
    named = _named(rows)
    for heading in named:
        table.add_column(heading)
    table.add_column("verdict")
    for heading in ("conf.", "overlap", "RMSE", "time"):
        table.add_column(heading, justify="right")
    for row, *names in zip(rows, *named.values(), strict=True):
        table.add_row(
            *(Name(name, named[heading]) for name, heading in zip(names, named, strict=True)),
            f"[{STYLES[row.verdict]}]{row.verdict}[/]",
            _told(row.confidence, "{:.2f}"),
            _told(row.overlap, "{:.1%}"),
            "" if math.isnan(row.inlier_rmse) else length(row.inlier_rmse),
            _told(row.seconds, "{:.2f} s"),
        )
    return table


def _named(rows: Sequence[Row]) -> dict[str, list[str]]:
    """Return the columns that tell the rows apart."""
    columns = {"source": [row.source for row in rows]}
    if len({row.target for row in rows}) > 1:
        columns["target"] = [row.target for row in rows]
    if len({row.init for row in rows}) > 1:
        columns["start"] = [row.init for row in rows]
    short = {}
    for heading, files in columns.items():
        shown = labels([Path(file) for file in files if file])
        short[heading] = [shown[Path(file)] if file else "" for file in files]
    return short


def _told(value: float, how: str) -> str:
    return "" if math.isnan(value) else how.format(value)
