"""A cloud with everything that peers derive from it, each built once and charged to every run."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.cloud import PointCloud

T = TypeVar("T")


class Prepared:
    """A cloud, and the k-d trees, normals and covariances that peers made of it.

    What is built here is timed. A run that finds it built already is charged the time
    it took (:func:`timed`), so that the seconds of a run are those of somebody who
    registers two new clouds, however many runs shared the work. The package's own
    methods are handed the bare cloud, and work everything out in each run.

    Parameters
    ----------
    cloud
        The cloud as it is registered (subsampled already).
    name
        Tells clouds apart where one remembers what it did with another; any
        hashable thing, unique among the clouds of a process.
    """

    def __init__(self, cloud: PointCloud, name: Hashable = None) -> None:
        self.cloud = cloud
        self.name = name if name is not None else object()
        self._built: dict[Hashable, tuple[Any, float]] = {}

    @property
    def points(self) -> NDArray[np.float64]:
        """(M, 3) the observed points, metres."""
        return self.cloud.observed_points

    @property
    def centroid(self) -> NDArray[np.float64]:
        """(3,) mean of the observed points, metres."""
        return self.derived("centroid", lambda: self.points.mean(axis=0))

    def derived(self, key: Hashable, build: Callable[[], T]) -> T:
        """Return what ``build`` makes of the cloud, made the first time and kept under ``key``."""
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
