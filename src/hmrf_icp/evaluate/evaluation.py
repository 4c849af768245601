"""An evaluation from beginning to end, in the paper's order: frames, pairs, starts, results."""

from __future__ import annotations

import contextlib
import csv
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hmrf_icp import datasets
from hmrf_icp.datasets import PairSet
from hmrf_icp.errors import InputError
from hmrf_icp.evaluate import configuration as config
from hmrf_icp.evaluate import forecast, methods, peers, protocol, work
from hmrf_icp.evaluate.configuration import Configuration
from hmrf_icp.evaluate.methods import NamedMethod
from hmrf_icp.evaluate.plain import require_name
from hmrf_icp.evaluate.plan import Plan
from hmrf_icp.evaluate.progress import IN_BYTES, REGISTERING, Progress, silent
from hmrf_icp.evaluate.protocol import Pair, usual_starts
from hmrf_icp.evaluate.results import Results, Row
from hmrf_icp.evaluate.sources import PairSource, source_of
from hmrf_icp.evaluate.workers import (
    TASKS_A_CORE,
    ClusterWorkers,
    LocalWorkers,
    Lost,
    Workers,
    outcomes,
)
from hmrf_icp.io.whole import written_whole

RESULTS, PAIRS, CONFIG = "results.csv", "pairs.csv", "config.json"


@dataclass(frozen=True)
class Evaluation:
    """What was evaluated, all of it done.

    Attributes
    ----------
    folder
        Holds ``results.csv``, ``pairs.csv`` and ``config.json``.
    runs
        Rows of ``results.csv``.
    notes
        What a reader should know: peers that are not installed, deciles without a pair.
    """

    folder: Path
    runs: int
    notes: tuple[str, ...]


def evaluate(
    configuration: Configuration,
    output: str | os.PathLike[str],
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    fresh: bool = False,
    extra_methods: Sequence[NamedMethod] = (),
    about: Mapping[str, Any] | None = None,
    on_progress: Progress | None = None,
    on_note: Callable[[str], None] | None = None,
) -> Evaluation:
    """Run the paper's experiment, or what is left of it.

    It may be stopped at any time, and goes on when called again with the
    same arguments: a run that is in ``results.csv`` is not done again. The rows
    do not depend on the number of workers, but for the seconds.

    Parameters
    ----------
    configuration
        What to do.
    output
        Folder for the results, made if need be.
    workers
        Processes of this machine, each held to one thread; None means one a
        core, and there are never more.
    scheduler
        Address of a Dask scheduler whose workers do it instead.
    fresh
        Remove an earlier evaluation's results first.
    extra_methods
        Your own, beside the configuration's.
    about
        More to write into ``config.json``; nothing depends on it.
    on_progress, on_note
        Told how far it is, and of what a reader should know.

    Raises
    ------
    InputError
        The data set or an argument is not what it should be; ``output`` holds
        an evaluation with another configuration, or another process writes there.
    MissingDependencyError
        joblib, or Dask for a scheduler, is not installed.
    """
    report = on_progress or silent
    tell = on_note or (lambda _: None)
    # Names before the data, which may have to be fetched.
    methods.choose(configuration.methods)
    peers.choose(configuration.peers)
    data = _opened(configuration.dataset, report)
    chosen, alternatives = _compared(configuration, data)
    everyone = (*chosen, *extra_methods, *alternatives.methods)
    _require_different([method.name for method in everyone])
    source = source_of(data, configuration)
    starts = configuration.starts or usual_starts(isinstance(data, PairSet))
    dataset = configuration.dataset if data.source is None else str(data.source)
    complete = configuration.resolved(
        dataset,
        [method.name for method in (*chosen, *extra_methods)],
        [method.name for method in alternatives.methods],
        source.targets,
        starts,
    )
    folder = _folder(Path(output))
    clouds = work.Clouds(
        f"{dataset} {os.urandom(8).hex()}", complete.subsample, complete.points_alone
    )

    team = LocalWorkers(workers) if scheduler is None else ClusterWorkers(scheduler)
    with _alone(folder), team:
        _claim(folder, complete, fresh)
        if not (folder / PAIRS).is_file():
            found = source.find(complete, clouds, team, report)
            if complete.pairs is not None:
                before = len(found)
                found = protocol.spread(found, complete.pairs, complete.seed)
                if len(found) < before:
                    tell(
                        f"{len(found):,} of {before:,} pairs, spread over scenes and overlap; "
                        f"{before - len(found):,} are left out"
                    )
            _write_pairs(folder / PAIRS, found)
        pairs = _read_pairs(folder / PAIRS)
        _require_known(folder / PAIRS, pairs, source)
        notes = [*source.notes, *alternatives.skipped, *source.gaps(pairs)]
        for note in notes:
            tell(note)
        described: dict[str, Any] = {"notes": notes, **(about or {})}
        if source.criterion:
            described["criterion"] = source.criterion
        config.write(folder / CONFIG, complete, described)
        plan = Plan(pairs, starts, complete.axes, tuple(m.name for m in everyone))
        with Results(folder / RESULTS, plan) as results:
            if results.unreadable:
                tell(_taken_out(folder / RESULTS, results.unreadable))
            if results.count < len(plan):
                tell(_forecast(plan, results.count, clouds, source, team))
                _run(complete, source, clouds, plan, results, tuple(extra_methods), team, report)
            results.sort()
    return Evaluation(folder, len(plan), tuple(notes))


def _opened(dataset: str, report: Progress) -> datasets.Sequence | PairSet:
    """Open the recording, which the first time may mean fetching it."""

    def fetching(doing: str, done: int, total: int | None) -> None:
        report(IN_BYTES.get(doing, doing), done, total)

    return datasets.open_dataset(dataset, progress=fetching)


def _compared(
    configuration: Configuration, data: datasets.Sequence | PairSet
) -> tuple[tuple[NamedMethod, ...], peers.Choice]:
    """Return the methods and the peers, the usual ones of this kind of data where nobody chose."""
    listed = isinstance(data, PairSet)
    metres = not isinstance(data, PairSet) or data.metres
    names, others = configuration.methods, configuration.peers
    if names is None:
        names = methods.usual(listed, configuration.points_alone)
    if others is None and listed:
        others = peers.FOR_PAIRS_METRES if metres else peers.FOR_PAIRS
    return methods.choose(names), peers.choose(others, metres)


def _forecast(plan: Plan, done: int, clouds: work.Clouds, source: PairSource, team: Workers) -> str:
    """Say how much is to do, and about how long it will take."""
    points = len(clouds.prepare(source.posed(plan.pairs[0]).source).points)
    workers = max(1, team.tasks_at_once() // TASKS_A_CORE)
    length = forecast.words(forecast.seconds(plan, done, points, workers))
    left = f"{len(plan) - done:,} of them to do, " if done else ""
    return (
        f"{len(plan):,} runs: {len(plan.pairs):,} pairs, {len(plan.methods)} methods; {left}"
        f"roughly {length} with {workers} worker{'' if workers == 1 else 's'}"
    )


def _run(
    configuration: Configuration,
    source: PairSource,
    clouds: work.Clouds,
    plan: Plan,
    results: Results,
    extra: tuple[NamedMethod, ...],
    workers: Workers,
    report: Progress,
) -> None:
    """Do what is not done, and append it as it comes."""

    def tasks() -> Iterator[work.RunTask]:
        for runs in plan.batches(results.done):
            posed = source.posed(runs[0].pair)
            names = {run.method for run in runs}
            yield work.RunTask(
                clouds,
                posed.target,
                posed.source,
                configuration.axes,
                configuration.seed,
                runs,
                tuple(method for method in extra if method.name in names),
                posed.criterion,
                posed.unit,
            )

    report(REGISTERING, results.count, len(plan))
    for task, rows in outcomes(workers, work.do_runs, tasks()):
        if isinstance(rows, Lost):
            right = None if task.criterion is None else False
            rows = [Row(run, 0.0, right=right, failure=rows.reason) for run in task.runs]
        results.append(rows)
        report(REGISTERING, results.count, len(plan))


def _require_different(names: Sequence[str]) -> None:
    for name in names:
        require_name(name)
    if not names:
        raise InputError("methods: none chosen, and no peer that is installed")
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(f"methods: two are called {', '.join(twice)}")


def _folder(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made: {error.strerror}") from None
    return folder


@contextlib.contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Keep a second evaluation out; the lock goes with the process, however it ends."""
    try:
        import fcntl
    except ImportError:  # Windows has none, and two evaluations are not kept apart
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise InputError(
            f"{folder}: another evaluation is writing here; wait for it or give another --output"
        ) from None
    try:
        yield
    finally:
        os.close(descriptor)


def _claim(folder: Path, configuration: Configuration, fresh: bool) -> None:
    """Write whose results these will be, and refuse a folder that another evaluation owns."""
    files = [folder / name for name in (RESULTS, PAIRS, CONFIG)]
    if fresh:
        for file in files:
            file.unlink(missing_ok=True)
    if (folder / CONFIG).exists():
        config.require_same(folder / CONFIG, configuration)
    elif any(file.exists() for file in files):
        there = ", ".join(file.name for file in files if file.exists())
        raise InputError(
            f"{folder}: has {there} but no {CONFIG} that says what made it; give another "
            "--output, or --fresh to remove it"
        )
    else:
        config.write(folder / CONFIG, configuration, {})


def _write_pairs(path: Path, pairs: Sequence[Pair]) -> None:
    with written_whole(path) as partial, partial.open("w", encoding="utf-8", newline="") as stream:
        rows = csv.writer(stream, lineterminator="\n")
        rows.writerow(("pair", "target", "source", "overlap", "scene"))
        rows.writerows((p.name, p.target, p.source, f"{p.overlap:.9g}", p.scene) for p in pairs)


def _read_pairs(path: Path) -> tuple[Pair, ...]:
    """Read what `_write_pairs` wrote, and refuse what nothing could be registered by."""
    pairs: list[Pair] = []
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            for row in csv.DictReader(stream, strict=True):
                pair = Pair(
                    int(row["target"]), int(row["source"]), float(row["overlap"]), row["scene"]
                )
                if not 0.0 < pair.overlap <= 1.0:
                    raise ValueError(f"an overlap of {row['overlap']}, expected above 0, up to 1")
                pairs.append(pair)
        if len({pair.name for pair in pairs}) < len(pairs):
            raise ValueError("a pair is there twice")
    except (KeyError, TypeError, ValueError, csv.Error) as error:
        raise InputError(
            f"{path}: not a list of pairs ({error}); begin anew with --fresh"
        ) from None
    return tuple(pairs)


def _require_known(path: Path, pairs: Sequence[Pair], source: PairSource) -> None:
    """Refuse pairs that the data set has not got."""
    for pair in pairs:
        try:
            source.posed(pair)
        except InputError:
            raise InputError(
                f"{path}: the pair {pair.name} is not one of the recording's frames; begin anew "
                "with --fresh"
            ) from None


def _taken_out(path: Path, lines: Sequence[tuple[int, str]]) -> str:
    """Say which rows could not be read."""
    place, text = lines[0]
    more = f" and {len(lines) - 1} more lines" if len(lines) > 1 else ""
    return (
        f"{path}, line {place}: cannot be read: {text!r}{more}; taken out, and what is missing "
        "is done again"
    )
