"""A camera whose lens bends the image, and its depth maps as an ideal camera would see them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.clouds.distortion import Distortion
from hmrf_icp.errors import InputError

Array = NDArray[np.float64]

STEEPEST = 10.0
"""Pixel widths that depth may change by from one pixel to the next on one surface.

As a share of the depth, that is ten over the focal length: a plane turned 84 degrees away.
"""

MARGIN = 0.5
"""Share of the image that the ideal one may reach beyond it, on each side."""


@dataclass(frozen=True)
class DistortedCamera:
    """Intrinsics of a camera with lens distortion.

    A depth map taken with it is resampled into that of an ideal camera
    (:meth:`rectified`), which is what a cloud is made of: registration projects points into
    images by the million, and a pinhole does that with one division.

    Parameters
    ----------
    camera
        The same without the distortion, for images of the same size.
    distortion
        Of the lens.

    Examples
    --------
    >>> from hmrf_icp import DistortedCamera, Distortion, PinholeCamera
    >>> camera = PinholeCamera(640, 480, 525.0, 525.0, 319.5, 239.5)
    >>> barrel = Distortion("brown-conrady", (-0.1, 0.0, 0.0, 0.0))
    >>> DistortedCamera(camera, barrel).rectified_camera().fx
    525.0
    """

    camera: PinholeCamera
    distortion: Distortion

    @property
    def width(self) -> int:
        """Of its images, pixels."""
        return self.camera.width

    @property
    def height(self) -> int:
        """Of its images, pixels."""
        return self.camera.height

    def ideal(self, u: Array, v: Array) -> tuple[Array, Array]:
        """Take pixel coordinates in its images to those in the ideal camera's, NaN for none."""
        k = self.camera
        with np.errstate(all="ignore"):  # with a focal length next to nothing, or beyond numbers
            x, y = self.distortion.undistort((u - k.cx) / k.fx, (v - k.cy) / k.fy)
            return k.fx * x + k.cx, k.fy * y + k.cy

    def seen(self, u: Array, v: Array) -> tuple[Array, Array]:
        """Take pixel coordinates in the ideal camera's images to those in its own."""
        k = self.camera
        with np.errstate(all="ignore"):
            x, y = self.distortion.distort((u - k.cx) / k.fx, (v - k.cy) / k.fy)
            return k.fx * x + k.cx, k.fy * y + k.cy

    def rectified_camera(self) -> PinholeCamera:
        """Return the ideal camera that sees all that this one sees, in pixels as wide.

        Its images reach at most half a width and height beyond.

        Raises
        ------
        InputError
            The distortion lets no pixel be seen.
        """
        k = self.camera
        columns, rows = np.meshgrid(np.arange(k.width, dtype=float), np.arange(k.height))
        u, v = self.ideal(columns, rows)
        if not np.isfinite(u).any():
            raise InputError("camera: with this distortion no ray meets any of its pixels")
        left, right = _limits(u, k.width)
        top, bottom = _limits(v, k.height)
        return PinholeCamera(
            right - left + 1, bottom - top + 1, k.fx, k.fy, k.cx - left, k.cy - top
        )

    def rectified(self, depth: Array) -> tuple[Array, PinholeCamera]:
        """Resample a depth map into the ideal camera's.

        Where the four pixels about a ray see one surface, inverse depth, which is linear in the
        image of a plane, is interpolated; across an edge and beside holes the nearest pixel
        is taken: no point comes to lie in the air between two surfaces.

        Parameters
        ----------
        depth
            (H, W) along the optical axis, metres; NaN is unobserved.

        Returns
        -------
        depth, camera
            (H', W') and the camera that it is of.

        Raises
        ------
        InputError
            The map is not of this camera's size.
        """
        k = self.camera
        if depth.shape != (k.height, k.width):
            raise InputError(
                f"camera: intrinsics are for {k.width} x {k.height} pixels, the depth map "
                f"has {' x '.join(str(n) for n in depth.shape[::-1])}"
            )
        ideal = self.rectified_camera()
        columns, rows = np.meshgrid(
            np.arange(ideal.width) + (k.cx - ideal.cx), np.arange(ideal.height) + (k.cy - ideal.cy)
        )
        u, v = self.seen(columns, rows)
        steepest = STEEPEST / min(k.fx, k.fy)
        return _sampled(depth, u, v, 1.0 + steepest), ideal


Camera: TypeAlias = PinholeCamera | DistortedCamera
"""What depth maps are taken with."""


def _limits(values: Array, size: int) -> tuple[int, int]:
    """First and last pixel of the ideal image, which may be a little smaller or larger."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    room = MARGIN * size
    first = math.floor(max(low, -room) + 1e-6)
    last = math.ceil(min(high, size - 1 + room) - 1e-6)
    return first, max(first, last)


def _sampled(depth: Array, u: Array, v: Array, ratio: float) -> Array:
    """Depth at the places (u, v) of the map, NaN outside of it."""
    height, width = depth.shape
    result = np.full(u.shape, np.nan)
    with np.errstate(invalid="ignore"):
        inside = (u > -0.5) & (u < width - 0.5) & (v > -0.5) & (v < height - 0.5)
    u, v = u[inside], v[inside]
    nearest = depth[
        np.clip(np.rint(v).astype(np.intp), 0, height - 1),
        np.clip(np.rint(u).astype(np.intp), 0, width - 1),
    ]
    left = np.clip(np.floor(u).astype(np.intp), 0, max(width - 2, 0))
    top = np.clip(np.floor(v).astype(np.intp), 0, max(height - 2, 0))
    right, bottom = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    corners = np.stack(
        [depth[top, left], depth[top, right], depth[bottom, left], depth[bottom, right]]
    )
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        # NaN, which is unobserved, is never one surface with anything.
        smooth = corners.max(axis=0) <= ratio * corners.min(axis=0)
        a, b = u - left, v - top
        weights = np.stack([(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b])
        between = 1.0 / (weights / corners).sum(axis=0)
    # On the outermost half pixel the same plane is followed, not the nearest pixel.
    smooth &= np.isfinite(between) & (between > 0.0)
    result[inside] = np.where(smooth, between, nearest)
    return result
