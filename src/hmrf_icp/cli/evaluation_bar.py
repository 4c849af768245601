"""How far an evaluation is, on stderr: a bar where somebody watches, lines in a log."""

from __future__ import annotations

import time
from types import TracebackType

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

SPEED_SECONDS = 300.0
"""Time over which the speed is averaged: runs of different methods differ by a hundred times."""

LINES_A_STAGE = 10


class EvaluationBar:
    """Give it to ``evaluate`` as ``on_progress``, in a ``with`` block.

    Attributes
    ----------
    done, total
        Of the stage that it was last told of.
    """

    def __init__(self) -> None:
        self.done = self.total = 0
        self._console = Console(stderr=True)
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=self._console,
            disable=not self._console.is_terminal,
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

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Show that ``done`` of ``total`` are done."""
        self.done, self.total = done, total
        if stage not in self._stages:
            # What an earlier evaluation did must not count as this one's speed.
            task = self._progress.add_task(stage, total=total, completed=done)
            self._stages[stage] = _Stage(task, done)
        known = self._stages[stage]
        self._progress.update(known.task, completed=done, total=total)
        if not self._console.is_terminal and known.is_news(done, total):
            self._console.print(
                f"{stage}: {done} of {total}{known.left(done, total)}", soft_wrap=True
            )

    def note(self, text: str) -> None:
        """Say something above the bar."""
        self._console.print(f"Note: {text}", markup=False, highlight=False, soft_wrap=True)


class _Stage:
    """What has been said of one stage."""

    def __init__(self, task: TaskID, already: int) -> None:
        self.task = task
        self._already = already
        self._begun = time.monotonic()
        self._said = -1

    def is_news(self, done: int, total: int) -> bool:
        """Whether another tenth is done."""
        tenth = LINES_A_STAGE * done // max(total, 1)
        if tenth == self._said:
            return False
        self._said = tenth
        return True

    def left(self, done: int, total: int) -> str:
        """Return the time left, in words, where there is something to judge by."""
        new = done - self._already
        if new <= 0 or done == total:
            return ""
        minutes = (time.monotonic() - self._begun) / new * (total - done) / 60
        return f", about {minutes:.0f} min left" if minutes >= 1 else ", less than a minute left"
