"""``report.html``: one file with everything in it."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from hmrf_icp.errors import MissingDependencyError
from hmrf_icp.evaluate.report.style import Drawing
from hmrf_icp.evaluate.report.tables import Cell, Table
from hmrf_icp.evaluate.report.worst import WorstRun

if TYPE_CHECKING:
    import jinja2

WORDS = 24
"""A cell with more characters than this is a sentence, and is set like one."""


@dataclass(frozen=True)
class ShownRun:
    """One of the worst runs, with its picture where one could be made."""

    run: WorstRun
    drawing: Drawing | None


@dataclass(frozen=True)
class Section:
    """A part of the page, under a heading.

    Attributes
    ----------
    name, title
        Anchor and heading.
    paragraphs
        Text under the heading.
    command
        A command line, set apart.
    remarks
        A list.
    items
        Figures and tables, in the order of reading.
    worst
        Runs with their pictures.
    facts
        Pairs of a name and a value.
    """

    name: str
    title: str
    paragraphs: Sequence[str] = ()
    command: str = ""
    remarks: Sequence[str] = ()
    items: Sequence[Drawing | Table] = ()
    worst: Sequence[ShownRun] = ()
    facts: Sequence[tuple[str, str]] = field(default=())


def render_page(
    title: str, summary: Sequence[str], sections: Sequence[Section], folder: str
) -> str:
    """Write the page as HTML that asks nothing of any other file or server.

    Raises
    ------
    MissingDependencyError
        jinja2 is not installed.
    """
    from hmrf_icp import __version__

    template = environment().get_template("report.html.j2")
    return template.render(
        title=title, summary=summary, sections=sections, folder=folder, version=__version__
    )


def environment() -> jinja2.Environment:
    """Return the templates' environment; everything put into a template is escaped.

    Raises
    ------
    MissingDependencyError
        jinja2 is not installed.
    """
    try:
        import jinja2
    except ImportError:
        raise MissingDependencyError(
            "a report needs jinja2, which is not installed: pip install 'hmrf-icp[evaluate]'"
        ) from None
    made = jinja2.Environment(
        loader=jinja2.PackageLoader("hmrf_icp.evaluate.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
    )
    made.filters["data_uri"] = _data_uri
    made.filters["classes"] = _classes
    made.filters["unbroken"] = _unbroken
    made.tests["table"] = lambda item: isinstance(item, Table)
    return made


def _data_uri(content: bytes, kind: str) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(content).decode('ascii')}"


def _unbroken(text: str) -> str:
    """Keep the two ends of an interval on one line."""
    return text.replace("–", "\N{WORD JOINER}–\N{WORD JOINER}")


def _classes(cell: Cell) -> str:
    classes = {
        "shaded": cell.share is not None,
        "best": cell.strong,
        "words": len(cell.text) > WORDS,
    }
    return " ".join(name for name, applies in classes.items() if applies)
