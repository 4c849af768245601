"""Tables that never cut what tells their rows apart, however narrow the terminal."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from rich.cells import cell_len, set_cell_size

from hmrf_icp.cli.loudness import console

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions
    from rich.measure import Measurement
    from rich.table import Table
    from rich.text import Text

NARROWEST = 8
"""Columns that a name gets at least; a terminal with less breaks the lines itself."""

LEGIBLE = 8
"""Columns below which a name without its middle says nothing."""

UNLIMITED = 100_000


class Name:
    """A cell with a name that is told from all others of its column, in whatever width it gets.

    Its middle is left out where that leaves every name of the column different from the others;
    otherwise it goes on in the next line.

    Parameters
    ----------
    text
        The name.
    column
        All names of the column.
    """

    def __init__(self, text: str, column: Sequence[str]) -> None:
        self._text = text
        self._column = column

    def __rich_measure__(self, screen: Console, options: ConsoleOptions) -> Measurement:
        """Return how narrow and how wide it may be."""
        from rich.measure import Measurement

        most = cell_len(self._text)
        return Measurement(min(NARROWEST, most), most)

    def __rich_console__(self, screen: Console, options: ConsoleOptions) -> Iterator[Text]:
        """Write it into the width that there is."""
        from rich.text import Text

        yield Text(fitted(self._column, options.max_width)[self._text], overflow="fold")


def fitted(names: Sequence[str], width: int) -> dict[str, str]:
    """Shorten names to a width in columns by leaving out the middle; none where two became one."""
    everyone = tuple(dict.fromkeys(names))
    long = [name for name in everyone if cell_len(name) > width]
    for tail in (width // 2, 2 * width // 3, width // 3):
        head = width - 1 - tail
        short = {name: name for name in everyone}
        # From the end, as many characters as fit: some are two columns wide.
        short |= {
            name: f"{set_cell_size(name, head).rstrip()}…"
            f"{set_cell_size(name[::-1], tail).rstrip()[::-1]}"
            for name in long
        }
        if len(set(short.values())) == len(everyone) and width >= LEGIBLE:
            return short
    return {name: name for name in everyone}


def show(table: Table, names: Sequence[int] = (0,), stderr: bool = False) -> None:
    """Print a table: numbers whole, names shortened or folded where they do not fit.

    Where nobody watches and ``COLUMNS`` does not say otherwise, a row is a line.

    Parameters
    ----------
    table
        With its rows.
    names
        Which columns hold names (`Name`, or text to be folded); all others are left as they are.
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
