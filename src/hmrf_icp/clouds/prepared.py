"""A cloud with what registrations derive from it: search tree, surface, range image, fewer points.

Each is worked out when it is first asked for, and at most once. The same prepared
cloud serves as the target of many sources, or the source of many starts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmrf_icp.clouds.assumed_viewpoint import POINTS
from hmrf_icp.clouds.closest_table import ClosestTable
from hmrf_icp.clouds.cloud import (
    PointCloud,
    PointCloudLike,
    as_cloud,
    middle_and_spread,
    require_registrable,
    some_of,
)
from hmrf_icp.clouds.downsample import Downsampled, downsample
from hmrf_icp.clouds.given_normals import POINTS as SIDES
from hmrf_icp.clouds.given_normals import Sides, facing, sides
from hmrf_icp.clouds.range_image import RangeImage, range_image
from hmrf_icp.clouds.sensor_view import SensorView, find_view, given_view, place_text
from hmrf_icp.clouds.shading import Shading, shading
from hmrf_icp.clouds.surface import Surface, surface
from hmrf_icp.clouds.tree import Tree
from hmrf_icp.clouds.viewpoint import doubt
from hmrf_icp.errors import InputError
from hmrf_icp.frozen import same
from hmrf_icp.lazy import cached_property
from hmrf_icp.stages import stage

Array = NDArray[np.float64]
T = TypeVar("T")
Number = TypeVar("Number", bound=np.generic)

FAR = 10.0
"""A cloud is moved to its own centre where that is as many times its size away from the origin.

Map coordinates of millions of metres leave few digits for what a registration turns on.
"""

AROUND, GAP = 20, math.radians(110.0)
"""Neighbours of a point, and the angle that they leave free from which it is at a border."""

SPACING_SAMPLE = 2000
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
    view
        How it is known where the cloud was seen from; None to go by the cloud itself.
    look
        Whether a viewpoint is looked for where none is known.
    order
        (M,) which of the observed points each point of the cloud as given is, where they
        were laid out as an image in another order; None where the order is the same.

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
    view: SensorView | None = None
    look: bool = True
    order: NDArray[np.intp] | None = None
    _derived: dict[Hashable, Any] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def __post_init__(self) -> None:
        """Freeze the origin.

        Raises
        ------
        InputError
            It is no place.
        """
        origin = np.array(self.origin, dtype=np.float64)
        if origin.shape != (3,) or not np.isfinite(origin).all():
            raise InputError(f"origin: expected three finite numbers, got {self.origin}")
        origin.flags.writeable = False
        object.__setattr__(self, "origin", origin)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, PreparedCloud):
            return NotImplemented
        mine, theirs = ((one.cloud, one.view, one.look) for one in (self, other))
        alike = same(self.order, other.order) and np.array_equal(self.origin, other.origin)
        return alike and mine == theirs

    def __hash__(self) -> int:
        return hash((self.cloud, (self.origin + 0.0).tobytes()))

    @property
    def points(self) -> Array:
        """(M, 3) the observed points, metres."""
        return self.cloud.observed_points

    def __len__(self) -> int:
        return len(self.cloud)

    @cached_property
    def centroid(self) -> Array:
        """(3,) mean of the observed points, of some that are spread evenly over many; metres."""
        return np.asarray(self.cloud.some().mean(axis=0))

    @cached_property
    def spread(self) -> float:
        """Median distance of the observed points from their middle, of some of them; metres."""
        return middle_and_spread(self.cloud.some())[1]

    @cached_property
    def tree(self) -> Tree:
        """k-d tree of the observed points."""
        return Tree(self.points)

    @cached_property
    def surface(self) -> Surface:
        """Normals, noise and areas of the observed points."""
        fitted = surface(self.cloud, lambda: self.tree)
        if self.seen_from.sides:
            return facing(fitted, self._given_normals)
        return replace(fitted, oriented=False) if self.seen_from.kind == "assumed" else fitted

    @property
    def _given_normals(self) -> Array:
        """(M, 3) the normals that the observed points came with, NaN where they have none."""
        given = self.cloud.normals
        return np.full((len(self), 3), np.nan) if given is None else given[self.cloud.observed]

    @cached_property
    def shading(self) -> Shading:
        """How bright the observed points are, and how that changes along the surface.

        Raises
        ------
        InputError
            The cloud has no colours.
        """
        return shading(self.cloud, self.surface, self.tree)

    @cached_property
    @stage("border")
    def border(self) -> NDArray[np.bool_]:
        """(M,) Which observed points are at the border of their surface."""
        from hmrf_icp.kernels.border import find_border

        count = min(AROUND + 1, len(self))
        _, index = self.tree.query(self.points, k=count)
        border = np.empty(len(self), dtype=np.bool_)
        neighbours = np.ascontiguousarray(index[:, 1:], dtype=np.int64)
        find_border(self.points, self.surface.normals, neighbours, GAP, border)
        return border

    @cached_property
    def range_image(self) -> RangeImage | None:
        """What the sensor saw from its viewpoint, None where that is not known."""
        return range_image(self.cloud, self.surface) if self.seen_from.known else None

    @cached_property
    def image_from_origin(self) -> RangeImage | None:
        """The same from an assumed place that is the origin of the cloud's frame."""
        return range_image(self.cloud, self.surface) if self.seen_from.at_origin else None

    @cached_property
    def viewed(self) -> PreparedCloud:
        """The cloud from its viewpoint or, where that is not known, from the likeliest place."""
        if self.doubt is not None:
            return self._without_viewpoint.viewed
        if self.cloud.viewpoint is not None or not self.look:
            return self
        seen = find_view(self.cloud, lambda: self.downsampled(POINTS).surface, -self.origin)
        points, normals, order = self.cloud.points, self.cloud.normals, None
        attributes: Mapping[str, NDArray[Any]] = self.cloud.attributes
        if seen.image is not None:
            points, order, observed = seen.image.points, seen.image.order, self.cloud.observed
            attributes = {k: seen.image.lay_out(one[observed]) for k, one in attributes.items()}
            normals = None if normals is None else seen.image.lay_out(normals[observed])
        # Derived: what is observed stays so, since labels are asked of the cloud as given.
        place = np.zeros(3) if seen.camera is not None else np.array(seen.place)
        cloud = self.cloud.derived(points, place, attributes, seen.camera, normals)
        return PreparedCloud(cloud, self.origin, seen.view, order=order)

    @cached_property
    def doubt(self) -> str | None:
        """What speaks against the viewpoint that the cloud came with, in words; None if little."""
        cloud = self.cloud
        if cloud.viewpoint is None or cloud.camera is not None or self.view is not None:
            return None
        against = doubt(self.points, cloud.viewpoint)
        if against is None:
            return None
        return (
            f"{against.hidden:.0%} of the points are hidden from the viewpoint given, "
            f"{place_text(cloud.viewpoint + self.origin)}, about as many as from places beside it"
        )

    @cached_property
    def _without_viewpoint(self) -> PreparedCloud:
        cloud = self.cloud.derived(
            self.cloud.points, None, self.cloud.attributes, normals=self.cloud.normals
        )
        return PreparedCloud(cloud, self.origin)

    @cached_property
    def sides(self) -> Sides | None:
        """What the normals that it came with tell of the side seen; None where it has none."""
        if self.cloud.normals is None:
            return None
        few = self.downsampled(SIDES)
        return sides(few.surface, few._given_normals)

    @cached_property
    def sided(self) -> PreparedCloud:
        """The cloud with the sides that its normals tell, where nothing else does and they can."""
        view = self.seen_from
        if view.known or view.sides or self.sides is None or not self.sides.known:
            return self
        text = f"{view.text}; sides by its normals"
        view = replace(view, text=text, sides=True)
        return PreparedCloud(self.cloud, self.origin, view, order=self.order)

    @property
    def seen_from(self) -> SensorView:
        """How it is known where the cloud was seen from."""
        return given_view(self.cloud) if self.view is None else self.view

    @cached_property
    def neighbour_distance(self) -> float:
        """Median distance of a point to its nearest other point, metres; 0 of a single one."""
        if len(self) < 2:
            return 0.0
        distance, _ = self.tree.query(some_of(self.points, SPACING_SAMPLE), k=2)
        return float(np.median(distance[:, 1]))

    def require_registrable(self, name: str) -> None:
        """Refuse a cloud that no rigid motion can be found from; it is looked at once.

        Raises
        ------
        InputError
            As :func:`hmrf_icp.clouds.cloud.require_registrable`.
        """
        self._once("registrable", lambda: require_registrable(self.cloud, name))

    def downsampled(self, most: int) -> PreparedCloud:
        """Return about ``most`` of the points, prepared; the same cloud where it has no more."""
        return self if len(self) <= most else self._fewer(most)[0]

    def representatives(self, most: int) -> NDArray[np.intp]:
        """Tell which point of the downsampled cloud stands for each observed one of the whole.

        Returns
        -------
        (M,) rows of ``downsampled(most).points``, in the order of the cloud as it was given.
        """
        whole = len(self) <= most
        return self.as_given(np.arange(len(self)) if whole else self._fewer(most)[1].representative)

    def as_given(self, values: NDArray[Number]) -> NDArray[Number]:
        """Bring one value an observed point, (M, ...), into the order of the cloud as given."""
        return values if self.order is None else values[self.order]

    def as_here(self, values: NDArray[Number]) -> NDArray[Number]:
        """Bring one value a point, (M, ...), from the order of the cloud as given into this one."""
        if self.order is None:
            return values
        here = np.empty_like(values)
        here[self.order] = values
        return here

    def _fewer(self, most: int) -> tuple[PreparedCloud, Downsampled]:
        def build() -> tuple[PreparedCloud, Downsampled]:
            few = downsample(self.cloud, most)
            return PreparedCloud(few.cloud, self.origin, self.view, self.look), few

        return self._once(("downsampled", most), build)

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

    def __reduce__(self) -> tuple[type[PreparedCloud], tuple[Any, ...]]:
        """Pickle and copy the cloud alone: what was derived is worked out again."""
        return PreparedCloud, (self.cloud, self.origin, self.view, self.look, self.order)


@stage("checks")
def prepare(
    cloud: PreparedCloud | PointCloudLike,
    name: str = "cloud",
    viewpoint: ArrayLike | Literal["auto"] | None = "auto",
) -> PreparedCloud:
    """Prepare a cloud to be registered, once for many registrations.

    Parameters
    ----------
    cloud
        As for :func:`hmrf_icp.register`.
    name
        What an error calls it.
    viewpoint
        Where the sensor stood, for a cloud that does not say so itself: (3,) in the cloud's
        frame, metres; ``"auto"`` to recover it from the points, or the camera from the grid,
        and to assume the likeliest place where that fails; None to do without.

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
        cloud.require_registrable(name)
        return cloud
    given = as_cloud(cloud, name)
    look = isinstance(viewpoint, str)
    if isinstance(viewpoint, str):
        if viewpoint != "auto":
            raise InputError(
                f'viewpoint: expected "auto", None or three numbers, got {viewpoint!r}'
            )
    elif viewpoint is not None and given.viewpoint is None:
        given = replace(given, viewpoint=np.array(viewpoint, dtype=np.float64))
    require_registrable(given, name)
    centre, size = middle_and_spread(given.some())
    if given.camera is not None or np.linalg.norm(centre) <= FAR * size:
        return PreparedCloud(given, look=look)
    # A round number keeps the digits that coordinates of few decimals have.
    unit = 10.0 ** math.floor(math.log10(size)) if size > 0.0 else 1.0
    origin = np.round(centre / unit) * unit
    stood = None if given.viewpoint is None else given.viewpoint - origin
    cloud = given.derived(given.points - origin, stood, given.attributes, normals=given.normals)
    return PreparedCloud(cloud, origin, look=look)
