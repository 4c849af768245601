"""The command line: ``hmrf-icp``.

Every command lives in a module of its own that imports what is heavy inside
its function, so that ``--help`` answers at once. Exit status: 0 done, 1 the
command's own no (a registration that did not converge), 2 bad input, 130
interrupted, 141 nobody reads the output any more.
"""

from __future__ import annotations

import inspect
import io
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any, TextIO

import typer
from typer.core import TyperCommand, TyperGroup

from hmrf_icp.cli.animate import animate
from hmrf_icp.cli.demo import demo
from hmrf_icp.cli.evaluate import evaluate
from hmrf_icp.cli.loudness import is_quiet, one_command
from hmrf_icp.cli.register import register
from hmrf_icp.cli.report import report
from hmrf_icp.cli.view import view
from hmrf_icp.errors import HmrfIcpError, RegistrationWarning, interruptible

BAD_INPUT = 2
INTERRUPTED = 128 + 2
NO_READER = 128 + 13


class _Command(TyperCommand):
    """A command whose help says what a value is, and not of which type of Python."""

    def get_params(self, ctx: Any) -> Any:
        """Leave the types out."""
        return _without_types(super().get_params(ctx))


class _Commands(TyperGroup):
    """Runs a command and says in one paragraph, on stderr, why it could not."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        for command in (self, *self.commands.values()):
            command.help = _flowing(command.help)

    def get_params(self, ctx: Any) -> Any:
        """Show the options for completion apart: beside others, 60 columns cut their names."""
        params = super().get_params(ctx)
        for param in params:
            if param.name in ("install_completion", "show_completion"):
                vars(param)["rich_help_panel"] = "Shell completion"
        return _without_types(params)

    def invoke(self, ctx: Any) -> Any:
        """Run the command that was asked for; its errors become an exit status.

        What is not listed here is a mistake of this program, and shows its traceback.
        """
        try:
            with one_command(), _warnings_in_one_line(), interruptible():
                outcome = super().invoke(ctx)
                sys.stdout.flush()
                return outcome
        except HmrfIcpError as error:
            _say("Error", error)
            raise typer.Exit(BAD_INPUT) from None
        except KeyboardInterrupt:
            typer.echo("Interrupted.", err=True)
            raise typer.Exit(INTERRUPTED) from None
        except BrokenPipeError:
            # Python flushes stdout once more at its end: that has to find an open descriptor.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise typer.Exit(NO_READER) from None
        except OSError as error:
            _say("Error", f"{error.filename}: {error.strerror}" if error.filename else error)
            raise typer.Exit(BAD_INPUT) from None


app = typer.Typer(
    cls=_Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)

# One line a command, in the order in which --help lists them.
app.command(cls=_Command)(demo)
app.command(cls=_Command)(register)
app.command(cls=_Command)(view)
app.command(cls=_Command)(animate)
app.command(cls=_Command)(evaluate)
app.command(cls=_Command)(report)


def main() -> None:
    """Entry point of the ``hmrf-icp`` command."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # The name of a file may be no text in this encoding; it is shown all the same.
            stream.reconfigure(errors="backslashreplace")
    app(prog_name="hmrf-icp")


def _version(wanted: bool) -> None:
    if wanted:
        from hmrf_icp import __version__

        typer.echo(f"hmrf-icp {__version__}")
        raise typer.Exit


@app.callback()
def _program(
    version: Annotated[
        bool,
        typer.Option(
            "--version", "-V", callback=_version, is_eager=True, help="Print the version."
        ),
    ] = False,
) -> None:
    """Register depth maps and point clouds that overlap only in part.

    No threshold to choose: a hidden Markov random field finds out which points
    of the source have a counterpart in the target.
    """


def _without_types(params: Any) -> Any:
    """Keep versions of Typer that would from writing ``<bool>`` and ``<list[Path]>`` into help."""
    for param in params:
        if getattr(param, "is_flag", False):
            vars(param)["metavar"] = ""
        elif param.param_type_name == "argument":
            vars(param)["display_type_rich"] = lambda ctx: ""  # noqa: ARG005
    return params


def _flowing(text: str | None) -> str | None:
    """Let each paragraph be one line, for the terminal to break where it ends."""
    if text is None:
        return None
    paragraphs = inspect.cleandoc(text).split("\n\n")
    return "\n\n".join(paragraph.replace("\n", " ") for paragraph in paragraphs)


def _say(kind: str, message: object) -> None:
    typer.echo(f"{kind}: {' '.join(str(message).splitlines())}", err=True)


@contextmanager
def _warnings_in_one_line() -> Iterator[None]:
    """Show this package's warnings without the line of code that they came from."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", RegistrationWarning)
        usual = warnings.showwarning

        def show(
            message: Warning | str,
            category: type[Warning],
            filename: str,
            lineno: int,
            file: TextIO | None = None,
            line: str | None = None,
        ) -> None:
            if issubclass(category, RegistrationWarning):
                if not is_quiet():
                    _say("Warning", message)
            else:
                usual(message, category, filename, lineno, file, line)

        warnings.showwarning = show
        yield
