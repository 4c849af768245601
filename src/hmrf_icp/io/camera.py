"""Intrinsics from files and from the command line."""

from __future__ import annotations

import os

import numpy as np

from hmrf_icp.clouds.distorted_camera import Camera
from hmrf_icp.errors import InputError
from hmrf_icp.io.camera_formats import EXPECTED, from_json, from_yaml, is_yaml
from hmrf_icp.io.files import existing_file, reading
from hmrf_icp.io.intrinsics import Intrinsics
from hmrf_icp.io.matrix import read_matrix

MOST_BYTES = 1 << 20
"""A camera is a page; the factory's calibration of a Kinect twenty."""


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
    """Read a camera in any of the forms that recorders write.

    A 3 x 3 matrix as text; Open3D's JSON of an intrinsic, alone or with a pose, which is left
    aside; RealSense's intrinsics as JSON; the calibration JSON of an Azure Kinect, for its depth
    camera; ROS's camera_info, or OpenCV's calibration, as YAML (`pip install
    'hmrf-icp[yaml]'`). Which one, the content tells.

    Raises
    ------
    InputError
        The file is missing, empty or holds none of these.
    """
    file = existing_file(path)
    with reading(file, "camera intrinsics"):
        if file.stat().st_size > MOST_BYTES:
            raise InputError(f"{file}: {file.stat().st_size:,} bytes are no camera; {EXPECTED}")
        text = file.read_text(encoding="utf-8-sig")
    if text.lstrip().startswith("{"):
        return from_json(file, text)
    if file.suffix.lower() in (".yaml", ".yml") or is_yaml(text):
        return from_yaml(file, text)
    return Intrinsics(read_matrix(file, (3, 3), EXPECTED), str(file))


def read_camera(path: str | os.PathLike[str], width: int, height: int) -> Camera:
    """Read the camera of images of ``width`` x ``height`` pixels, in any form of `read_intrinsics`.

    Returns
    -------
    A `PinholeCamera`, or a `DistortedCamera` where the file says that the lens bends the image;
    `PointCloud.from_depth` takes either.

    Raises
    ------
    InputError
        The file is missing or malformed, or its intrinsics are for another image size
        (see `Intrinsics.for_image`).

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from hmrf_icp import read_camera
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder, "camera.txt")
    ...     np.savetxt(file, [[525.0, 0.0, 319.5], [0.0, 525.0, 239.5], [0.0, 0.0, 1.0]])
    ...     read_camera(file, 640, 480).fx
    525.0
    """
    return read_intrinsics(path).for_image(width, height)
