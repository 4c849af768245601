"""The pinhole camera that made a depth map."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmrf_icp.errors import InputError


@dataclass(frozen=True, slots=True)
class PinholeCamera:
    """Intrinsics of a camera without lens distortion.

    The camera looks along +z, x is to the right of the image, y down; the
    centre of the upper left pixel is (0, 0).

    Parameters
    ----------
    width, height
        Size of its images, pixels.
    fx, fy
        Focal lengths, pixels.
    cx, cy
        Principal point, pixels.

    Raises
    ------
    InputError
        A size or focal length that is not positive, or a number that is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> from hmrf_icp import PinholeCamera
    >>> camera = PinholeCamera(width=3, height=1, fx=2.0, fy=2.0, cx=1.0, cy=0.0)
    >>> camera.unproject(np.full((1, 3), 4.0))[0, :, 0]
    array([-2.,  0.,  2.])
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        """Refuse what cannot be a camera."""
        for name in ("width", "height"):
            pixels = getattr(self, name)
            if not isinstance(pixels, (int, float, np.number)) or float(pixels) % 1.0 != 0.0:
                raise InputError(f"camera: {name} must be a whole number of pixels, got {pixels!r}")
            object.__setattr__(self, name, int(pixels))
        numbers = (self.fx, self.fy, self.cx, self.cy)
        if not all(isinstance(n, (int, float, np.number)) and math.isfinite(n) for n in numbers):
            raise InputError(f"camera: fx, fy, cx, cy must be finite numbers, got {numbers}")
        for name, number in zip(("fx", "fy", "cx", "cy"), numbers, strict=True):
            object.__setattr__(self, name, float(number))
        if self.width < 1 or self.height < 1:
            raise InputError(f"camera: an image of {self.width} x {self.height} has no pixels")
        if self.fx <= 0 or self.fy <= 0:
            raise InputError(
                f"camera: focal lengths must be positive, got fx={self.fx}, fy={self.fy}"
            )

    @classmethod
    def from_matrix(cls, matrix: ArrayLike, width: int, height: int) -> PinholeCamera:
        """Read a camera from its (3, 3) matrix K, for images of ``width`` x ``height`` pixels."""
        try:
            k = np.asarray(matrix, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InputError(f"camera: expected a 3 x 3 matrix K of numbers: {error}") from None
        if k.shape != (3, 3):
            raise InputError(f"camera: expected a 3 x 3 matrix K, got shape {k.shape}")
        expected_zero = (k[0, 1], k[1, 0], k[2, 0], k[2, 1])
        if not np.allclose(expected_zero, 0.0) or not np.isclose(k[2, 2], 1.0):
            raise InputError(
                "camera: expected K = [fx 0 cx; 0 fy cy; 0 0 1] (no skew), got "
                + "; ".join(" ".join(f"{value:g}" for value in row) for row in k)
            )
        fx, fy, cx, cy = (float(value) for value in (k[0, 0], k[1, 1], k[0, 2], k[1, 2]))
        return cls(width, height, fx, fy, cx, cy)

    @property
    def matrix(self) -> NDArray[np.float64]:
        """The (3, 3) matrix K, pixels."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def unproject(self, depth: NDArray[np.floating]) -> NDArray[np.float64]:
        """Turn a depth map (H, W), metres along z, into points (H, W, 3); NaN stays NaN.

        Raises
        ------
        InputError
            The map is not of this camera's size.
        """
        if depth.shape != (self.height, self.width):
            raise InputError(
                f"camera: intrinsics are for {self.width} x {self.height} pixels, the depth map "
                f"has {' x '.join(str(n) for n in depth.shape[::-1])}"
            )
        points = np.empty((self.height, self.width, 3))
        # A focal length next to nothing puts points at infinity, where they are unobserved.
        with np.errstate(over="ignore", invalid="ignore"):
            points[..., 0] = (np.arange(self.width) - self.cx) / self.fx
            points[..., 1] = ((np.arange(self.height) - self.cy) / self.fy)[:, None]
            points[..., 2] = 1.0
            points *= depth[..., None]
        return points

    def project(
        self, points: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Project points (..., 3) in the camera's frame.

        Returns
        -------
        u, v
            Pixel coordinates (...), NaN for points that are not in front of the camera.
        depth
            z (...), metres.
        """
        z = np.asarray(points[..., 2], dtype=np.float64)
        front = np.where(z > 0, z, np.nan)
        u = self.fx * points[..., 0] / front + self.cx
        v = self.fy * points[..., 1] / front + self.cy
        return u, v, z

    def subsampled(self, step: int, across: int | None = None) -> PinholeCamera:
        """Return the camera of the image that keeps every ``step``-th row and column.

        Of the columns every ``across``-th, where that is given.
        """
        across = step if across is None else across
        return PinholeCamera(
            width=-(-self.width // across),
            height=-(-self.height // step),
            fx=self.fx / across,
            fy=self.fy / step,
            cx=self.cx / across,
            cy=self.cy / step,
        )
