"""A cloud with everything that registrations derive from it, each built once."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.kept import Kept

T = TypeVar("T")


class Prepared:
    """A cloud, and the k-d trees, normals and covariances that methods made of it.

    What is built here is timed, as is what the package keeps of a cloud. A run that
    finds it built already is charged the time it took (:func:`hmrf_icp.kept.timed`), so
    that the seconds of a run are those of somebody who registers two new
    clouds, however many runs shared the work.

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
        self._kept = Kept()

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
        return self._kept.get(key, build)
