"""What a worker does: measure overlaps, and do the runs of a task, one thread each.

A worker is another process, on this machine or another. It is sent frames (paths,
not pixels) and keeps what it makes of a few clouds, so that runs of the same pair share it.
"""

from __future__ import annotations

import contextlib
import os
import threading
import time
import warnings
from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from hmrf_icp import se3
from hmrf_icp.clouds.cloud import MINIMUM_POINTS, PointCloud
from hmrf_icp.datasets import Criterion, Frame
from hmrf_icp.errors import RegistrationWarning
from hmrf_icp.evaluate import methods, peers, protocol
from hmrf_icp.evaluate.methods import NamedMethod
from hmrf_icp.evaluate.plan import Run
from hmrf_icp.evaluate.prepared import Prepared, timed
from hmrf_icp.evaluate.protocol import Axes
from hmrf_icp.evaluate.results import Row

CLOUDS_KEPT = 4
"""Clouds that a worker keeps at least: a pair, the next pair's source, and one to spare."""

WARMING_POINTS = 4000
"""Points of the clouds that a method is tried on before its time is taken."""

MAX_FAILURE_LENGTH = 300

ONE_THREAD = dict.fromkeys(
    (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "BLIS_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
        "NUMEXPR_NUM_THREADS",
        "NUMBA_NUM_THREADS",
    ),
    "1",
)
"""Environment that holds libraries to one thread, if set before they are loaded."""


@dataclass(frozen=True)
class Clouds:
    """How frames become the clouds that are registered.

    Parameters
    ----------
    evaluation
        Tells evaluations apart in a worker that outlives them.
    subsample
        Step of rows and columns, or of points.
    points_alone
        Whether camera, viewpoint and grid are left out.
    """

    evaluation: str
    subsample: int
    points_alone: bool = False

    def prepared(self, frame: Frame, keep: int = CLOUDS_KEPT) -> Prepared:
        """Return the frame's cloud, read the first time and kept for a while."""
        key = (self.evaluation, self.subsample, frame.scene, frame.index)
        return _recent.get(key, lambda: self.prepare(frame), keep)

    def prepare(self, frame: Frame) -> Prepared:
        """Read the frame's cloud as it is to be registered."""
        cloud = frame.load().subsample(self.subsample)
        if self.points_alone:
            cloud = PointCloud(cloud.observed_points)
        return Prepared(cloud, (frame.scene, frame.index))


CloudKey: TypeAlias = tuple[str, int, str, int]
"""Evaluation, subsample, scene and index."""


class Recent:
    """The clouds used last, at most so many: a worker's memory does not grow with its runs."""

    def __init__(self) -> None:
        self._clouds: OrderedDict[CloudKey, Prepared] = OrderedDict()
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return len(self._clouds)

    def get(self, key: CloudKey, make: Callable[[], Prepared], keep: int) -> Prepared:
        """Return the cloud under a key, made if it is not there, and drop the oldest beyond."""
        with self._lock:
            if key not in self._clouds:
                self._clouds[key] = make()
            self._clouds.move_to_end(key)
            while len(self._clouds) > keep:
                self._clouds.popitem(last=False)
            return self._clouds[key]


_recent = Recent()


# --- overlaps ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class OverlapTask:
    """Some source frames, whose overlap with each target is wanted."""

    clouds: Clouds
    targets: tuple[Frame, ...]
    sources: tuple[Frame, ...]

    def split(self) -> tuple[OverlapTask, ...]:
        """Return tasks of one source each."""
        return tuple(OverlapTask(self.clouds, self.targets, (one,)) for one in self.sources)


def measure_overlaps(task: OverlapTask) -> dict[tuple[int, int], float]:
    """Return the overlap by the indices of target and source; 0 for a frame that is all but empty.

    Raises
    ------
    InputError
        A frame's file is missing or damaged.
    """
    hold_to_one_thread()
    keep = len(task.targets) + CLOUDS_KEPT
    overlaps = {}
    for frame in task.sources:
        source = task.clouds.prepared(frame, keep)
        enough = len(source.points) >= MINIMUM_POINTS
        near = protocol.neighbour_distance(source.points) if enough else None
        for other in task.targets:
            target = task.clouds.prepared(other, keep)
            if not enough or len(target.points) < MINIMUM_POINTS:
                overlaps[other.index, frame.index] = 0.0
                continue
            truth = protocol.true_transformation(frame.pose, other.pose)
            overlaps[other.index, frame.index] = protocol.overlap(
                source.cloud, target.cloud, truth, near
            )
    return overlaps


# --- runs -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class RunTask:
    """A few runs of one pair.

    Parameters
    ----------
    clouds, target, source
        What is registered.
    axes, seed
        Which make the directions of the starts.
    runs
        What to do.
    extra
        Methods that are neither the package's own nor one of the peers.
    criterion
        The pair's own, None where it has none.
    unit
        What a metre of a shift is in the clouds' unit.
    """

    clouds: Clouds
    target: Frame
    source: Frame
    axes: int
    seed: int
    runs: tuple[Run, ...]
    extra: tuple[NamedMethod, ...] = ()
    criterion: Criterion | None = None
    unit: float = 1.0

    def split(self) -> tuple[RunTask, ...]:
        """Return tasks of one run each."""
        return tuple(replace(self, runs=(run,)) for run in self.runs)


def do_runs(task: RunTask) -> list[Row]:
    """Do the runs of a task; a method that raises makes a row that says so."""
    hold_to_one_thread()
    source, target = (task.clouds.prepared(frame) for frame in (task.source, task.target))
    truth = protocol.true_transformation(task.source.pose, task.target.pose)
    axes = Axes.random(task.axes, task.seed)
    known = _catalogue() | {method.name: method for method in task.extra}
    return [_row(task, run, known[run.method], source, target, truth, axes) for run in task.runs]


def _catalogue() -> dict[str, NamedMethod]:
    return {**methods.own_methods(), **peers.catalogue()}


def _row(
    task: RunTask,
    run: Run,
    method: NamedMethod,
    source: Prepared,
    target: Prepared,
    truth: protocol.Array,
    axes: Axes,
) -> Row:
    begun = time.perf_counter()
    try:
        init = None
        if run.start.given:
            start = replace(run.start, translation=run.start.translation * task.unit)
            init = protocol.perturbed(truth, source.centroid, axes, run.axis, start)
        _warm(method, source, target, init)
        begun = time.perf_counter()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RegistrationWarning)
            outcome, seconds = timed(lambda: method.register(source, target, init))
        pose = se3.as_rigid(outcome.transformation, "its pose")
    except Exception as error:
        failure = f"{type(error).__name__}: {error}"[:MAX_FAILURE_LENGTH]
        right = None if task.criterion is None else False
        seconds = time.perf_counter() - begun
        return Row(run, seconds=seconds, right=right, failure=failure)
    error_m, error_rad = se3.error(pose, truth)
    right = None
    if task.criterion is not None:
        right = task.criterion.right(pose, truth, source.centroid)
    return Row(
        run,
        seconds,
        error_m,
        error_rad,
        right,
        outcome.iterations,
        outcome.em_iterations,
        outcome.converged,
        outcome.confidence,
        outcome.fitness,
    )


# --- one thread, and warm ---------------------------------------------------------------------


def hold_to_one_thread() -> None:
    """Set what libraries read when they are loaded, and Numba's count, which may change later."""
    os.environ.update(ONE_THREAD)
    import numba

    numba.set_num_threads(1)


_warm_families: set[str] = set()
_warming = threading.Lock()


def _warm(
    method: NamedMethod, source: Prepared, target: Prepared, init: protocol.Array | None
) -> None:
    """Let a method import, compile and start up on small clouds before its time is taken.

    Libraries that look for the number of cores (TBB, in Open3D and
    KISS-Matcher) do it then, and are shown one.
    """
    with _warming:
        if method.family in _warm_families:
            return
        _warm_families.add(method.family)
        few, fewer = (
            Prepared(p.cloud.subsample(_step(p)), ("small", p.name)) for p in (source, target)
        )
        with one_core(), warnings.catch_warnings(), contextlib.suppress(Exception):
            warnings.simplefilter("ignore")
            method.register(few, fewer, init)


def _step(cloud: Prepared) -> int:
    share = max(1.0, len(cloud.points) / WARMING_POINTS)
    return int(np.ceil(np.sqrt(share) if cloud.cloud.organised else share))


@contextlib.contextmanager
def one_core() -> Iterator[None]:
    """Let this process see one core for a moment."""
    if not hasattr(os, "sched_setaffinity"):  # macOS and Windows have no such thing
        yield
        return
    # The thread, and the process as a whole, which is what TBB looks at.
    who = (0, os.getpid())
    before = [os.sched_getaffinity(one) for one in who]
    cores = sorted(before[0])
    try:
        for one in who:
            os.sched_setaffinity(one, {cores[os.getpid() % len(cores)]})
        yield
    finally:
        for one, mask in zip(who, before, strict=True):
            os.sched_setaffinity(one, mask)
