"""Time and calls by stage of a registration, where a call asks for them."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import wraps
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])


@dataclass(frozen=True)
class Stage:
    """What one part of a registration took.

    Attributes
    ----------
    name
        Of the part.
    calls
        How often it ran. The same clouds give the same number on any machine.
    seconds
        Spent in it, and not in another stage that it called. Threads that work at the same
        time each count: the sum over all stages may be more than the time that passed.

    Examples
    --------
    >>> import numpy as np
    >>> import hmrf_icp
    >>> points = np.random.default_rng(0).uniform(size=(500, 3))
    >>> stages = hmrf_icp.register(points, points + 0.01, profile=True).profile
    >>> "surface" in {stage.name for stage in stages}
    True
    """

    name: str
    calls: int
    seconds: float


class Stopwatch:
    """Times of the stages of one call, from all its threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._open = threading.local()
        self._spent: dict[str, list[float]] = {}

    @contextmanager
    def measure(self, name: str) -> Iterator[None]:
        """Add the time spent within to a stage, and take it off the one around it."""
        inner: list[float] = self._open.__dict__.setdefault("inner", [])
        inner.append(0.0)
        began = time.perf_counter()
        try:
            yield
        finally:
            took = time.perf_counter() - began
            own = took - inner.pop()
            if inner:
                inner[-1] += took
            with self._lock:
                calls, seconds = self._spent.get(name, (0, 0.0))
                self._spent[name] = [calls + 1, seconds + own]

    @property
    def stages(self) -> tuple[Stage, ...]:
        """What was measured, the longest first."""
        every = [Stage(name, int(calls), spent) for name, (calls, spent) in self._spent.items()]
        return tuple(sorted(every, key=lambda stage: -stage.seconds))


_current: ContextVar[Stopwatch | None] = ContextVar("stopwatch", default=None)


def current() -> Stopwatch | None:
    """Return the watch of the call that is running, None where none is asked for."""
    return _current.get()


@contextmanager
def timed_by(watch: Stopwatch | None) -> Iterator[None]:
    """Measure the stages within."""
    token = _current.set(watch)
    try:
        yield
    finally:
        _current.reset(token)


def stage(name: str) -> Callable[[Function], Function]:
    """Make a function a stage: measured where a call asks for it, at no cost where none does."""

    def decorate(function: Function) -> Function:
        @wraps(function)
        def measured(*given: Any, **named: Any) -> Any:
            watch = _current.get()
            if watch is None:
                return function(*given, **named)
            with watch.measure(name):
                return function(*given, **named)

        return cast(Function, measured)

    return decorate
