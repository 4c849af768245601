"""Intrinsics as they stand in a file, which may not know of which image they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.clouds.distorted_camera import Camera, DistortedCamera
from hmrf_icp.clouds.distortion import Distortion
from hmrf_icp.errors import InputError


@dataclass(frozen=True, eq=False)
class Intrinsics:
    """A camera matrix that may not know for which size of image it holds.

    Parameters
    ----------
    matrix
        K, (3, 3), pixels.
    name
        The file or argument that it came from, for messages.
    size
        (width, height) in pixels, None where the source does not tell.
    distortion
        Of the lens, None where the source says nothing of it.
    others
        The same camera for images of other sizes.
    """

    matrix: NDArray[np.float64]
    name: str
    size: tuple[int, int] | None = None
    distortion: Distortion | None = None
    others: tuple[Intrinsics, ...] = ()

    def for_image(self, width: int, height: int) -> Camera:
        """Return the camera of an image, if the matrix can belong to one of that size.

        A matrix alone does not say for what size of image it was measured, and
        one for twice or half the size would bend every surface without a word.
        The principal point tells: lenses sit near the middle of the image, so
        it has to lie in the middle third of either side.

        Returns
        -------
        A `DistortedCamera` where the lens bends the image, a `PinholeCamera` otherwise.

        Raises
        ------
        InputError
            No pinhole camera, or that of an image of another size.
        """
        for other in self.others:
            if other.size == (width, height):
                return other.for_image(width, height)
        if self.size is not None and self.size != (width, height):
            sizes = [each.size for each in (self, *self.others) if each.size is not None]
            raise InputError(
                f"{self.name}: intrinsics for images of "
                f"{' or '.join(f'{w} x {h}' for w, h in sizes)} pixels, "
                f"the depth map has {width} x {height}"
            )
        try:
            camera = PinholeCamera.from_matrix(self.matrix, width, height)
        except InputError as error:
            raise InputError(f"{self.name}: {error}") from None
        off = max(abs(camera.cx / width - 0.5), abs(camera.cy / height - 0.5))
        if self.size is None and off > 1 / 6:
            raise InputError(
                f"{self.name}: a principal point of ({camera.cx:g}, {camera.cy:g}) is far from the "
                f"middle of a depth map of {width} x {height} pixels: these look like intrinsics "
                "for another image size; scale them to this one (or, if it is cut out of a larger "
                "image, give an Open3D intrinsics JSON with its width and height)"
            )
        return DistortedCamera(camera, self.distortion) if self.distortion else camera
