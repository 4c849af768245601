"""A progress bar on stderr while a command works on one thing."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import TYPE_CHECKING, Protocol

from hmrf_icp.cli.loudness import console, is_quiet, is_verbose, note
from hmrf_icp.cli.summary import length
from hmrf_icp.presets import Registrar

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

    from hmrf_icp.loop.icp import Iteration


COMPILING = (
    "compiling, once for this version on this machine, for a minute or so; what is said of the "
    "time leaves it out"
)


class Teller(Protocol):
    """What says that kernels are compiled."""

    def compiling(self) -> None:
        """Say so."""


class StageBar:
    """One bar, for one stage after the other."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._task = progress.add_task("", total=None, detail="")
        self._stage = ""

    def stage(self, name: str, total: int | None = None) -> None:
        """Show the name of what happens now; ``total`` steps of it, None where nobody knows."""
        # Not its reset, which takes None for "as before".
        self._progress.remove_task(self._task)
        self._task = self._progress.add_task(name, total=total, detail="")
        self._stage = name

    def note(self, words: str) -> None:
        """Say more of the stage that is on."""
        self._progress.update(self._task, description=f"{self._stage} ({words})")

    def compiling(self) -> None:
        """Say why nothing moves, also where there is no bar to say it on."""
        if self._progress.console.is_terminal:
            self.note("compiling, this once")
        else:
            note(COMPILING)

    def show(self, stage: str, done: int, total: int | None) -> None:
        """Show how much of a stage is done; give it to ``write_report`` as ``on_progress``."""
        if stage != self._stage:
            self.stage(stage, total)
        self._progress.update(self._task, completed=done, total=total)


class RegistrationBar(StageBar):
    """A bar for the stages of one registration; give it to ``register`` as ``on_iteration``."""

    def __call__(self, iteration: Iteration) -> None:
        """Show an iteration of the registration."""
        self._progress.update(
            self._task, completed=iteration.iteration, detail=_of_iteration(iteration)
        )
        if is_verbose():
            tell(iteration, self._progress.console)


def tell(iteration: Iteration, screen: Console) -> None:
    """Say a whole line of an iteration, above a bar or in a log."""
    screen.print(
        f"iteration {iteration.iteration:3d}: {_of_iteration(iteration)}, "
        f"inlier RMSE {length(iteration.inlier_rmse)}",
        markup=False,
        highlight=False,
        soft_wrap=True,
    )


def _of_iteration(iteration: Iteration) -> str:
    return (
        f"{iteration.inlier_share:4.0%} inliers, step {length(iteration.step_translation)} "
        f"{math.degrees(iteration.step_rotation):.2f} deg"
    )


@contextmanager
def told_of_compiling(bar: Teller) -> Iterator[None]:
    """Say on the bar that kernels are compiled, where they are: once on a machine."""
    from hmrf_icp.kernels.compilation import Compilation

    with Compilation(bar.compiling):
        yield


def most_iterations(method: Registrar) -> int | None:
    """Tell after how many iterations a method gives up; None where it runs more than one loop."""
    from hmrf_icp.loop.icp import Method

    return method.criteria.max_iterations if isinstance(method, Method) else None


@contextmanager
def registration_bar() -> Iterator[RegistrationBar]:
    """Show a bar for a registration while the block runs."""
    with _shown() as progress:
        yield RegistrationBar(progress)


@contextmanager
def stage_bar() -> Iterator[StageBar]:
    """Show a bar for work in stages while the block runs."""
    with _shown() as progress:
        yield StageBar(progress)


@contextmanager
def _shown() -> Iterator[Progress]:
    """Show a bar while the block runs, and nothing where stderr is not a terminal.

    It is gone at the end: what stays on the screen is the result.
    """
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    screen = console(stderr=True)
    progress = Progress(
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=24),
        TimeElapsedColumn(),
        TextColumn("{task.fields[detail]}", markup=False),
        console=screen,
        transient=True,
        # stdout belongs to the result: rich would send it to stderr while the bar is up.
        redirect_stdout=False,
    )
    # Not started at all where nobody watches: some versions of rich end even a disabled bar with
    # an empty line.
    with progress if screen.is_terminal and not is_quiet() else nullcontext():
        yield progress
