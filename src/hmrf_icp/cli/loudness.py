"""How much a command says: ``--quiet``, as usual, ``--verbose``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from enum import Enum
from typing import TYPE_CHECKING, Annotated

import typer

from hmrf_icp.errors import InputError

if TYPE_CHECKING:
    from rich.console import Console


class Loudness(Enum):
    """How much is said beside errors and ``--json``."""

    QUIET = 0
    USUAL = 1
    VERBOSE = 2


_loudness = ContextVar("loudness", default=Loudness.USUAL)


@contextmanager
def one_command() -> Iterator[None]:
    """Begin as usual, and forget in the end what the options of this command said."""
    token = _loudness.set(Loudness.USUAL)
    try:
        yield
    finally:
        _loudness.reset(token)


def is_quiet() -> bool:
    """Whether nothing is to be said but errors, and the JSON that was asked for."""
    return _loudness.get() is Loudness.QUIET


def is_verbose() -> bool:
    """Whether to say what happens as it happens."""
    return _loudness.get() is Loudness.VERBOSE


def say(text: str, err: bool = False) -> None:
    """Print what is for people, unless they want quiet."""
    if not is_quiet():
        typer.echo(text, err=err)


def note(message: str) -> None:
    """Say on stderr what a reader should know and need not act upon."""
    say(f"Note: {message}", err=True)


def console(stderr: bool = False) -> Console:
    """Return a console for people: mute where they want quiet."""
    from rich.console import Console

    return Console(stderr=stderr, quiet=is_quiet(), highlight=False)


def _sets(loudness: Loudness) -> Callable[[bool], bool]:
    def chosen(wanted: bool) -> bool:
        if wanted:
            if _loudness.get() not in (Loudness.USUAL, loudness):
                raise InputError("--quiet and --verbose: give one of them, not both")
            _loudness.set(loudness)
        return wanted

    return chosen


Quiet = Annotated[
    bool,
    typer.Option(
        "--quiet", "-q", callback=_sets(Loudness.QUIET), help="Say nothing but what goes wrong."
    ),
]
"""The option of every command."""

Verbose = Annotated[
    bool,
    typer.Option(
        "--verbose",
        "-v",
        callback=_sets(Loudness.VERBOSE),
        help="Say each iteration as it happens, on stderr, and how long each stage took.",
    ),
]
"""The option of commands that register."""
