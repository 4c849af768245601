"""What is worked out once and kept, and the time that it took.

A surface, a range image or a search tree depends on one cloud alone. It is built
when it is first asked for, and lives as long as the cloud does.
"""

from __future__ import annotations

import threading
import time
import weakref
from collections.abc import Callable, Hashable
from typing import TYPE_CHECKING, Any, TypeVar, cast

if TYPE_CHECKING:
    from hmrf_icp.clouds.cloud import PointCloud

T = TypeVar("T")


class Kept:
    """Values by key, each built the first time."""

    def __init__(self) -> None:
        self._built: dict[Hashable, tuple[Any, float]] = {}

    def get(self, key: Hashable, build: Callable[[], T]) -> T:
        """Return what ``build`` makes, made the first time and kept under ``key``."""
        if key in self._built:
            value, seconds = self._built[key]
            _spare(seconds)
            return cast(T, value)
        before = _spared()
        begun = time.perf_counter()
        made = build()
        # What was spared meanwhile was a part of it, and is spared by the next one too.
        self._built[key] = (made, time.perf_counter() - begun + _spared() - before)
        return made


_OF_CLOUDS: weakref.WeakKeyDictionary[PointCloud, Kept] = weakref.WeakKeyDictionary()


def once(cloud: PointCloud, key: Hashable, build: Callable[[], T]) -> T:
    """Return what ``build`` makes of a cloud, made once and gone with the cloud.

    What it makes must not hold the cloud, which would then never go.
    """
    kept = _OF_CLOUDS.get(cloud)
    if kept is None:
        kept = _OF_CLOUDS[cloud] = Kept()
    return kept.get(key, build)


_thread = threading.local()


def _spared() -> float:
    return float(getattr(_thread, "seconds", 0.0))


def _spare(seconds: float) -> None:
    _thread.seconds = _spared() + seconds


def timed(run: Callable[[], T]) -> tuple[T, float]:
    """Call ``run``; return what it returned and the seconds it takes with nothing kept.

    What was found built already counts with the time that building it took: the seconds
    are those of somebody who has two new clouds.
    """
    before = _spared()
    begun = time.perf_counter()
    value = run()
    return value, time.perf_counter() - begun + _spared() - before
