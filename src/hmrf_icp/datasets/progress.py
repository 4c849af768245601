"""A progress bar for people who wait for a download."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from hmrf_icp.datasets.sequence import Progress


@contextmanager
def progress_bar() -> Iterator[Progress]:
    """Show downloads on stderr: ``with progress_bar() as bar: open_sequence(name, progress=bar)``.

    Nothing is drawn before there is something to tell.
    """
    from rich import progress as rich
    from rich.console import Console

    bar = rich.Progress(
        rich.TextColumn("{task.description}"),
        rich.BarColumn(),
        rich.DownloadColumn(),
        rich.TransferSpeedColumn(),
        rich.TimeRemainingColumn(),
        console=Console(stderr=True),
    )
    tasks: dict[str, rich.TaskID] = {}

    def show(doing: str, done: int, total: int | None) -> None:
        if not tasks:
            bar.start()
        if doing not in tasks:
            tasks[doing] = bar.add_task(doing, total=total)
        bar.update(tasks[doing], completed=done, total=total)

    try:
        yield show
    finally:
        if tasks:
            bar.stop()
