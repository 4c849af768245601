"""``hmrf-icp evaluate``: the paper's experiment on a recording."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from hmrf_icp.cli import completion
from hmrf_icp.cli.loudness import Quiet, note, say
from hmrf_icp.errors import HmrfIcpError, InputError

if TYPE_CHECKING:
    from hmrf_icp.cli.evaluation_bar import EvaluationBar
    from hmrf_icp.evaluate import Configuration, Start

AXES = 16
"""About which starts are turned, as in the paper."""

QUICK_PAIRS, QUICK_AXES = 12, 1
"""Of ``--quick``."""

_PROTOCOL = "Protocol"
_MACHINES = "Machines"


def _complete_methods(incomplete: str) -> list[str]:
    """Of this package."""
    from hmrf_icp.evaluate.methods import own_methods

    return completion.listed(own_methods())(incomplete)


def _complete_peers(incomplete: str) -> list[str]:
    """Of others."""
    from hmrf_icp.evaluate.peers import FAMILIES

    return completion.listed(("none", *(family.name for family in FAMILIES)))(incomplete)


def evaluate(
    dataset: Annotated[
        str,
        typer.Argument(
            metavar="DATASET",
            show_default=False,
            help="A recording with poses: a folder (TUM RGB-D, 7-Scenes, Open3D, InfiniTAM, KITTI, "
            "clouds or fragments with poses), a benchmark (3DMatch, 3DLoMatch, Redwood fragments, "
            "pairs) or a name (synthetic, tum:freiburg1_desk).",
        ),
    ] = "synthetic",
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="DIR",
            show_default="evaluation-DATASET",
            help="Where results.csv, pairs.csv, config.json and the report go.",
        ),
    ] = None,
    methods: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAMES",
            show_default="all",
            autocompletion=_complete_methods,
            help="Of this package: hmrf, all, percent, sigma, x84, dynamic, presets, and "
            "colour, which needs clouds with colours.",
        ),
    ] = None,
    peers: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAMES",
            show_default="all that are installed and need no colours",
            autocompletion=_complete_peers,
            help="Of others: a family (gicp, o3d-plane, ...), one setting (gicp@0.1), or none.",
        ),
    ] = None,
    reference_frame: Annotated[
        list[str] | None,
        typer.Option(
            metavar="N",
            rich_help_panel=_PROTOCOL,
            show_default="two, at a quarter and three quarters",
            help="Number of a target frame, several with commas.",
        ),
    ] = None,
    frames_per_decile: Annotated[
        int,
        typer.Option(
            metavar="N", rich_help_panel=_PROTOCOL, help="Source frames from each tenth of overlap."
        ),
    ] = 5,
    minimum_overlap: Annotated[
        float,
        typer.Option(
            metavar="SHARE",
            rich_help_panel=_PROTOCOL,
            help="Leave out pairs that overlap less; those without any always are.",
        ),
    ] = 0.0,
    angles: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ANGLES",
            rich_help_panel=_PROTOCOL,
            show_default="pi/30; none for a benchmark",
            help="How far each start is turned off the true pose: pi/30, 2pi/15, 0.1, 6deg. One "
            "with a translation of its own has the metres behind a +: pi/6+0.3. With none the "
            "methods are given no start.",
        ),
    ] = None,
    axes: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            rich_help_panel=_PROTOCOL,
            show_default=f"{AXES}; {QUICK_AXES} with --quick",
            help="Random axes that starts are turned about.",
        ),
    ] = None,
    translation: Annotated[
        float,
        typer.Option(
            metavar="M", rich_help_panel=_PROTOCOL, help="How far each start is shifted as well."
        ),
    ] = 0.0,
    subsample: Annotated[
        int,
        typer.Option(
            metavar="K",
            rich_help_panel=_PROTOCOL,
            help="Keep every K-th row and column of depth maps, every K-th point of clouds.",
        ),
    ] = 1,
    points_alone: Annotated[
        bool,
        typer.Option(
            "--points-alone",
            rich_help_panel=_PROTOCOL,
            help="Hand clouds over as (N, 3), without camera, viewpoint or grid.",
        ),
    ] = False,
    benchmark: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            rich_help_panel=_PROTOCOL,
            show_default="all there are",
            help="Of several lists of pairs the one: 3DMatch, 3DLoMatch.",
        ),
    ] = None,
    pairs: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            rich_help_panel=_PROTOCOL,
            show_default=f"all; {QUICK_PAIRS} with --quick",
            help="At most so many pairs, spread over scenes and overlap.",
        ),
    ] = None,
    quick: Annotated[
        bool,
        typer.Option(
            "--quick",
            help=f"A first look: {QUICK_PAIRS} pairs, spread over scenes and overlap, from starts "
            f"about {QUICK_AXES} axis instead of {AXES}; the methods are the same. Says what it "
            "leaves out.",
        ),
    ] = False,
    seed: Annotated[
        int, typer.Option(metavar="N", rich_help_panel=_PROTOCOL, help="Of all that is drawn.")
    ] = 0,
    workers: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            rich_help_panel=_MACHINES,
            show_default="one a core",
            help="Processes of this machine, each held to one thread.",
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            rich_help_panel=_MACHINES,
            help="A Dask scheduler (tcp://host:8786) whose workers do it instead. They need this "
            "package, and the data under the same path.",
        ),
    ] = None,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Remove an earlier evaluation in DIR and begin anew.")
    ] = False,
    quiet: Quiet = False,  # noqa: ARG001
) -> None:
    """Compare registration methods on a recording, as the paper does.

    Each pair of frames is registered from starts off its true pose. It may be
    stopped at any time: the same command goes on from what is done.

    Example: hmrf-icp evaluate ./kitchen --subsample 4 --angles pi/30,pi/10,pi/6+0.3
    """
    from hmrf_icp.cli.evaluation_bar import EvaluationBar
    from hmrf_icp.cli.progress import told_of_compiling
    from hmrf_icp.evaluate import Configuration
    from hmrf_icp.evaluate import evaluate as run

    configuration = Configuration(
        dataset,
        methods=_names(methods),
        peers=_names(peers, everyone="all"),
        targets=_numbers(reference_frame),
        frames_per_decile=frames_per_decile,
        starts=_starts(angles, translation),
        axes=(QUICK_AXES if quick else AXES) if axes is None else axes,
        subsample=subsample,
        points_alone=points_alone,
        pairs=QUICK_PAIRS if quick and pairs is None else pairs,
        benchmark=benchmark or "",
        minimum_overlap=minimum_overlap,
        seed=seed,
    )
    folder = _default_output(configuration) if output is None else output
    with EvaluationBar() as bar, _stoppable(bar, folder), told_of_compiling(bar):
        if quick:
            bar.note(
                f"--quick: at most {configuration.pairs} pairs, and starts about "
                f"{configuration.axes} of {AXES} axes; too few to rank methods that are close"
            )
        done = run(
            configuration,
            folder,
            workers=workers,
            scheduler=scheduler,
            fresh=fresh,
            about={"command": _command()},
            on_progress=bar,
            on_note=bar.note,
        )
    _print_standings(done.folder)
    _report(done.folder)


def _starts(angles: list[str] | None, translation: float) -> tuple[Start, ...] | None:
    """Read the starts; None where nothing is said of them, which leaves them to the data set."""
    from hmrf_icp.evaluate.angles import parse_start

    if angles is None and translation == 0:
        return None
    return tuple(parse_start(word, translation) for word in _words(angles or ["pi/30"]))


def _words(values: list[str]) -> list[str]:
    """Split at commas what was given in one or several options."""
    return [word.strip() for value in values for word in value.split(",") if word.strip()]


def _names(values: list[str] | None, everyone: str = "") -> tuple[str, ...] | None:
    """Names; ``none`` means none of them, nothing and ``everyone`` leave the choice open."""
    if values is None:
        return None
    words = _words(values)
    if words == [everyone]:
        return None
    return () if words == ["none"] else tuple(words)


def _numbers(values: list[str] | None) -> tuple[int, ...] | None:
    if values is None:
        return None
    try:
        return tuple(int(word) for word in _words(values))
    except ValueError:
        raise InputError(
            f"--reference-frame: expected numbers of frames, got {', '.join(values)}"
        ) from None


def _default_output(configuration: Configuration) -> Path:
    path = Path(configuration.dataset)
    name = path.resolve().name if path.is_dir() else configuration.dataset
    return Path(f"evaluation-{name.replace(':', '-')}")


def _command() -> list[str]:
    """Return the command line, for whoever wants to do it again."""
    return ["hmrf-icp", *sys.argv[1:]] if "evaluate" in sys.argv[1:2] else []


@contextmanager
def _stoppable(bar: EvaluationBar, folder: Path) -> Iterator[None]:
    """Stop in order when asked to, by Ctrl-C or by a batch system, and say how to go on."""
    from hmrf_icp.evaluate.progress import REGISTERING

    def stop(number: int, frame: Any) -> NoReturn:  # noqa: ARG001
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    except KeyboardInterrupt:
        bar.note(
            f"{bar.done} of {bar.total} are done and kept in {folder}; the same command goes on "
            "from there"
            if bar.stage == REGISTERING
            else "stopped before registering; the same command begins again"
        )
        raise
    finally:
        signal.signal(signal.SIGTERM, before)


def _print_standings(folder: Path) -> None:
    """Print who solved how much."""
    from rich.markup import escape
    from rich.table import Table

    from hmrf_icp.cli.tables import show
    from hmrf_icp.evaluate import standings
    from hmrf_icp.evaluate.report.runs import ReportedStart as Named

    found = standings.standings(folder / "results.csv")
    starts = list(dict.fromkeys(start for one in found for start in one.by_start))
    table = Table(
        title=_solved_words(folder),
        title_justify="left",
    )
    table.add_column("method")
    for start in starts:
        table.add_column(Named(start.angle, start.translation).begins, justify="right")
    for heading in ("median error of those", "median time", "no pose"):
        table.add_column(heading, justify="right")
    for one in found:
        error = one.median_error_m
        table.add_row(
            escape(one.method),
            *(f"{one.by_start[start].recall:.2f}" for start in starts),
            "" if error is None else f"{1000 * error:.1f} mm",
            f"{one.median_seconds:.2f} s",
            str(one.failures or ""),
        )
    show(table)


def _solved_words(folder: Path) -> str:
    """Say what counts as solved."""
    import json

    from hmrf_icp.evaluate import standings

    own = json.loads((folder / "config.json").read_text(encoding="utf-8")).get("criterion")
    if own:
        return f"Share solved: {own}"
    return f"Share solved: within {standings.METRES:g} m and {standings.RADIANS:g} rad"


def _report(folder: Path) -> None:
    """Write the report; the results stand without it."""
    from hmrf_icp.cli.progress import stage_bar
    from hmrf_icp.evaluate.report import write_report

    try:
        with stage_bar() as bar:
            files = write_report(folder, on_progress=bar.show)
    except HmrfIcpError as error:
        note(f"no report was written: {error}")
        say(f"Results: {folder / 'results.csv'}")
        return
    say(f"Report: {files.page}")
