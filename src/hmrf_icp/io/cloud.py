"""Clouds and depth maps by the suffix of their file."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.distorted_camera import Camera
from hmrf_icp.errors import InputError
from hmrf_icp.io.arrays import read_npy, read_npz, write_npy, write_npz
from hmrf_icp.io.depth import IMAGE_SUFFIXES, check_depth_type, read_depth
from hmrf_icp.io.e57 import read_e57
from hmrf_icp.io.e57_writing import write_e57
from hmrf_icp.io.files import check_suffix, existing_file
from hmrf_icp.io.intrinsics import Intrinsics
from hmrf_icp.io.las import read_las, write_las
from hmrf_icp.io.pcd import read_pcd, write_pcd
from hmrf_icp.io.ply import read_ply, write_ply
from hmrf_icp.io.text import read_text, write_text
from hmrf_icp.io.velodyne import read_velodyne
from hmrf_icp.io.whole import require_writable, written_whole

_READERS: dict[str, Callable[[Path], PointCloud]] = {
    ".ply": read_ply,
    ".pcd": read_pcd,
    ".xyz": read_text,
    ".xyzn": read_text,
    ".pts": read_text,
    ".asc": read_text,
    ".csv": read_text,
    ".txt": read_text,
    ".npz": read_npz,
    ".bin": read_velodyne,
    ".las": read_las,
    ".laz": read_las,
    ".e57": read_e57,
}

_WRITERS: dict[str, Callable[[Path, PointCloud], None]] = {
    ".ply": write_ply,
    ".pcd": write_pcd,
    ".xyz": write_text,
    ".xyzn": write_text,
    ".pts": write_text,
    ".asc": write_text,
    ".csv": write_text,
    ".txt": write_text,
    ".npy": write_npy,
    ".npz": write_npz,
    ".las": write_las,
    ".laz": write_las,
    ".e57": write_e57,
}

READABLE = (*IMAGE_SUFFIXES, ".npy", *_READERS)
"""Suffixes that `read_cloud` knows."""

WRITABLE = tuple(_WRITERS)
"""Suffixes that `write_cloud` knows."""

_WITH_ATTRIBUTES = (".ply", ".pcd", ".csv", ".npz", ".las", ".laz")
_WITH_NORMALS = (*_WITH_ATTRIBUTES, ".xyzn")

_TOO_NARROW = 16
"""An array with a side this short is hardly a depth map: rather a table of points."""


def read_cloud(
    path: str | os.PathLike[str],
    camera: Camera | Intrinsics | None = None,
    depth_scale: float | None = None,
    max_depth: float | None = None,
) -> PointCloud:
    """Read a cloud, or a depth map as a cloud.

    Parameters
    ----------
    path
        A depth map (16-bit PNG or PGM, TIFF, NPY of shape (H, W)) or a cloud
        (PLY, PCD, XYZ, XYZN, CSV, TXT, NPZ, NPY of shape (N, 3) or (H, W, 3)). Normals
        and whatever else a cloud has for each point come along, where the file names them.
    camera
        For a depth map. A cloud has no use for it.
    depth_scale
        For a depth map: its units per metre. None means 1000 for integers and
        1 for floating point. Clouds are in metres.
    max_depth
        For a depth map: depths beyond this many metres are unobserved.

    Raises
    ------
    InputError
        The file is missing, damaged or of an unknown kind; a depth map comes
        without a camera or with that of another image size.
    """
    content = read_any(path)
    if isinstance(content, PointCloud):
        return content
    return unproject(path, content, camera, depth_scale, max_depth)


def read_any(path: str | os.PathLike[str]) -> PointCloud | NDArray[Any]:
    """Read a cloud, or a depth map as the array (H, W) that it is, whichever the file holds.

    Raises
    ------
    InputError
        The file is missing, damaged or of an unknown kind.
    """
    file = existing_file(path)
    suffix = check_suffix(file, READABLE, "read points or depth from")
    if suffix in IMAGE_SUFFIXES:
        return read_depth(file)
    if suffix != ".npy":
        return _READERS[suffix](file)
    array = read_npy(file)
    if array.ndim == 2 and array.shape[1] != 3:
        return check_depth_type(file, array)
    if array.dtype.itemsize < 2:
        raise InputError(f"{file}: an array of {array.dtype} is a picture, expected coordinates")
    try:
        return PointCloud(array)
    except InputError as error:
        raise InputError(f"{file}: {error}") from None


def unproject(
    path: str | os.PathLike[str],
    depth: NDArray[Any],
    camera: Camera | Intrinsics | None,
    depth_scale: float | None = None,
    max_depth: float | None = None,
) -> PointCloud:
    """Make a cloud of the depth map that was read from ``path``; errors name the file.

    Raises
    ------
    InputError
        As `read_cloud`.
    """
    height, width = depth.shape
    hint = ""
    if min(depth.shape) <= _TOO_NARROW:
        hint = f"; if its shape {depth.shape} is a table of points, keep x, y, z as (N, 3)"
    if camera is None:
        raise InputError(
            f"{path}: is a depth map, which needs the intrinsics of its camera (--camera or "
            f"--intrinsics on the command line, camera= in Python){hint}"
        )
    try:
        if isinstance(camera, Intrinsics):
            camera = camera.for_image(width, height)
        return PointCloud.from_depth(depth, camera, depth_scale, max_depth)
    except InputError as error:
        raise InputError(f"{path}: {error}{hint}") from None


def check_writable(path: str | os.PathLike[str]) -> None:
    """Check that `write_cloud` could write at ``path``, before the work that makes the cloud.

    Raises
    ------
    InputError
        The suffix is not known, or the folder missing or not writable.
    """
    check_suffix(Path(path), WRITABLE, "write points to")
    require_writable(path)


def write_cloud(path: str | os.PathLike[str], cloud: PointCloud) -> None:
    """Write a cloud in the format of the suffix, whole or not at all.

    PLY (binary), XYZ, XYZN, TXT and CSV get the observed points alone; PCD (binary),
    NPY and NPZ keep the grid of an organised cloud, with NaN where it is
    unobserved. PLY, PCD, CSV and NPZ keep normals and attributes, XYZN the normals. NPZ
    keeps the camera or the viewpoint as well.

    Raises
    ------
    InputError
        The suffix is not known, or the folder missing or not writable.
    """
    suffix = check_suffix(Path(path), WRITABLE, "write points to")
    with written_whole(path) as partial:
        _WRITERS[suffix](partial, cloud)


def dropped(path: str | os.PathLike[str], cloud: PointCloud) -> list[str]:
    """Name what the cloud has and the format of the suffix has no place for."""
    suffix = Path(path).suffix.lower()
    names = []
    if cloud.normals is not None and suffix not in _WITH_NORMALS:
        names.append("normals")
    if suffix not in _WITH_ATTRIBUTES:
        names += list(cloud.attributes)
    return names
