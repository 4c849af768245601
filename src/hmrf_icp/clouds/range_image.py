"""What a sensor saw from where it stood: a range image, and where it looked in vain.

A depth map knows more than its points. A point in front of what was seen on
its ray stands in space that the sensor looked through; a point behind it is
hidden; a point beside the image cannot have been seen. A LiDAR scan knows the
same through a range image about the sensor's place.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.surface import Surface
from hmrf_icp.errors import InputError
from hmrf_icp.stages import stage

Array = NDArray[np.float64]

PINHOLE, SPHERE = 0, 1
"""Kinds of projection."""

BAND = 4.0
"""Depths agree within this many standard deviations of the noise."""


@dataclass(frozen=True, eq=False)
class RangeImage:
    """A range image; rows of ``row`` are those of the cloud's observed points.

    Attributes
    ----------
    projection
        (17,) kind, four numbers of the projection (pixels), the viewpoint
        (metres) and the rotation into the image's axes, row by row.
    depth
        (H, W) metres: along the optical axis of a camera, along the ray of a
        LiDAR. NaN where nothing was seen.
    row
        (H, W) the point that was seen, -1 for none.
    tolerance
        (H, W) metres within which a depth agrees with the one that was seen:
        the noise, and how far the surface recedes over a pixel.
    facing
        (M, 3) normals of the points that were seen.
    """

    projection: Array
    depth: Array
    row: NDArray[np.int32]
    tolerance: Array
    facing: Array

    def __post_init__(self) -> None:
        """Check what would make a compiled loop read outside its arrays.

        Raises
        ------
        InputError
            The arrays do not belong together.
        """
        shape = self.depth.shape
        if len(shape) != 2 or self.row.shape != shape or self.tolerance.shape != shape:
            raise InputError(
                "range image: expected depth, row and tolerance of one shape (H, W), "
                f"got {shape}, {self.row.shape} and {self.tolerance.shape}"
            )
        if self.projection.shape != (17,) or self.facing.ndim != 2 or self.facing.shape[1] != 3:
            raise InputError(
                "range image: expected a projection (17,) and normals (M, 3), "
                f"got {self.projection.shape} and {self.facing.shape}"
            )
        if self.row.size and int(self.row.max()) >= len(self.facing):
            raise InputError(
                f"range image: row {self.row.max()} of {len(self.facing)} points that were seen"
            )

    def wider(self, by: Array) -> RangeImage:
        """Return the same with a tolerance wider by (M,) metres, one entry a point seen."""
        return replace(self, tolerance=self.tolerance + np.where(self.row < 0, 0.0, by[self.row]))

    def ask(self, points: Array, normals: Array, pose: Array) -> NDArray[np.uint8]:
        """Ask what the sensor saw of points (M, 3) that ``pose`` (4, 4) moves into its frame.

        Returns
        -------
        (M,) codes of :mod:`hmrf_icp.kernels.range_image`.

        Raises
        ------
        InputError
            There is not one normal a point, or the pose is no (4, 4) matrix.
        """
        from hmrf_icp.kernels.compiled import read_only
        from hmrf_icp.kernels.range_image import classify

        points, normals = (np.ascontiguousarray(a, dtype=np.float64) for a in (points, normals))
        if points.ndim != 2 or points.shape[1] != 3 or normals.shape != points.shape:
            raise InputError(
                "points, normals: expected shape (M, 3) of both, "
                f"got {points.shape} and {normals.shape}"
            )
        if np.shape(pose) != (4, 4):
            raise InputError(f"pose: expected a 4 x 4 matrix, got shape {np.shape(pose)}")
        code = np.empty(len(points), dtype=np.uint8)
        classify(
            read_only(points),
            read_only(normals),
            pose,
            self.projection,
            self.depth,
            self.row,
            self.tolerance,
            self.facing,
            code,
        )
        return code


@stage("range image")
def range_image(cloud: PointCloud, surface: Surface) -> RangeImage:
    """Lay a cloud out as its sensor saw it.

    Parameters
    ----------
    cloud
        Its viewpoint is known; with its camera, the image is the camera's.
    surface
        Of the cloud.
    """
    return _pinhole(cloud, surface) if cloud.camera is not None else _sphere(cloud, surface)


def _pinhole(cloud: PointCloud, surface: Surface) -> RangeImage:
    """Lay the cloud out on the pixel grid it came from."""
    camera = cloud.camera
    assert camera is not None
    projection = np.zeros(17)
    projection[:5] = (PINHOLE, camera.fx, camera.fy, camera.cx, camera.cy)
    projection[8:17] = np.eye(3).ravel()
    row = np.full(cloud.shape, -1, dtype=np.int32)
    row[cloud.observed] = np.arange(len(cloud), dtype=np.int32)
    footprint = surface.points[:, 2] / min(camera.fx, camera.fy)
    tolerance = _tolerance(surface, np.zeros(3), footprint)
    return RangeImage(
        projection=projection,
        depth=cloud.points[..., 2],
        row=row,
        tolerance=cloud.on_grid(tolerance),
        facing=surface.normals,
    )


def _sphere(cloud: PointCloud, surface: Surface) -> RangeImage:
    """Range image over azimuth and elevation, about as many pixels as the cloud fills.

    The pole is the axis along which the rays spread least: the axis of a
    spinning LiDAR however it is mounted.
    """
    assert cloud.viewpoint is not None
    offset = surface.points - cloud.viewpoint
    reach = np.linalg.norm(offset, axis=1)
    rays = offset / np.maximum(reach, 1e-300)[:, None]
    _, axes = np.linalg.eigh(rays.T @ rays)
    axes = axes.T[[2, 1, 0]]
    if np.linalg.det(axes) < 0:
        axes[2] *= -1.0
    local = rays @ axes.T
    azimuth = np.arctan2(local[:, 1], local[:, 0])
    elevation = np.arcsin(np.clip(local[:, 2], -1.0, 1.0))
    low, high = float(elevation.min()), float(elevation.max())
    pixel = float(np.sqrt(2.0 * np.pi * max(high - low, 1e-3) / len(reach))) * 1.4
    width = max(8, int(np.ceil(2.0 * np.pi / pixel)))
    height = max(2, int(np.ceil((high - low) / pixel)) + 1)
    per_radian = width / (2.0 * np.pi)

    column = np.minimum(((azimuth + np.pi) * per_radian).astype(np.int64), width - 1)
    line = np.clip(np.round((elevation - low) * per_radian).astype(np.int64), 0, height - 1)
    # The nearest point of a pixel is what stopped the ray: written last, it stays.
    order = np.argsort(-reach, kind="stable")
    row = np.full((height, width), -1, dtype=np.int32)
    row[line[order], column[order]] = order
    filled = row >= 0
    depth = np.full((height, width), np.nan)
    depth[filled] = reach[row[filled]]
    tolerance = np.full((height, width), np.nan)
    tolerance[filled] = _tolerance(surface, cloud.viewpoint, reach / per_radian)[row[filled]]

    projection = np.zeros(17)
    projection[:5] = (SPHERE, per_radian, per_radian, 0.5 * width - 0.5, -low * per_radian)
    projection[5:8] = cloud.viewpoint
    projection[8:17] = axes.ravel()
    return RangeImage(projection, depth, row, tolerance, surface.normals)


def _tolerance(surface: Surface, viewpoint: Array, footprint: Array) -> Array:
    """Noise, and the recession of the surface over the pixel that it fills."""
    offset = surface.points - viewpoint
    reach = np.maximum(np.linalg.norm(offset, axis=1), 1e-300)
    cosine = np.clip(np.abs((surface.normals * offset).sum(axis=1)) / reach, 0.2, 1.0)
    slope = np.sqrt(1.0 - cosine**2) / cosine
    return np.asarray(BAND * surface.noise + slope * footprint)
