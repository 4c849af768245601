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


def view(**arguments: Any) -> None:
    """Register SOURCE to TARGET and look at it in the browser.

    Example: hmrf-icp view A.ply B.ply

    The runs of an evaluation, the worst first: hmrf-icp view RESULTS

    The address is on this machine alone; over SSH, forward its port. Ctrl-C ends it.

    Takes every option of hmrf-icp register. Exit status: as that of register.
    """
    source, target = arguments["source"], arguments["target"]
    if target is not None:
        register(**arguments, view=True)
    elif not source.is_dir():
        raise InputError(
            f"{source}: no TARGET was given; expected two files, or the folder of an evaluation"
        )
    else:
        from hmrf_icp.view.evaluation import EvaluationPages

        other = [name for name, value in arguments.items() if value != _DEFAULTS.get(name)]
        if set(other) - {"source", "port"}:
            raise InputError(
                f"--{min(set(other) - {'source', 'port'}).replace('_', '-')}: has no meaning for "
                "the folder of an evaluation; leave it out"
            )
        serve(EvaluationPages(source), arguments["port"])


def _takes_what_register_takes() -> dict[str, Any]:
    """Give ``view`` the arguments of ``register``, TARGET left to choose; return the defaults."""
    signature = inspect.signature(register, eval_str=True)
    words = {
        "source": "What moves, as for register; or the --output of hmrf-icp evaluate, whose runs "
        "are listed.",
        "target": "What stays.",
    }
    parameters = []
    for name, parameter in signature.parameters.items():
        if name in words:
            metavar = f"{name.upper()}"
            argument = typer.Argument(metavar=metavar, show_default=False, help=words[name])
            kind: Any = Path if name == "source" else Path | None
            parameter = parameter.replace(annotation=Annotated[kind, argument])
            if name == "target":
                parameter = parameter.replace(default=None)
        if name != "view":
            # By name: what has no default may not follow what has.
            parameters.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY))
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
