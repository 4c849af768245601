"""Tables that never cut what tells their rows apart, however narrow the terminal."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

from hmrf_icp.cli.loudness import console

if TYPE_CHECKING:
    from rich.table import Table

NARROWEST = 12
"""Columns that a name gets at least; a terminal with less breaks the lines itself."""

UNLIMITED = 100_000


def show(table: Table, names: Sequence[int] = (0,), stderr: bool = False) -> None:
    """Print a table: numbers whole, names folded where they do not fit.

    Where nobody watches and ``COLUMNS`` does not say otherwise, a row is a line.

    Parameters
    ----------
    table
        With its rows.
    names
        Which columns hold names, that may be folded; all others are left as they are.
    stderr
        Print it there.
    """
    from rich.measure import measure_renderables

    screen = console(stderr)
    width = screen.width
    if not screen.is_terminal and "COLUMNS" not in os.environ:
        width = UNLIMITED
    wide = screen.options.update(max_width=UNLIMITED)
    for number, column in enumerate(table.columns):
        column.overflow = "fold"
        if number not in names:
            cells = [*column.cells]
            column.min_width = measure_renderables(screen, wide, cells).maximum if cells else 0
    needed = [table.columns[number] for number in names]
    wanted = [measure_renderables(screen, wide, [c.header, *c.cells]).maximum for c in needed]
    for column, most in zip(needed, wanted, strict=True):
        column.max_width = column.min_width = min(most, NARROWEST)
    by_need = sorted(zip(needed, wanted, strict=True), key=lambda of: of[1])
    spare = max(0, width - table.__rich_measure__(screen, wide).minimum)
    for left, (column, most) in enumerate(by_need):
        more = min(most - min(most, NARROWEST), spare // (len(needed) - left))
        column.max_width = column.min_width = min(most, NARROWEST) + more
        spare -= more
    least = table.__rich_measure__(screen, wide).minimum
    screen.print(table, width=max(width if width < UNLIMITED else 0, least), crop=False)
