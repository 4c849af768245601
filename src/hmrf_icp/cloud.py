"""A cloud of points, with the pixel grid and the camera that it came from where they are known."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmrf_icp.camera import PinholeCamera
from hmrf_icp.errors import InputError
from hmrf_icp.per_point import Attributes, beside_points, normals_for

MINIMUM_POINTS = 10
"""Fewer observed points than this are refused: six unknowns and some evidence against chance."""

SAMPLE = 10_000
"""Points that are enough to tell how large a cloud is."""

LARGEST_COORDINATE = 1e12
"""A point farther away is no measurement (light takes an hour), and would drown those that are."""

SATURATED = 65535
"""The value that 16-bit depth recorders write for "too far", beside 0 for "nothing seen"."""


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Points in metres; organised like an image where the sensor was one.

    Parameters
    ----------
    points
        (H, W, 3) for an organised cloud, (N, 3) for any other. A point with a
        coordinate that is not finite is *unobserved*, and so is one at the viewpoint.
    camera
        The camera that the organised points were seen with, at the origin of
        the cloud's frame. None where it is not known.
    viewpoint
        (3,) where the sensor stood in the cloud's frame, metres; known for a
        LiDAR scan that has not been moved (the origin). A cloud with a camera
        has its viewpoint at the origin.
    normals
        Of the points' shape, in the cloud's frame; any length, NaN where there is none.
    attributes
        What else there is for each point (colours, intensities, times) by its
        name in the file, (H, W), (N,) or with one axis more. It travels along untouched.

    Raises
    ------
    InputError
        An array has another shape or holds no numbers, or no camera of that size.
    """

    points: NDArray[np.float64]
    camera: PinholeCamera | None = None
    viewpoint: NDArray[np.float64] | None = None
    normals: NDArray[np.float64] | None = None
    attributes: Mapping[str, NDArray[Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Copy the points, mark what is unobserved with NaN, and freeze the arrays."""
        try:
            with np.errstate(invalid="ignore", over="ignore"):  # NaN that signals, or too large
                points = np.array(self.points, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InputError(f"points: expected an array of numbers, got {error}") from None
        if points.ndim not in (2, 3) or points.shape[-1] != 3:
            raise InputError(
                f"points: expected shape (N, 3) or (H, W, 3), got {points.shape}"
                + ("; make it a cloud with PointCloud.from_depth" if points.ndim == 2 else "")
            )
        points[~each(np.isfinite(points))] = np.nan
        object.__setattr__(self, "points", points)
        if self.camera is not None:
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
            points[each(points == self.viewpoint)] = np.nan
        points.flags.writeable = False
        if self.normals is not None:
            object.__setattr__(self, "normals", normals_for(points, self.normals))
        object.__setattr__(self, "attributes", Attributes(self.attributes, points.shape[:-1]))

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
        depth: ArrayLike,
        camera: PinholeCamera,
        depth_scale: float | None = None,
        max_depth: float | None = None,
    ) -> PointCloud:
        """Unproject a depth map.

        Parameters
        ----------
        depth
            (H, W), distance along the optical axis. 0, negative, NaN, infinity
            and, in 16-bit maps, 65535 are unobserved.
        camera
            Its intrinsics, for the same size.
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
        raw = np.asarray(depth)
        if raw.ndim != 2:
            raise InputError(f"depth: expected one channel of shape (H, W), got {raw.shape}")
        if raw.dtype.kind not in "iuf":
            raise InputError(f"depth: expected integers or floating point, got {raw.dtype}")
        if raw.dtype.itemsize == 1:
            raise InputError(
                f"depth: {raw.dtype} holds 256 values, too few for a depth map; "
                "expected 16-bit integers or floating point (a colour image given by mistake?)"
            )
        if depth_scale is None:
            depth_scale = 1.0 if raw.dtype.kind == "f" else 1000.0
        if not math.isfinite(depth_scale) or depth_scale <= 0:
            raise InputError(
                f"depth_scale: expected a positive number of units per metre, got {depth_scale:g}"
            )
        if max_depth is not None and not max_depth > 0:
            raise InputError(f"max_depth: expected a positive number of metres, got {max_depth:g}")
        with np.errstate(invalid="ignore"):
            metres = raw.astype(np.float64)
        unobserved = ~(np.isfinite(metres) & (metres > 0))
        if raw.dtype == np.uint16:
            unobserved |= raw == SATURATED
        metres /= depth_scale
        if max_depth is not None:
            unobserved |= metres > max_depth
        metres[unobserved] = np.nan
        return cls(camera.unproject(metres), camera)

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
        return np.asarray(~np.isnan(self.points[..., 0]))

    @cached_property
    def observed_points(self) -> NDArray[np.float64]:
        """(M, 3): the observed points, in the order of the grid."""
        return self.points.reshape(-1, 3).take(np.flatnonzero(self.observed), axis=0)

    def on_grid(self, values: NDArray[Any], fill: float = np.nan) -> NDArray[Any]:
        """Lay one value an observed point, (M, ...), out in the cloud's shape."""
        laid = np.full(self.shape + values.shape[1:], fill, dtype=values.dtype)
        laid[self.observed] = values
        return laid

    def subsample(self, step: int) -> PointCloud:
        """Keep every ``step``-th row and column (organised) or every ``step``-th point."""
        if step < 1:
            raise InputError(f"subsample: expected a step of 1 or more, got {step}")
        kept = (slice(None, None, step),) * len(self.shape)
        return PointCloud(
            self.points[kept],
            None if self.camera is None else self.camera.subsampled(step),
            self.viewpoint,
            None if self.normals is None else self.normals[kept],
            {name: values[kept] for name, values in self.attributes.items()},
        )

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


def as_cloud(cloud: Any, name: str = "cloud") -> PointCloud:
    """Take anything that holds points: a PointCloud, an array, an object with ``.points``.

    Its ``.normals`` and ``.colors`` come along where it has them, as Open3D's clouds do.

    Raises
    ------
    InputError
        Nothing of the kind, with ``name`` in the message.
    """
    if isinstance(cloud, PointCloud):
        return cloud
    points = getattr(cloud, "points", cloud)
    try:
        array = np.asarray(points, dtype=np.float64)
        beside = {} if points is cloud or array.ndim != 2 else beside_points(cloud, len(array))
        return PointCloud(array, **beside)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{name}: expected a PointCloud, an array of points or an object with .points, "
            f"got {type(cloud).__name__} ({error})"
        ) from None


def require_registrable(cloud: PointCloud, name: str) -> None:
    """Refuse a cloud that no rigid motion can be found from.

    Raises
    ------
    InputError
        Fewer than ten observed points, all of them the same, all on one line, or
        one so far away that it must stand for "nothing".
    """
    points = cloud.observed_points
    if len(points) < MINIMUM_POINTS:
        raise InputError(
            f"{name}: {len(points)} observed points of {math.prod(cloud.shape)}, "
            f"expected at least {MINIMUM_POINTS}"
        )
    size = float(max(points.max(), -points.min()))
    if size > LARGEST_COORDINATE:
        raise InputError(
            f"{name}: a coordinate of {size:.3g}; mark points without a measurement with NaN"
        )
    # A few points off the line tell as much as all of them; only none calls for a second look.
    if _dimensions(some_of(points), size) < 2:
        dimensions = _dimensions(points, size)
        if dimensions == 0:
            raise InputError(f"{name}: all {len(points)} points are the same")
        if dimensions == 1:
            raise InputError(
                f"{name}: all {len(points)} points lie on one line, about which any rotation fits"
            )


def some_of(points: NDArray[np.float64], count: int = SAMPLE) -> NDArray[np.float64]:
    """Choose about ``count`` of the points (M, 3), evenly along the cloud."""
    return points[:: max(1, len(points) // count)]


def _dimensions(points: NDArray[np.float64], size: float) -> int:
    """0 where all points are the same, 1 where they are on one line, 2 otherwise."""
    apart = points - points.mean(axis=0)
    spread = np.linalg.svd(apart.T @ apart / len(points), compute_uv=False)
    if spread[0] <= (1e-9 * size) ** 2:
        return 0
    return 1 if spread[1] <= 1e-12 * spread[0] else 2
