"""``hmrf-icp view``: a registration, or the runs of an evaluation, in the browser."""

from __future__ import annotations

import inspect
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hmrf_icp.cli.register import register
from hmrf_icp.errors import InputError

if TYPE_CHECKING:
    from hmrf_icp.view.server import Pages
    from hmrf_icp.view.story import Story


NOT_TAKEN = ("sources", "pairs", "table", "view")
"""What ``register`` takes for many pairs, and what is understood here."""


def view(**arguments: Any) -> None:
    """Register SOURCE to TARGET and look at it in the browser.

    Example: hmrf-icp view A.ply B.ply

    The runs of an evaluation, the worst first: hmrf-icp view RESULTS

    The address is on this machine alone; over SSH, forward its port. Ctrl-C ends it.

    Takes every option of hmrf-icp register. Exit status: as that of register.
    """
    source, target = arguments.pop("source"), arguments["target"]
    if target is not None:
        if source.is_dir():
            raise InputError(f"{source}: a folder; the viewer shows one pair, give two files")
        register([source], **arguments, view=True)
    elif not source.is_dir():
        raise InputError(
            f"{source}: no TARGET was given; expected two files, or the folder of an evaluation"
        )
    else:
        from hmrf_icp.view.evaluation import EvaluationPages

        for name, value in arguments.items():
            if name not in ("port", "quiet", "verbose") and value != _DEFAULTS[name]:
                raise InputError(
                    f"--{name.replace('_', '-')}: has no meaning for the folder of an "
                    "evaluation; leave it out"
                )
        serve(EvaluationPages(source), arguments["port"])


def _takes_what_register_takes() -> dict[str, Any]:
    """Give ``view`` one SOURCE and the options of ``register``; return their defaults."""
    signature = inspect.signature(register, eval_str=True)
    first = typer.Argument(
        metavar="SOURCE",
        show_default=False,
        help="What moves, as for register; or the --output of hmrf-icp evaluate, whose runs are "
        "listed.",
    )
    by_name = inspect.Parameter.KEYWORD_ONLY
    parameters = [inspect.Parameter("source", by_name, annotation=Annotated[Path, first])]
    parameters += [
        parameter.replace(kind=by_name)
        for name, parameter in signature.parameters.items()
        if name not in NOT_TAKEN
    ]
    view.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    view.__annotations__ = {one.name: one.annotation for one in parameters}
    return {one.name: one.default for one in parameters}


_DEFAULTS = _takes_what_register_takes()


def serve_story(story: Story, port: int, quiet: bool = False) -> None:
    """Serve the page of one story until Ctrl-C; with ``quiet``, stdout is left alone."""
    from hmrf_icp.view.page import page

    text = page(story)
    serve(lambda path: text if path == "" else None, port, quiet)


def serve(pages: Pages, port: int, quiet: bool = False) -> None:
    """Serve pages until Ctrl-C, and say where."""
    from hmrf_icp.view.server import Viewer

    with Viewer(pages, port) as viewer:
        typer.echo(f"Viewer: {viewer.address} (Ctrl-C ends it)", err=quiet)
        if "SSH_CONNECTION" in os.environ:
            here = f"{viewer.port}:127.0.0.1:{viewer.port}"
            typer.echo(f"  on your own machine first: ssh -N -L {here} THIS_MACHINE", err=quiet)
        viewer.open()
        viewer.wait()
