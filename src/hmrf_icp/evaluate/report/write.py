"""Writing a report into the folder of its evaluation."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hmrf_icp.evaluate.progress import Progress, silent
from hmrf_icp.evaluate.report.contents import sections
from hmrf_icp.evaluate.report.page import Section, environment, render_page
from hmrf_icp.evaluate.report.published import read_paper_rows
from hmrf_icp.evaluate.report.replay import shown_runs
from hmrf_icp.evaluate.report.runs import Success
from hmrf_icp.evaluate.report.study import Study
from hmrf_icp.evaluate.report.style import Drawing
from hmrf_icp.evaluate.report.summary import summary
from hmrf_icp.evaluate.report.tables import Table, escaped
from hmrf_icp.io.whole import written_whole

WORST_RUNS = 6


@dataclass(frozen=True)
class ReportFiles:
    """What was written.

    Attributes
    ----------
    page, tables
        ``report.html`` and ``tables.md``.
    figures
        PNG and SVG files.
    summary
        The sentences at the head of the page.
    """

    page: Path
    tables: Path
    figures: tuple[Path, ...]
    summary: tuple[str, ...]


def write_report(
    folder: str | os.PathLike[str],
    success: Success | None = None,
    paper_csv: Sequence[str | os.PathLike[str]] = (),
    worst: int = WORST_RUNS,
    on_progress: Progress | None = None,
) -> ReportFiles:
    """Make the report of an evaluation from its rows, replacing an earlier one.

    Parameters
    ----------
    folder
        What ``hmrf-icp evaluate`` wrote: ``results.csv`` and, where they are
        there, ``config.json`` and ``pairs.csv``.
    success
        When a run counts as solved; 0.05 m and 0.05 rad if None.
    paper_csv
        Files of the paper's released rows, shown beside ours.
    worst
        How many of the worst runs to show, with a picture each where the data
        can be loaded.
    on_progress
        Told how far it is.

    Returns
    -------
    The files: ``report.html``, ``tables.md`` and ``figures/``.

    Raises
    ------
    InputError
        A file is missing or not what it should be.
    MissingDependencyError
        jinja2 is not installed.
    """
    environment()  # Before any work: a report that cannot be written is not worth computing.
    folder = Path(folder)
    report = on_progress or silent
    study = Study.read(folder, success, report)
    papers = [read_paper_rows(Path(path)) for path in paper_csv]
    shown, no_picture = shown_runs(study, worst, report)
    parts = sections(study, papers, shown, no_picture, report)
    said = summary(study)
    title = f"Registration on {study.dataset}"
    figures = _write_figures(folder / "figures", parts)
    page = render_page(title, said, parts, os.fspath(folder))
    for name, text in (
        ("tables.md", tables_markdown(title, said, parts)),
        ("report.html", page),
    ):
        with written_whole(folder / name) as path:
            # The folder's name may be no text.
            path.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")
    return ReportFiles(folder / "report.html", folder / "tables.md", figures, tuple(said))


def tables_markdown(title: str, said: Sequence[str], parts: Sequence[Section]) -> str:
    """Write the summary and all tables as Markdown, for a documentation page."""
    lines = [f"# {escaped(title)}", "", *(f"{escaped(sentence)}\n" for sentence in said)]
    for part in parts:
        tables = [item for item in part.items if isinstance(item, Table)]
        if not tables:
            continue
        lines += [f"## {part.title}", ""]
        if part.command:
            # No run of marks in the command may close the fence.
            fence = "`" * (3 + max(map(len, re.findall("`+", part.command)), default=0))
            lines += [f"{fence}console", f"$ {part.command}", fence, ""]
        if part.remarks:
            lines += ["Notes, and what was left out:", ""]
            lines += [*(f"- {escaped(remark)}" for remark in part.remarks), ""]
        lines += [table.markdown() for table in tables]
        # Where the data stood on one machine is nothing for a documentation page.
        facts = [(name, value) for name, value in part.facts if name != "dataset"]
        lines += [f"- {escaped(name)}: {escaped(value)}" for name, value in facts]
    return "\n".join(lines).rstrip("\n") + "\n"


def _write_figures(folder: Path, parts: Sequence[Section]) -> tuple[Path, ...]:
    folder.mkdir(exist_ok=True)
    written = []
    for part in parts:
        drawings = [item for item in part.items if isinstance(item, Drawing)]
        drawings += [shown.drawing for shown in part.worst if shown.drawing is not None]
        for drawing in drawings:
            for suffix, content in ((".png", drawing.png), (".svg", drawing.svg)):
                final = folder / f"{drawing.name}{suffix}"
                with written_whole(final) as path:
                    path.write_bytes(content)
                written.append(final)
    return tuple(written)
