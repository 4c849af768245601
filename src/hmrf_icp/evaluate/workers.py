"""Who does the work: processes of this machine, or a Dask cluster; and what if one dies."""

from __future__ import annotations

import os
import signal
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    CancelledError,
    Executor,
    Future,
    ThreadPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from types import TracebackType
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from hmrf_icp.errors import InputError, MissingDependencyError
from hmrf_icp.evaluate.work import ONE_THREAD

if TYPE_CHECKING:
    from typing_extensions import Self

CONNECTION_SECONDS = 15.0
"""How long a scheduler may take to answer."""

CORES_KNOWN_SECONDS = 5.0
"""How long a cluster's number of cores is believed; workers come and go."""

TASKS_A_CORE = 2
"""Tasks handed out a core: the next one is there when one is done, and no more wait in memory."""

RETRIES = 3
"""Times that a cluster tries a task again that raised (a file system that was busy)."""

GROWTH = 4e9
"""Bytes that a process may grow by since its first task before it counts as leaking.

Open3D's import takes 0.2 GB, and the clouds of 640 x 480 that are kept at a time, with what three
peers derived from them, 0.5 GB.
"""


class Task(Protocol):
    """Work that can be cut into pieces, to find out which of them kills a worker."""

    def split(self) -> tuple[Any, ...]:
        """Return the pieces; one for work that cannot be cut."""


T = TypeVar("T", bound=Task)
R = TypeVar("R")


@dataclass(frozen=True)
class Lost:
    """In place of a result: the worker died of this task, and of nothing else."""

    reason: str


class Workers(ABC):
    """Somewhere to run functions; use it in a ``with`` block, which ends it.

    Attributes
    ----------
    all_die_together
        Whether the death of one worker breaks the tasks of all.
    """

    all_die_together: bool

    def __init__(self) -> None:
        self._executor: Executor | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.stop(at_once=error is not None)

    @property
    def executor(self) -> Executor:
        """The executor, started when it is first asked for and after each stop."""
        if self._executor is None:
            self._executor = self._start()
        return self._executor

    def stop(self, at_once: bool) -> None:
        """Shut down; ``at_once`` without waiting for what runs."""
        executor, self._executor = self._executor, None
        if executor is not None:
            self._stop(executor, at_once)

    @abstractmethod
    def _start(self) -> Executor: ...

    @abstractmethod
    def _stop(self, executor: Any, at_once: bool) -> None: ...

    @abstractmethod
    def tasks_at_once(self) -> int:
        """How many tasks to hand out at a time."""

    @abstractmethod
    def has_died(self, error: BaseException) -> bool:
        """Whether an exception means that a worker is gone, not that its function raised."""


class LocalWorkers(Workers):
    """Processes of this machine, each held to one thread (joblib's loky).

    Parameters
    ----------
    count
        How many; None means one a core, and never more.
    """

    all_die_together = True

    def __init__(self, count: int | None = None) -> None:
        super().__init__()
        if count is not None and count < 1:
            raise InputError(f"workers: expected one or more, got {count}")
        cores: int = _loky().cpu_count()
        self.count = cores if count is None else min(count, cores)

    def _start(self) -> Executor:
        executor: Executor = _loky().ProcessPoolExecutor(
            max_workers=self.count, env=ONE_THREAD, initializer=_begin, initargs=(os.getpid(),)
        )
        return executor

    def _stop(self, executor: Any, at_once: bool) -> None:
        executor.shutdown(wait=True, kill_workers=at_once)

    def tasks_at_once(self) -> int:
        """Two a process."""
        return TASKS_A_CORE * self.count

    def has_died(self, error: BaseException) -> bool:
        """Whether the pool broke."""
        return isinstance(error, BrokenProcessPool)


def _loky() -> Any:
    try:
        from joblib.externals import loky
    except ImportError:
        raise MissingDependencyError(
            "evaluating needs joblib: pip install 'hmrf-icp[evaluate]'"
        ) from None
    return loky


def _begin(parent: int) -> None:
    """Make a process a worker, before its first task."""
    _follow(parent)
    _let_grow()


def _let_grow() -> None:
    """Let this worker keep what it has made of clouds.

    Loky ends a process that grew by 300 MB, with a warning of a leak, and has no setting for
    it; each time its imports, compiled code and clouds would be gone.
    """
    from joblib.externals.loky import process_executor

    process_executor._MAX_MEMORY_LEAK_SIZE = GROWTH


def _follow(parent: int) -> None:
    """Make this worker live as long as its parent does, and no longer."""
    # Ctrl-C reaches every process of the terminal; the parent's is the one that ends them all.
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    # A parent that was killed tells nobody, and its workers would wait for work for ever.
    threading.Thread(target=watch, daemon=True).start()


class ClusterWorkers(Workers):
    """A Dask cluster. The scheduler gives the tasks of a worker that dies to another.

    Parameters
    ----------
    address
        As ``dask scheduler`` prints it, ``tcp://host:8786``. Its workers must
        have this package, and the data under the same path.
    """

    all_die_together = False

    def __init__(self, address: str) -> None:
        super().__init__()
        self._address = address
        self._client: Any = None
        self._counted = -CORES_KNOWN_SECONDS
        self._cores = 0

    def _start(self) -> Executor:
        """Connect, and wait for a first worker.

        Raises
        ------
        InputError
            Nobody answers at the address, or no worker is connected.
        """
        try:
            import distributed
        except ImportError:
            raise MissingDependencyError(
                "a scheduler needs Dask: pip install 'hmrf-icp[cluster]'"
            ) from None
        connect: Any = distributed.Client
        try:
            _require_answer(self._address)
            self._client = connect(self._address, timeout=CONNECTION_SECONDS, set_as_default=False)
        except Exception as error:  # whatever a program that is no scheduler says
            raise InputError(
                f"scheduler: no Dask scheduler answers at {self._address} ({error}); start one "
                "with `dask scheduler` and give the address that it prints"
            ) from None
        try:
            self._client.wait_for_workers(1, timeout=CONNECTION_SECONDS)
        except (OSError, TimeoutError):
            self._client.close()
            raise InputError(
                f"scheduler: {self._address} has no workers; start some with "
                f"`dask worker {self._address} --nthreads 1`"
            ) from None
        executor: Executor = self._client.get_executor(pure=False, retries=RETRIES)
        return executor

    def _stop(self, executor: Any, at_once: bool) -> None:
        # What is not done is taken back; the cluster goes on.
        executor.shutdown(wait=not at_once)
        self._client.close()

    def tasks_at_once(self) -> int:
        """Two a core of the cluster as it is now."""
        if time.monotonic() - self._counted > CORES_KNOWN_SECONDS:
            self._cores = sum(self._client.ncores().values())
            self._counted = time.monotonic()
        return TASKS_A_CORE * max(1, self._cores)

    def has_died(self, error: BaseException) -> bool:
        """Whether the scheduler gave up on a task because each worker that had it died."""
        import distributed

        return isinstance(error, distributed.KilledWorker)


def _require_answer(address: str) -> None:
    """Shake hands once with whoever listens there.

    Dask's own client gives up after its timeout where nothing listens, and never where something
    accepts a connection and says nothing: a wrong port, a scheduler that is stopped.

    Raises
    ------
    Whatever comes of it; TimeoutError after `CONNECTION_SECONDS`.
    """
    import asyncio

    import distributed

    library: Any = distributed

    async def shake() -> None:
        arguments = library.Security().get_connection_args("client")
        meeting = library.comm.connect(address, timeout=CONNECTION_SECONDS, **arguments)
        try:
            comm = await asyncio.wait_for(meeting, CONNECTION_SECONDS)
        except asyncio.TimeoutError:
            raise TimeoutError(f"no answer within {CONNECTION_SECONDS:g} s") from None
        await comm.close()

    # In a thread of its own: this one may have an event loop already, as notebooks do.
    with ThreadPoolExecutor(1) as thread:
        thread.submit(lambda: asyncio.run(shake())).result()


def outcomes(
    workers: Workers, function: Callable[[T], R], tasks: Iterable[T]
) -> Iterator[tuple[T, R | Lost]]:
    """Yield tasks with what the function made of them, in the order in which they are done.

    Those done together come in the order of the tasks.

    Where workers die, their tasks are done again: alone, one after the other,
    if it is not known who was at fault; in pieces, if it is. A piece that kills the worker
    again is :class:`Lost`. A task that was split comes in its pieces.

    Parameters
    ----------
    workers
        Who works.
    function
        Sent to the workers: one that can be imported there.
    tasks
        Drawn as there is need.

    Raises
    ------
    Whatever the function raises.
    """
    tasks = iter(tasks)
    suspects: deque[T] = deque()
    running: dict[Future[R], T] = {}

    def hand_out() -> None:
        while True:
            executor = workers.executor
            alone = bool(suspects) and workers.all_die_together
            if len(running) >= (1 if alone else workers.tasks_at_once()):
                return
            task = suspects.popleft() if suspects else next(tasks, None)
            if task is None:
                return
            try:
                running[executor.submit(function, task)] = task
            except BrokenProcessPool:
                # A worker died since the last look; what is running will say so too.
                suspects.append(task)
                if running:
                    return
                workers.stop(at_once=True)

    while True:
        hand_out()
        if not running:
            return
        done, _ = wait(running, return_when=FIRST_COMPLETED)
        if workers.all_die_together and any(_died(workers, future) for future in done):
            done, _ = wait(running)
            # Before anything is yielded: whoever takes it may never come back.
            workers.stop(at_once=True)
        by_itself = len(running) == 1 or not workers.all_die_together
        # Those done together in the order in which they were handed out, not that of a set.
        for future in [each for each in running if each in done]:
            task, error = running.pop(future), _error(future)
            if error is None:
                yield task, future.result()
            elif not workers.has_died(error):
                raise error
            elif not by_itself:
                suspects.append(task)
            elif len(pieces := task.split()) > 1:
                suspects.extend(pieces)
            else:
                yield task, Lost(f"the worker died of it ({error})")


def _error(future: Future[Any]) -> BaseException | None:
    try:
        return future.exception()
    except CancelledError:
        return ConnectionError("the scheduler is gone; what is done is kept, start again")


def _died(workers: Workers, future: Future[Any]) -> bool:
    error = _error(future)
    return error is not None and workers.has_died(error)
