"""How far an evaluation is, on stderr: a bar where somebody watches, lines in a log."""

from __future__ import annotations

import time
from types import TracebackType
from typing import TYPE_CHECKING

from rich.filesize import decimal
from rich.progress import (
    BarColumn,
    DownloadColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from hmrf_icp.cli.loudness import console, is_quiet
from hmrf_icp.cli.progress import COMPILING, tell
from hmrf_icp.evaluate.progress import IN_BYTES

if TYPE_CHECKING:
    from hmrf_icp.loop.icp import Iteration

SPEED_SECONDS = 300.0
"""Time over which the speed is averaged: runs of different methods differ by a hundred times."""

LINES_A_STAGE = 10


class EvaluationBar:
    """Give it to ``evaluate`` as ``on_progress``, in a ``with`` block.

    Attributes
    ----------
    stage
        What it was last told of; empty before.
    done, total
        Of that stage.
    """

    def __init__(self) -> None:
        self.stage = ""
        self.done = 0
        self.total: int | None = 0
        self._console = console(stderr=True)
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            _AmountColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=self._console,
            disable=is_quiet() or not self._console.is_terminal,
            redirect_stdout=False,
            speed_estimate_period=SPEED_SECONDS,
        )
        self._stages: dict[str, _Stage] = {}

    def __enter__(self) -> EvaluationBar:
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._progress.stop()

    def __call__(self, stage: str, done: int, total: int | None) -> None:
        """Show that ``done`` of ``total`` are done."""
        self.stage, self.done, self.total = stage, done, total
        if stage not in self._stages:
            # What an earlier evaluation did must not count as this one's speed.
            task = self._progress.add_task(stage, total=total, completed=done)
            self._stages[stage] = _Stage(task, done)
        known = self._stages[stage]
        self._progress.update(known.task, completed=done, total=total)
        if not self._console.is_terminal and known.is_news(done, total):
            words = decimal if _in_bytes(stage) else str
            of = "" if total is None else f" of {words(total)}"
            self._console.print(
                f"{stage}: {words(done)}{of}{known.left(done, total)}", soft_wrap=True
            )

    def note(self, text: str) -> None:
        """Say something above the bar."""
        self.line(f"Note: {text}")

    def line(self, text: str) -> None:
        """Print above the bar."""
        self._console.print(text, markup=False, highlight=False, soft_wrap=True)

    def compiling(self) -> None:
        """Say why nothing moves."""
        self.note(COMPILING)

    def iteration(self, iteration: Iteration) -> None:
        """Say a line of an iteration; give it to ``register`` as ``on_iteration``."""
        tell(iteration, self._console)


def _in_bytes(stage: str) -> bool:
    return stage in IN_BYTES.values()


class _AmountColumn(ProgressColumn):
    """How much is done, of how much: in bytes or in pieces."""

    def __init__(self) -> None:
        super().__init__()
        self._bytes, self._pieces = DownloadColumn(), MofNCompleteColumn()

    def render(self, task: Task) -> Text:
        """Write it as Rich does."""
        return (self._bytes if _in_bytes(task.description) else self._pieces).render(task)


class _Stage:
    """What has been said of one stage."""

    def __init__(self, task: TaskID, already: int) -> None:
        self.task = task
        self._already = already
        self._begun = time.monotonic()
        self._said = -1

    def is_news(self, done: int, total: int | None) -> bool:
        """Whether another tenth is done; of what nobody knows the end of, whether it has begun."""
        tenth = 0 if total is None else LINES_A_STAGE * done // max(total, 1)
        if tenth == self._said:
            return False
        self._said = tenth
        return True

    def left(self, done: int, total: int | None) -> str:
        """Return the time left, in words, where there is something to judge by."""
        new = done - self._already
        if new <= 0 or total is None or done == total:
            return ""
        minutes = (time.monotonic() - self._begun) / new * (total - done) / 60
        return f", about {minutes:.0f} min left" if minutes >= 1 else ", less than a minute left"
