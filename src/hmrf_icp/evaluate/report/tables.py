"""Tables as data, written as HTML by the page and as Markdown here."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Cell:
    """One value, as text.

    Attributes
    ----------
    text
        What is read; a dash where there is nothing to say.
    share
        A number in [0, 1] that the page shades the cell by; None for no shading.
    detail
        What hangs behind the text: an interval, counts.
    strong
        Whether this is the best of its column.
    """

    text: str
    share: float | None = None
    detail: str = ""
    strong: bool = False


NOTHING = Cell("–")


@dataclass(frozen=True)
class Row:
    """A label and one cell a column."""

    label: str
    cells: Sequence[Cell]
    strong: bool = False


@dataclass(frozen=True)
class Group:
    """Rows under one heading; an empty heading is not shown."""

    heading: str
    rows: Sequence[Row]


@dataclass(frozen=True)
class Table:
    """A table with a caption that says what it shows without the text around it.

    Attributes
    ----------
    name
        Identifier, in the page's anchors.
    caption
        One or two sentences.
    corner
        Heading of the column of labels.
    columns
        Headings of the other columns, with units; a line break where it helps.
    groups
        The rows.
    notes
        Sentences under the table.
    """

    name: str
    caption: str
    corner: str
    columns: Sequence[str]
    groups: Sequence[Group]
    notes: Sequence[str] = field(default=())

    def __post_init__(self) -> None:
        """Every row is as long as the header."""
        for group in self.groups:
            for row in group.rows:
                if len(row.cells) != len(self.columns):
                    raise ValueError(f"{self.name}: {row.label} has {len(row.cells)} cells")

    def row(self, label: str) -> Row:
        """Return the first row of that label."""
        return next(row for group in self.groups for row in group.rows if row.label == label)

    def markdown(self) -> str:
        """Write as a GitHub table under its caption."""
        lines = [f"**{escaped(self.caption)}**", ""]
        header = [escaped(name.replace("\n", ", ")) for name in (self.corner, *self.columns)]
        lines.append("| " + " | ".join(header) + " |")
        lines.append("|---" + "|---:" * len(self.columns) + "|")
        for group in self.groups:
            if group.heading:
                lines.append(f"| *{escaped(group.heading)}*" + " | " * len(self.columns) + " |")
            for row in group.rows:
                label = f"**{escaped(row.label)}**" if row.strong else escaped(row.label)
                lines.append("| " + " | ".join((label, *map(_markdown_cell, row.cells))) + " |")
        for note in self.notes:
            lines += ["", escaped(note)]
        return "\n".join(lines) + "\n"


def _markdown_cell(cell: Cell) -> str:
    text = f"**{escaped(cell.text)}**" if cell.strong else escaped(cell.text)
    return f"{text} ({escaped(cell.detail)})" if cell.detail else text


def escaped(text: str) -> str:
    """Write text so that Markdown shows it as it is: no HTML, no markup, no table in it."""
    line = (
        " ".join(text.splitlines()).replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    )
    return re.sub(r"([\\|`*_\[\]$~])", r"\\\1", line)
