"""A cloud of points, with the pixel grid and the camera that it came from where they are known."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.clouds.conversion import as_camera, as_pinhole, depth_map, parts_of
from hmrf_icp.clouds.depth import in_metres
from hmrf_icp.clouds.distorted_camera import DistortedCamera
from hmrf_icp.clouds.nothing import MIXED, at_place, nothing
from hmrf_icp.clouds.per_point import Attributes, normals_for
from hmrf_icp.errors import InputError
from hmrf_icp.lazy import cached_property

Number = TypeVar("Number", bound=np.generic)

MINIMUM_POINTS = 10
"""Fewer observed points than this are refused: six unknowns and some evidence against chance."""

SAMPLE = 10_000
"""Points that are enough to tell how large a cloud is."""

LARGEST_COORDINATE = 1e12
"""A point farther away is no measurement (light takes an hour), and would drown those that are."""

SMALLEST_SIZE = 1e-30
"""A cloud that spreads over less, metres, is no measurement, and its squares have no digits left.
"""


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Points in metres; organised like an image where the sensor was one.

    Parameters
    ----------
    points
        (H, W, 3) for an organised cloud, (N, 3) for any other. A point with a
        coordinate that is not finite, or masked, is *unobserved*, and so is one at the
        viewpoint, or at a place that stands for nothing (:mod:`hmrf_icp.clouds.nothing`).
        A cloud of another library is taken with what it holds beside the points.
    camera
        The camera that the organised points were seen with, at the origin of
        the cloud's frame; its matrix K (3, 3) will do. None where it is not known.
    viewpoint
        (3,) where the sensor stood in the cloud's frame, metres; known for a
        LiDAR scan that has not been moved (the origin). A cloud with a camera
        has its viewpoint at the origin.
    normals
        Of the points' shape, in the cloud's frame; any length, NaN where there is none.
    attributes
        What else there is for each point (colours, intensities, times) by its
        name in the file, (H, W), (N,) or with one axis more. It travels along untouched.
    notes
        What was noticed about the points, a sentence each, such as a constant that stands
        for "nothing measured"; what is found is added to what is given.

    Notes
    -----
    A cloud is a value: it does not change, equal ones are equal and have the same hash, and
    copies and pickles of it are clouds like it.

    Raises
    ------
    InputError
        An array has another shape or holds no numbers, or no camera of that size.

    Examples
    --------
    >>> import numpy as np
    >>> from hmrf_icp import PinholeCamera, PointCloud
    >>> camera = PinholeCamera(width=3, height=2, fx=2.0, fy=2.0, cx=1.0, cy=0.5)
    >>> depth = np.array([[1000, 1000, 0], [1000, 2000, 2000]], dtype=np.uint16)
    >>> PointCloud.from_depth(depth, camera)
    PointCloud(organised, 2 x 3, 5 observed)
    """

    points: NDArray[np.float64]
    camera: PinholeCamera | None = None
    viewpoint: NDArray[np.float64] | None = None
    normals: NDArray[np.float64] | None = None
    attributes: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Copy the points, mark what is unobserved with NaN, and freeze the arrays."""
        points, normals, attributes = parts_of(self.points)
        lost = ~each(np.isfinite(points))
        if lost.any():
            points[lost] = np.nan
        object.__setattr__(self, "points", points)
        if self.normals is None:
            object.__setattr__(self, "normals", normals)
        if self.camera is not None:
            object.__setattr__(self, "camera", as_pinhole(self.camera, points.shape[:-1]))
            self._check_camera(self.camera)
            object.__setattr__(self, "viewpoint", np.zeros(3))
        elif self.viewpoint is not None:
            try:
                viewpoint = np.array(self.viewpoint, dtype=np.float64)
            except (TypeError, ValueError):
                viewpoint = np.empty(0)
            if viewpoint.shape != (3,) or not np.isfinite(viewpoint).all():
                raise InputError(f"viewpoint: expected three finite numbers, got {self.viewpoint}")
            object.__setattr__(self, "viewpoint", viewpoint)
        if self.viewpoint is not None:
            # No sensor sees where it stands: so recorders write beams that did not return.
            here = at_place(points, self.viewpoint)
            if here.any():
                points[here] = np.nan
            self.viewpoint.flags.writeable = False
        mask, notes = nothing(points, self.viewpoint, depth=self.camera is not None)
        if mask is not None:
            points[mask] = np.nan
        added = (note for note in notes if note not in self.notes)
        object.__setattr__(self, "notes", (*self.notes, *added))
        points.flags.writeable = False
        if self.normals is not None:
            object.__setattr__(self, "normals", normals_for(points, self.normals))
        beside = {**attributes, **self.attributes}
        object.__setattr__(self, "attributes", Attributes(beside, points.shape[:-1]))

    def _check_camera(self, camera: PinholeCamera) -> None:
        if self.points.ndim != 3:
            raise InputError("camera: given for a cloud that is not organised as (H, W, 3)")
        height, width, _ = self.points.shape
        if (camera.height, camera.width) != (height, width):
            raise InputError(
                f"camera: intrinsics are for {camera.width} x {camera.height} pixels, "
                f"the cloud has {width} x {height}"
            )

    @classmethod
    def from_depth(
        cls,
        depth: Any,
        camera: Any,
        depth_scale: float | None = None,
        max_depth: float | None = None,
    ) -> PointCloud:
        """Unproject a depth map.

        Parameters
        ----------
        depth
            (H, W), distance along the optical axis. 0, negative, NaN, infinity, what is masked
            and, in 16-bit maps, 65535 are unobserved.
        camera
            Its intrinsics, for the same size: a :class:`PinholeCamera`, a matrix K (3, 3), or
            Open3D's ``PinholeCameraIntrinsic``. The map of a :class:`DistortedCamera` is
            resampled into an ideal camera's, which may be of another size.
        depth_scale
            Units of the map per metre. None means 1000 for integers
            (millimetres, what sensors write) and 1 for floating point (metres).
        max_depth
            Depths beyond this many metres are unobserved.

        Raises
        ------
        InputError
            The map is not (H, W), has 8 bits or another size than the camera's, or the
            scale is not positive.
        """
        raw = depth_map(depth)
        lens = as_camera(camera, raw.shape)
        metres, notes = in_metres(raw, depth_scale, max_depth)
        if isinstance(lens, DistortedCamera):
            metres, lens = lens.rectified(metres)
        return cls(lens.unproject(metres), lens, notes=notes)

    @property
    def organised(self) -> bool:
        """Whether the points stand on a pixel grid, (H, W, 3)."""
        return self.points.ndim == 3

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of one value a point: (H, W) or (N,)."""
        return self.points.shape[:-1]

    @cached_property
    def observed(self) -> NDArray[np.bool_]:
        """(H, W) or (N,): where there is a point."""
        observed = ~np.isnan(self.points[..., 0])
        observed.flags.writeable = False
        return np.asarray(observed)

    @cached_property
    def _complete(self) -> bool:
        return bool(self.observed.all())

    @cached_property
    def observed_points(self) -> NDArray[np.float64]:
        """(M, 3): the observed points, in the order of the grid."""
        points = self.points.reshape(-1, 3)
        if not self._complete:
            points = points.take(np.flatnonzero(self.observed), axis=0)
            points.flags.writeable = False
        return points

    def some(self, count: int = SAMPLE) -> NDArray[np.float64]:
        """Choose about ``count`` of the observed points evenly along the cloud, (K, 3)."""
        points = self.points.reshape(-1, 3)
        if self._complete:
            return some_of(points, count)
        return points[some_of(np.flatnonzero(self.observed), count)]

    def on_grid(self, values: NDArray[Any], fill: float = np.nan) -> NDArray[Any]:
        """Lay one value an observed point, (M, ...), out in the cloud's shape."""
        laid = np.full(self.shape + values.shape[1:], fill, dtype=values.dtype)
        laid[self.observed] = values
        return laid

    def derived(
        self,
        points: NDArray[np.float64],
        viewpoint: NDArray[np.float64] | None,
        attributes: Mapping[str, NDArray[Any]] | None = None,
        camera: PinholeCamera | None = None,
        normals: NDArray[np.float64] | None = None,
    ) -> PointCloud:
        """Return a cloud of some or all of its points, moved or not; arrays are kept, not copied.

        What stands for nothing was left out before: every point that is given stays one, also
        at the viewpoint, which may be assumed.
        """
        cloud = object.__new__(PointCloud)
        for array in (points, viewpoint, normals):
            if array is not None:
                array.flags.writeable = False
        values: dict[str, Any] = {"points": points, "viewpoint": viewpoint, "notes": self.notes}
        values |= {"camera": camera, "normals": normals}
        values["attributes"] = Attributes.of(attributes or {}, points.shape[:-1])
        for name, value in values.items():
            object.__setattr__(cloud, name, value)
        return cloud

    def subsample(self, step: int, across: int | None = None) -> PointCloud:
        """Keep every ``step``-th row and column (organised) or every ``step``-th point.

        Of the columns every ``across``-th, where that is given.
        """
        across = step if across is None else across
        if min(step, across) < 1:
            raise InputError(f"subsample: expected a step of 1 or more, got {min(step, across)}")
        kept = (slice(None, None, step), slice(None, None, across))[: len(self.shape)]
        return self.derived(
            np.ascontiguousarray(self.points[kept]),
            self.viewpoint,
            {name: values[kept] for name, values in self.attributes.items()},
            None if self.camera is None else self.camera.subsampled(step, across),
            None if self.normals is None else np.ascontiguousarray(self.normals[kept]),
        )

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        if not isinstance(other, PointCloud):
            return NotImplemented
        return (
            self.camera == other.camera
            and self.notes == other.notes
            and _alike(self.points, other.points)
            and _alike(self.viewpoint, other.viewpoint)
            and _alike(self.normals, other.normals)
            and list(self.attributes) == list(other.attributes)
            and all(
                _alike(self.attributes[name], other.attributes[name]) for name in self.attributes
            )
        )

    def __hash__(self) -> int:
        # A few points tell nearly all clouds apart; 0.0 takes the sign off -0.0, which equals it.
        some = self.some(16) + 0.0
        return hash((self.shape, len(self), self.camera, some.tobytes()))

    def __reduce__(self) -> tuple[type[PointCloud], tuple[Any, ...]]:
        """Pickle and copy what it was made of: a copy is checked and frozen as it was."""
        parts = self.points, self.camera, self.viewpoint, self.normals, dict(self.attributes)
        return PointCloud, (*parts, self.notes)

    def __len__(self) -> int:
        return int(np.count_nonzero(self.observed))

    def __repr__(self) -> str:
        kind = "organised" if self.organised else "unorganised"
        size = " x ".join(str(n) for n in self.shape)
        return f"PointCloud({kind}, {size}, {len(self)} observed)"


def each(coordinates: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell for each point whether it holds of all three coordinates, (..., 3).

    ``all(axis=-1)`` says the same in five times the time.
    """
    return np.asarray(coordinates[..., 0] & coordinates[..., 1] & coordinates[..., 2])


def _alike(one: NDArray[Any] | None, other: NDArray[Any] | None) -> bool:
    """Whether both are missing, or hold the same, NaN being the same as NaN."""
    if one is None or other is None:
        return one is other
    if one.dtype != other.dtype:
        return False
    return bool(np.array_equal(one, other, equal_nan=one.dtype.kind == "f"))


class HasPoints(Protocol):
    """Anything that holds points, such as Open3D's clouds."""

    @property
    def points(self) -> Any:
        """(N, 3) or (H, W, 3), or what NumPy makes that of."""


PointCloudLike: TypeAlias = PointCloud | HasPoints | ArrayLike
"""What is taken for a cloud: one, an array of points, or anything that holds points."""


def as_cloud(cloud: Any, name: str = "cloud") -> PointCloud:
    """Take anything that holds points: a PointCloud, an array, a cloud of another library.

    Normals and colours come along where it has them, as Open3D's clouds do.

    Raises
    ------
    InputError
        Nothing of the kind, with ``name`` in the message.
    """
    if isinstance(cloud, PointCloud):
        return cloud
    try:
        return PointCloud(cloud)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def require_registrable(cloud: PointCloud, name: str) -> None:
    """Refuse a cloud that no rigid motion can be found from.

    Raises
    ------
    InputError
        Fewer than ten observed points, or than ten places at which they are, all on one line,
        one so far away that it must stand for "nothing", or all within nothing.
    """
    count = len(cloud)
    if count < MINIMUM_POINTS:
        raise InputError(
            f"{name}: {count} observed points of {math.prod(cloud.shape)}, "
            f"expected at least {MINIMUM_POINTS}"
        )
    # Of a few points first: they tell as much as all, which are gathered for a second look.
    points, few = cloud.points, cloud.some()
    size = float(max(np.fmax.reduce(points, axis=None), -np.fmin.reduce(points, axis=None)))
    if size > LARGEST_COORDINATE:
        raise InputError(
            f"{name}: a coordinate of {size:.3g}; mark points without a measurement with NaN"
        )
    if _distinct(some_of(few, 1000)) < MINIMUM_POINTS:
        places = _distinct(cloud.observed_points)
        if places == 1:
            raise InputError(f"{name}: all {count} points are the same")
        if places < MINIMUM_POINTS:
            raise InputError(
                f"{name}: {count} points at {places} places, "
                f"expected at least {MINIMUM_POINTS} places"
            )
    if not np.ptp(few, axis=0).max() > SMALLEST_SIZE:
        side = float(np.ptp(cloud.observed_points, axis=0).max())
        if not side > SMALLEST_SIZE:
            raise InputError(f"{name}: {count} points within {side:.3g} m; expected metres")
    if _dimensions(few, size) < 2:
        dimensions = _dimensions(cloud.observed_points, size)
        if dimensions == 0:
            raise InputError(f"{name}: all {count} points are the same")
        if dimensions == 1:
            raise InputError(
                f"{name}: all {count} points lie on one line, about which any rotation fits"
            )


def some_of(rows: NDArray[Number], count: int = SAMPLE) -> NDArray[Number]:
    """Choose about ``count`` of the rows, one a point (M, ...), evenly along the cloud."""
    return rows[:: max(1, len(rows) // count)]


def middle_and_spread(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Median (3,) of points (M, 3), and their median distance from it, metres."""
    middle = np.asarray(np.median(points, axis=0))
    return middle, float(np.median(np.linalg.norm(points - middle, axis=1)))


def at_most(rows: NDArray[Number], most: int) -> NDArray[Number]:
    """Choose ``most`` of the rows (M, ...) or fewer, evenly along them."""
    return rows[:: 1 + len(rows) // most]


def _distinct(points: NDArray[np.float64]) -> int:
    """Places that points (M, 3) are at, at least: one number stands for a place."""
    return len(np.unique(points @ MIXED))


def _dimensions(points: NDArray[np.float64], size: float) -> int:
    """0 where all points are the same, 1 where they are on one line, 2 otherwise."""
    offset = points - points.mean(axis=0)
    spread = np.linalg.svd(offset.T @ offset / len(points), compute_uv=False)
    if spread[0] <= (1e-9 * size) ** 2:
        return 0
    return 1 if spread[1] <= 1e-12 * spread[0] else 2
