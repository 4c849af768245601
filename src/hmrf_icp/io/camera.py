"""Intrinsics from files and from the command line."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.errors import InputError
from hmrf_icp.io.files import existing_file, reading
from hmrf_icp.io.matrix import read_matrix

_EXPECTED = (
    "expected a 3 x 3 matrix as text, or the JSON of an Open3D PinholeCameraIntrinsic "
    "(width, height, intrinsic_matrix)"
)


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
    """

    matrix: NDArray[np.float64]
    name: str
    size: tuple[int, int] | None = None

    def for_image(self, width: int, height: int) -> PinholeCamera:
        """Return the camera of an image, if the matrix can belong to one of that size.

        A matrix alone does not say for what size of image it was measured, and
        one for twice or half the size would bend every surface without a word.
        The principal point tells: lenses sit near the middle of the image, so
        it has to lie in the middle third of either side.

        Raises
        ------
        InputError
            No pinhole camera, or that of an image of another size.
        """
        if self.size is not None and self.size != (width, height):
            raise InputError(
                f"{self.name}: intrinsics for images of {self.size[0]} x {self.size[1]} pixels, "
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
        return camera


def parse_intrinsics(text: str, name: str = "intrinsics") -> Intrinsics:
    """Read ``"FX,FY,CX,CY"``, pixels.

    Raises
    ------
    InputError
        Not four finite numbers, or focal lengths that are not positive.
    """
    try:
        fx, fy, cx, cy = (float(word) for word in text.split(","))
    except ValueError:
        raise InputError(
            f"{name}: expected four numbers FX,FY,CX,CY in pixels, such as 585,585,320,240; "
            f"got {text!r}"
        ) from None
    if not (np.isfinite([fx, fy, cx, cy]).all() and fx > 0 and fy > 0):
        raise InputError(f"{name}: focal lengths must be positive and all finite, got {text!r}")
    return Intrinsics(np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]), name)


def read_intrinsics(path: str | os.PathLike[str]) -> Intrinsics:
    """Read a 3 x 3 text matrix, or the JSON that Open3D writes for its cameras.

    Open3D's JSON lists the matrix column by column, and may be that of an
    intrinsic alone or of a camera with its pose, which is left aside.

    Raises
    ------
    InputError
        The file is missing, empty or holds neither.
    """
    file = existing_file(path)
    with reading(file, "camera intrinsics"):
        text = file.read_text(encoding="utf-8-sig")
    if not text.lstrip().startswith("{"):
        return Intrinsics(read_matrix(file, (3, 3), _EXPECTED), str(file))
    try:
        content: Any = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{file}: malformed JSON ({error}); {_EXPECTED}") from None
    try:
        content = content.get("intrinsic", content)
        matrix = np.array(content["intrinsic_matrix"], dtype=np.float64).reshape(3, 3, order="F")
        width, height = content["width"], content["height"]
        if type(width) is not int or type(height) is not int:
            raise TypeError("width and height are not whole numbers")
    except KeyError as error:
        raise InputError(f"{file}: the JSON has no {error.args[0]!r}; {_EXPECTED}") from None
    except (TypeError, ValueError, AttributeError, OverflowError) as error:
        raise InputError(f"{file}: {error}; {_EXPECTED}") from None
    if matrix[2, :2].any() and not matrix[:2, 2].any():
        raise InputError(
            f"{file}: intrinsic_matrix is written row by row; Open3D writes it column by column: "
            "[fx, 0, 0, 0, fy, 0, cx, cy, 1]"
        )
    return Intrinsics(matrix, str(file), (width, height))


def read_camera(path: str | os.PathLike[str], width: int, height: int) -> PinholeCamera:
    """Read the camera of images of ``width`` x ``height`` pixels.

    Raises
    ------
    InputError
        The file is missing or malformed, or its intrinsics are for another image size
        (see `Intrinsics.for_image`).
    """
    return read_intrinsics(path).for_image(width, height)
