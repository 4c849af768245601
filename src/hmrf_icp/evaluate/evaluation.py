"""An evaluation from beginning to end, in the paper's order: frames, pairs, starts, results."""

from __future__ import annotations

import contextlib
import csv
import itertools
import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hmrf_icp import datasets
from hmrf_icp.errors import InputError
from hmrf_icp.evaluate import configuration as config
from hmrf_icp.evaluate import methods, peers, protocol, work
from hmrf_icp.evaluate.configuration import Configuration
from hmrf_icp.evaluate.methods import NamedMethod
from hmrf_icp.evaluate.plain import require_name
from hmrf_icp.evaluate.plan import Plan
from hmrf_icp.evaluate.progress import IN_BYTES, REGISTERING, Progress, silent
from hmrf_icp.evaluate.protocol import Pair
from hmrf_icp.evaluate.results import Results, Row
from hmrf_icp.evaluate.workers import ClusterWorkers, LocalWorkers, Lost, Workers, outcomes
from hmrf_icp.io.whole import written_whole

RESULTS, PAIRS, CONFIG = "results.csv", "pairs.csv", "config.json"

FRAMES_PER_TASK = 4
"""Source frames whose overlap a worker measures in one go."""


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
    chosen = methods.choose(configuration.methods)
    alternatives = peers.choose(configuration.peers)
    everyone = (*chosen, *extra_methods, *alternatives.methods)
    _require_different([method.name for method in everyone])
    sequence = _opened(configuration.dataset, report)
    targets = _targets(sequence, configuration.targets)
    dataset = configuration.dataset if sequence.source is None else str(sequence.source)
    complete = configuration.resolved(
        dataset,
        [method.name for method in (*chosen, *extra_methods)],
        [method.name for method in alternatives.methods],
        targets,
    )
    folder = _folder(Path(output))
    clouds = work.Clouds(f"{dataset} {os.urandom(8).hex()}", complete.subsample)

    team = LocalWorkers(workers) if scheduler is None else ClusterWorkers(scheduler)
    with _alone(folder), team:
        _claim(folder, complete, fresh)
        if not (folder / PAIRS).is_file():
            found = _find_pairs(complete, sequence, clouds, team, report)
            _write_pairs(folder / PAIRS, found)
        pairs = _read_pairs(folder / PAIRS)
        _require_frames(folder / PAIRS, pairs, {frame.index for frame in sequence.frames})
        notes = [*sequence.notes, *alternatives.skipped, *_gaps(pairs, targets)]
        for note in notes:
            if on_note is not None:
                on_note(note)
        if not pairs:
            raise InputError(
                f"{configuration.dataset}: no frame overlaps target frame "
                f"{' or '.join(map(str, targets))} by {complete.minimum_overlap:g} or more; "
                "choose another with --reference-frame"
            )
        config.write(folder / CONFIG, complete, {"notes": notes, **(about or {})})
        plan = Plan(pairs, complete.starts, complete.axes, tuple(m.name for m in everyone))
        with Results(folder / RESULTS, plan) as results:
            if on_note is not None and results.unreadable:
                on_note(_taken_out(folder / RESULTS, results.unreadable))
            _run(complete, sequence, clouds, plan, results, tuple(extra_methods), team, report)
            results.sort()
    return Evaluation(folder, len(plan), tuple(notes))


def _opened(dataset: str, report: Progress) -> datasets.Sequence:
    """Open the recording, which the first time may mean fetching it."""

    def fetching(doing: str, done: int, total: int | None) -> None:
        report(IN_BYTES.get(doing, doing), done, total)

    return datasets.open_sequence(dataset, progress=fetching)


def _run(
    configuration: Configuration,
    sequence: datasets.Sequence,
    clouds: work.Clouds,
    plan: Plan,
    results: Results,
    extra: tuple[NamedMethod, ...],
    workers: Workers,
    report: Progress,
) -> None:
    """Do what is not done, and append it as it comes."""
    frames = {frame.index: frame for frame in sequence.frames}

    def tasks() -> Iterator[work.RunTask]:
        for runs in plan.batches(results.done):
            pair = runs[0].pair
            names = {run.method for run in runs}
            yield work.RunTask(
                clouds,
                frames[pair.target],
                frames[pair.source],
                configuration.axes,
                configuration.seed,
                runs,
                tuple(method for method in extra if method.name in names),
            )

    report(REGISTERING, results.count, len(plan))
    if results.count == len(plan):
        return
    for task, rows in outcomes(workers, work.do_runs, tasks()):
        if isinstance(rows, Lost):
            rows = [Row(run, 0.0, failure=rows.reason) for run in task.runs]
        results.append(rows)
        report(REGISTERING, results.count, len(plan))


def _find_pairs(
    configuration: Configuration,
    sequence: datasets.Sequence,
    clouds: work.Clouds,
    workers: Workers,
    report: Progress,
) -> list[Pair]:
    """Measure every frame's overlap with the targets, and draw from each decile."""
    wanted = configuration.targets or ()
    targets = tuple(sequence.frame(index) for index in wanted)
    tasks = (
        work.OverlapTask(clouds, targets, sequence.frames[first : first + FRAMES_PER_TASK])
        for first in range(0, len(sequence), FRAMES_PER_TASK)
    )
    overlaps: dict[tuple[int, int], float] = {}
    done = 0
    report("Measuring overlaps", 0, len(sequence))
    for task, found in outcomes(workers, work.measure_overlaps, tasks):
        if isinstance(found, Lost):
            frame = task.sources[0].index
            raise InputError(f"{configuration.dataset}, frame {frame}: {found.reason}")
        overlaps.update(found)
        done += len(task.sources)
        report("Measuring overlaps", done, len(sequence))
    return [
        pair
        for index in wanted
        for pair in protocol.select(
            index,
            {source: share for (target, source), share in overlaps.items() if target == index},
            configuration.frames_per_decile,
            configuration.seed,
            configuration.minimum_overlap,
        ).pairs
    ]


def _targets(sequence: datasets.Sequence, wanted: tuple[int, ...] | None) -> tuple[int, ...]:
    if wanted is None:
        return protocol.spread_targets(frame.index for frame in sequence.frames)
    if len(set(wanted)) < len(wanted):
        raise InputError("reference frames: one is given twice")
    return tuple(sorted(sequence.frame(index).index for index in wanted))


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
        rows.writerow(("pair", "target", "source", "overlap"))
        rows.writerows((p.name, p.target, p.source, f"{p.overlap:.9g}") for p in pairs)


def _read_pairs(path: Path) -> tuple[Pair, ...]:
    """Read what `_write_pairs` wrote, and refuse what nothing could be registered by."""
    pairs: list[Pair] = []
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            for row in csv.DictReader(stream, strict=True):
                pair = Pair(int(row["target"]), int(row["source"]), float(row["overlap"]))
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


def _require_frames(path: Path, pairs: Sequence[Pair], frames: Collection[int]) -> None:
    """Refuse pairs of frames that the recording has not got."""
    for pair in pairs:
        if pair.target not in frames or pair.source not in frames:
            raise InputError(
                f"{path}: the pair {pair.name} is not one of the recording's frames; begin anew "
                "with --fresh"
            )


def _taken_out(path: Path, lines: Sequence[tuple[int, str]]) -> str:
    """Say which rows could not be read."""
    place, text = lines[0]
    more = f" and {len(lines) - 1} more lines" if len(lines) > 1 else ""
    return (
        f"{path}, line {place}: cannot be read: {text!r}{more}; taken out, and what is missing "
        "is done again"
    )


def _gaps(pairs: Sequence[Pair], targets: Sequence[int]) -> Iterator[str]:
    """Say which deciles of overlap have no pair."""
    for target in targets:
        covered = {protocol.decile(pair.overlap) for pair in pairs if pair.target == target}
        missing = [tenth for tenth in range(protocol.DECILES) if tenth not in covered]
        if missing:
            yield f"target frame {target}: no pair with an overlap of {_ranges(missing)}"


def _ranges(tenths: Sequence[int]) -> str:
    """Write runs of neighbouring deciles as one: [0, 1, 5] is '0 to 0.2 or 0.5 to 0.6'."""
    groups = itertools.groupby(enumerate(tenths), key=lambda item: item[1] - item[0])
    spans = [[tenth for _, tenth in group] for _, group in groups]
    return " or ".join(f"{span[0] / 10:g} to {(span[-1] + 1) / 10:g}" for span in spans)
