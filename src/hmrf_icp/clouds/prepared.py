"""A cloud with what registrations derive from it: search tree, surface, range image, fewer points.

Each is worked out when it is first asked for, and at most once. The same prepared
cloud serves as the target of many sources, or the source of many starts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds import downsample
from hmrf_icp.clouds.closest_table import ClosestTable
from hmrf_icp.clouds.cloud import PointCloud, PointCloudLike, as_cloud, require_registrable, some_of
from hmrf_icp.clouds.range_image import RangeImage, range_image
from hmrf_icp.clouds.surface import Surface, surface

if TYPE_CHECKING:
    from pykdtree.kdtree import KDTree

Array = NDArray[np.float64]
T = TypeVar("T")

FAR = 10.0
"""A cloud is moved to its own centre where that is as many times its size away from the origin.

Map coordinates of millions of metres leave few digits for what a registration turns on.
"""

SPACING_SAMPLE = 10_000
"""Points whose nearest neighbour is looked for to tell how far apart a cloud's points are."""


@dataclass(frozen=True, eq=False)
class PreparedCloud:
    """A cloud that remembers what was derived from it.

    Parameters
    ----------
    cloud
        The points, metres. It is never changed, and neither is what is derived from it.
    origin
        (3,) where the origin of this cloud stands in the frame that it was given in, metres:
        other than zero where the coordinates were far from zero.

    Examples
    --------
    >>> import numpy as np
    >>> from hmrf_icp import PointCloud, prepare
    >>> prepared = prepare(PointCloud(np.random.default_rng(0).normal(size=(100, 3))))
    >>> prepared.tree is prepared.tree
    True
    """

    cloud: PointCloud
    origin: Array = field(default_factory=lambda: np.zeros(3))
    _derived: dict[Hashable, Any] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @property
    def points(self) -> Array:
        """(M, 3) the observed points, metres."""
        return self.cloud.observed_points

    def __len__(self) -> int:
        return len(self.points)

    @cached_property
    def tree(self) -> KDTree:
        """k-d tree of the observed points."""
        from pykdtree.kdtree import KDTree

        return KDTree(self.points)

    @cached_property
    def surface(self) -> Surface:
        """Normals, noise and areas of the observed points."""
        return surface(self.cloud, lambda: self.tree)

    @cached_property
    def range_image(self) -> RangeImage | None:
        """What the sensor saw from its viewpoint, None where that is not known."""
        return range_image(self.cloud, self.surface) if self.cloud.viewpoint is not None else None

    @cached_property
    def neighbour_distance(self) -> float:
        """Median distance of a point to its nearest other point, metres; 0 of a single one."""
        if len(self) < 2:
            return 0.0
        some = np.ascontiguousarray(some_of(self.points, SPACING_SAMPLE))
        distance, _ = self.tree.query(some, k=2)
        return float(np.median(distance[:, 1]))

    def downsampled(self, most: int) -> PreparedCloud:
        """Return about ``most`` of the points, prepared; the same cloud where it has no more."""
        step = downsample.step(self.cloud, most)
        if step <= 1:
            return self
        key = ("downsampled", step if self.cloud.organised else most)
        return self._once(key, lambda: PreparedCloud(downsample.downsample(self.cloud, most)))

    def representatives(self, most: int) -> NDArray[np.intp]:
        """Tell which point of the downsampled cloud stands for each observed one of the whole.

        Returns
        -------
        (M,) rows of ``downsampled(most).points``.
        """
        few = self.downsampled(most)
        if few is self:
            return np.arange(len(self))
        return downsample.representatives(self.cloud, few.cloud, lambda: few.tree)

    def closest_table(self, count: int, cells: int, margin: int) -> ClosestTable:
        """Return a table of space that knows the closest of about ``count`` of the points."""
        return self._once(
            ("closest", count, cells, margin),
            lambda: ClosestTable.of(self.surface, count, cells, margin),
        )

    def _once(self, key: Hashable, build: Callable[[], T]) -> T:
        if key not in self._derived:
            self._derived[key] = build()
        return cast(T, self._derived[key])

    def __reduce__(self) -> tuple[type[PreparedCloud], tuple[PointCloud, Array]]:
        """Pickle and copy the cloud alone: what was derived is worked out again."""
        return PreparedCloud, (self.cloud, self.origin)


def prepare(cloud: PreparedCloud | PointCloudLike, name: str = "cloud") -> PreparedCloud:
    """Prepare a cloud to be registered, once for many registrations.

    Parameters
    ----------
    cloud
        As for :func:`hmrf_icp.register`.
    name
        What an error calls it.

    Raises
    ------
    InputError
        It holds no points, or too few to register.

    Examples
    --------
    >>> import numpy as np
    >>> from hmrf_icp import prepare
    >>> len(prepare(np.random.default_rng(0).normal(size=(100, 3))))
    100
    """
    if isinstance(cloud, PreparedCloud):
        return cloud
    given = as_cloud(cloud, name)
    require_registrable(given, name)
    some = some_of(given.observed_points)
    centre = np.median(some, axis=0)
    size = float(np.median(np.linalg.norm(some - centre, axis=1)))
    if given.camera is not None or np.linalg.norm(centre) <= FAR * size:
        return PreparedCloud(given)
    # A round number keeps the digits that coordinates of few decimals have.
    unit = 10.0 ** math.floor(math.log10(size)) if size > 0.0 else 1.0
    origin = np.round(centre / unit) * unit
    viewpoint = None if given.viewpoint is None else given.viewpoint - origin
    return PreparedCloud(PointCloud(given.points - origin, None, viewpoint), origin)
