"""How many threads a call uses, and none of them after it.

The search trees come with OpenMP. A pool that it has once started stays with the process,
and a process that forks afterwards (``multiprocessing`` on Linux up to Python 3.13) leaves
its child with a pool without threads, in which the first question hangs for ever. So each
question here is asked with one OpenMP thread, which starts no pool, and large ones are cut
into pieces for Python threads that live as long as the call. Each point is looked for by
itself: the digits are the same with any number of threads.
"""

from __future__ import annotations

import ctypes
import operator
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from itertools import pairwise
from typing import Any, TypeVar

from hmrf_icp import stages
from hmrf_icp.errors import InputError

T = TypeVar("T")
R = TypeVar("R")


class Workers:
    """Threads of one call, started when there is something for them to do.

    Parameters
    ----------
    count
        Threads at most.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self._process = os.getpid()
        self._pool: ThreadPoolExecutor | None = None

    def map(self, function: Callable[[T], R], pieces: Sequence[T]) -> list[R]:
        """Apply a function that lets go of the interpreter to every piece, in order."""
        # A process forked in the middle of the call has none of its threads.
        if self.count == 1 or len(pieces) < 2 or os.getpid() != self._process:
            return [function(piece) for piece in pieces]
        if self._pool is None:
            self._pool = ThreadPoolExecutor(self.count, "hmrf-icp")
        watch = stages.current()

        def watched(piece: T) -> R:
            with stages.timed_by(watch):
                return function(piece)

        return list(self._pool.map(watched, pieces))

    def end(self) -> None:
        """Wait for the threads to end."""
        if self._pool is not None and os.getpid() == self._process:
            self._pool.shutdown(cancel_futures=True)
        self._pool = None

    def over(self, function: Callable[[Any], Any], rows: Any, least: int = 1) -> list[Any]:
        """Apply a function to a few long pieces of ``rows``, of ``least`` rows or more each.

        Parameters
        ----------
        function
            Whose answer for a piece are the answers for its rows: where the cuts are makes no
            difference to them.
        rows
            An array or a sequence.
        """
        count = max(1, min(2 * self.count, len(rows) // least)) if self.count > 1 else 1
        ends = [len(rows) * k // count for k in range(count + 1)]
        return self.map(function, [rows[a:b] for a, b in pairwise(ends)])


_ONE = Workers(1)
_current: ContextVar[Workers] = ContextVar("workers", default=_ONE)


def current() -> Workers:
    """Return the threads of the call that is running; outside of any, its own thread alone."""
    return _current.get()


@contextmanager
def using(num_threads: int | None) -> Iterator[None]:
    """Use so many threads within, and end them after.

    Parameters
    ----------
    num_threads
        Threads, None for :func:`most`; never more than that.

    Raises
    ------
    InputError
        Not a number of 1 or more.
    """
    workers = Workers(checked(num_threads))
    token = _current.set(workers)
    try:
        yield
    finally:
        _current.reset(token)
        workers.end()


def checked(num_threads: int | None) -> int:
    """Return how many threads are meant.

    Raises
    ------
    InputError
        Not a number of 1 or more.
    """
    if num_threads is None:
        return most()
    try:
        count = operator.index(num_threads)
    except TypeError:
        count = 0
    if count < 1:
        raise InputError(
            "num_threads: expected a number of threads of 1 or more, or None for all cores that "
            f"this process may use, got {num_threads!r}"
        )
    return min(count, most())


def most() -> int:
    """Cores that this process may use; fewer where ``OMP_NUM_THREADS`` says so."""
    if sys.version_info >= (3, 13):
        cores = os.process_cpu_count() or 1
    elif hasattr(os, "sched_getaffinity"):
        cores = len(os.sched_getaffinity(0))
    else:
        cores = os.cpu_count() or 1
    openmp = _openmp()
    return cores if openmp is None else max(1, min(cores, openmp.omp_get_max_threads()))


@contextmanager
def one_openmp_thread() -> Iterator[None]:
    """Let this thread's OpenMP loops run in it alone, as it was before afterwards."""
    openmp = _openmp()
    if openmp is None:
        yield
        return
    before = openmp.omp_get_max_threads()
    openmp.omp_set_num_threads(1)
    try:
        yield
    finally:
        openmp.omp_set_num_threads(before)


@cache
def _openmp() -> Any:
    """Return the OpenMP that the search trees are linked to, None where there is none."""
    import pykdtree.kdtree

    # A symbol is looked for in what a library depends on too, but on Windows, where nothing forks.
    for library in (pykdtree.kdtree.__file__, "vcomp140.dll"):
        try:
            found = ctypes.CDLL(library)
            found.omp_get_max_threads.restype = ctypes.c_int
            found.omp_set_num_threads.argtypes = [ctypes.c_int]
            found.omp_set_num_threads.restype = None
        except (OSError, AttributeError):
            continue
        return found
    return None
