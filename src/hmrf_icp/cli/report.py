"""``hmrf-icp report``: figures, tables and a page out of an evaluation's rows."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hmrf_icp.cli.loudness import Quiet, say
from hmrf_icp.errors import InputError

if TYPE_CHECKING:
    from hmrf_icp.evaluate.report import Success


def report(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="DIR",
            show_default=False,
            help="The --output of hmrf-icp evaluate: results.csv, config.json, pairs.csv.",
        ),
    ],
    paper_csv: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE",
            show_default=False,
            help="Rows that the paper's authors released (CSV), to show their medians beside "
            "ours. May be given several times.",
        ),
    ] = None,
    success: Annotated[
        str,
        typer.Option(
            metavar="M,RAD",
            help="A run is solved when it ends within this many metres and radians.",
        ),
    ] = "0.05,0.05",
    worst: Annotated[
        int,
        typer.Option(
            min=0,
            metavar="N",
            help="How many of the worst runs to show, with a picture each where the data are "
            "still there.",
        ),
    ] = 6,
    quiet: Quiet = False,  # noqa: ARG001
) -> None:
    """Make the report of an evaluation again: figures, tables, one page.

    Writes report.html, tables.md and figures/ into DIR. Every number in them
    comes from results.csv.
    """
    from hmrf_icp.cli.progress import stage_bar
    from hmrf_icp.evaluate.report import write_report

    solved = _read_success(success)
    with stage_bar() as bar:
        files = write_report(folder, solved, paper_csv or (), worst, on_progress=bar.show)
    for sentence in files.summary:
        say(sentence)
    say(f"Report: {files.page}")


def _read_success(text: str) -> Success:
    """Read ``M,RAD``; one number holds for both.

    Raises
    ------
    InputError
        Something else.
    """
    from hmrf_icp.evaluate.report import Success

    try:
        numbers = [float(word) for word in text.split(",")]
        metres, radians = numbers * 2 if len(numbers) == 1 else numbers
    except ValueError:
        raise InputError(
            f"--success: expected metres and radians with a comma, as in 0.05,0.05, got {text!r}"
        ) from None
    return Success(metres, radians)
