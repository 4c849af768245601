"""Clouds and depth maps by the suffix of their file."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.distorted_camera import Camera
from hmrf_icp.errors import InputError
from hmrf_icp.io.arrays import read_npy, read_npz, write_npy, write_npz
from hmrf_icp.io.depth import IMAGE_SUFFIXES, MEDIUM, check_depth_type, read_depth
from hmrf_icp.io.e57 import read_e57
from hmrf_icp.io.e57_writing import write_e57
from hmrf_icp.io.files import check_suffix, existing_file
from hmrf_icp.io.intrinsics import Intrinsics
from hmrf_icp.io.las import read_las, write_las
from hmrf_icp.io.mesh import read_mesh
from hmrf_icp.io.obj_points import write_obj
from hmrf_icp.io.optional import optional
from hmrf_icp.io.pcd import read_pcd, write_pcd
from hmrf_icp.io.ply import read_ply, write_ply
from hmrf_icp.io.text import read_text, write_text
from hmrf_icp.io.velodyne import read_velodyne
from hmrf_icp.io.whole import require_writable, written_whole

_MESH_READERS: dict[str, Callable[[Path, int | None], PointCloud]] = {
    ".ply": read_ply,
    ".obj": read_mesh,
    ".stl": read_mesh,
    ".glb": read_mesh,
}

_READERS: dict[str, Callable[[Path], PointCloud]] = {
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
    ".obj": write_obj,
}

_LIBRARIES = {
    ".las": (("laspy", "las"),),
    ".laz": (("laspy", "las"), ("lazrs", "las")),
    ".e57": (("pye57", "e57"),),
}
"""What is written with a library that may be missing, and the extra that installs it."""

READABLE = tuple(dict.fromkeys((*IMAGE_SUFFIXES, ".npy", ".ply", *_READERS, *_MESH_READERS)))
"""Suffixes that `read_cloud` knows."""

WRITABLE = tuple(_WRITERS)
"""Suffixes that `write_cloud` knows."""

_COLOURS = ("red", "green", "blue", "rgb", "rgba")
_WITH_ATTRIBUTES = (".ply", ".pcd", ".csv", ".npz", ".las", ".laz")
_WITH_NORMALS = (*_WITH_ATTRIBUTES, ".xyzn", ".e57", ".obj")
_WITH_SOME = {
    ".e57": ("intensity", *_COLOURS),
    ".pts": ("intensity", *_COLOURS),
    ".obj": _COLOURS,
}

_TOO_NARROW = 16
"""An array with a side this short is hardly a depth map: rather a table of points."""


def read_cloud(
    path: str | os.PathLike[str],
    camera: Camera | Intrinsics | None = None,
    depth_scale: float | None = None,
    max_depth: float | None = None,
    *,
    samples: int | None = None,
    confidence: str | os.PathLike[str] | None = None,
    min_confidence: float = MEDIUM,
) -> PointCloud:
    """Read a cloud, or a depth map or a mesh as a cloud.

    Parameters
    ----------
    path
        A depth map (16-bit PNG or PGM, TIFF, EXR, NPY of shape (H, W)), a cloud
        (PLY, PCD, LAS, LAZ, E57, XYZ, XYZN, PTS, ASC, CSV, TXT, NPZ, KITTI's BIN, NPY of
        shape (N, 3) or (H, W, 3)) or a mesh (OBJ, STL, GLB, PLY with faces). Normals, colours
        and whatever else a cloud has for each point come along, where the file names them.
    camera
        For a depth map. A cloud has no use for it.
    depth_scale
        For a depth map: its units per metre. None means 1000 for integers and
        1 for floating point. Clouds are in metres.
    max_depth
        For a depth map: depths beyond this many metres are unobserved.
    samples
        For a mesh: points that are spread over its surface, 0 for its vertices; None is the
        vertices where they are many and evenly spread, and 100,000 points otherwise.
    confidence, min_confidence
        For a depth map, as `read_depth` takes them.

    Raises
    ------
    InputError
        The file is missing, damaged or of an unknown kind; a depth map comes
        without a camera or with that of another image size; a library that the format
        needs is not installed.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from hmrf_icp import read_cloud
    >>> rows = [[0.0, 1.0, 2.0, 3.0], [0.1, 4.0, 5.0, 6.0]]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder, "scan.csv")
    ...     np.savetxt(file, rows, delimiter=",", header="time,x,y,z", comments="")
    ...     read_cloud(file).points
    array([[1., 2., 3.],
           [4., 5., 6.]])
    """
    content = read_any(path, samples, confidence, min_confidence)
    if isinstance(content, PointCloud):
        return content
    return unproject(path, content, camera, depth_scale, max_depth)


def read_any(
    path: str | os.PathLike[str],
    samples: int | None = None,
    confidence: str | os.PathLike[str] | None = None,
    min_confidence: float = MEDIUM,
) -> PointCloud | NDArray[Any]:
    """Read a cloud, or a depth map as the array (H, W) that it is, whichever the file holds.

    Raises
    ------
    InputError
        The file is missing, damaged or of an unknown kind, or ``confidence`` is given for one
        that holds no depth map.
    """
    file = existing_file(path)
    suffix = check_suffix(file, READABLE, "read points or depth from")
    if suffix in IMAGE_SUFFIXES:
        return read_depth(file, confidence, min_confidence)
    content = _read_npy(file) if suffix == ".npy" else None
    if isinstance(content, np.ndarray):
        return content if confidence is None else read_depth(file, confidence, min_confidence)
    if confidence is not None:
        raise InputError(f"{file}: holds no depth map, which a confidence could be for")
    if content is not None:
        return content
    if suffix in _MESH_READERS:
        return _MESH_READERS[suffix](file, samples)
    return _READERS[suffix](file)


def _read_npy(file: Path) -> PointCloud | NDArray[Any]:
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
        The suffix is not known, the folder missing or not writable, or a library missing.
    """
    suffix = check_suffix(Path(path), WRITABLE, "write points to")
    for library, extra in _LIBRARIES.get(suffix, ()):
        optional(Path(path), library, extra)
    require_writable(path)


def write_cloud(path: str | os.PathLike[str], cloud: PointCloud) -> None:
    """Write a cloud in the format of the suffix, whole or not at all.

    PCD (binary), NPY and NPZ keep the grid of an organised cloud, with NaN where it is
    unobserved; all others get the observed points alone. What else is kept: everything in PLY
    (binary), PCD, CSV, NPZ, LAS and LAZ (whose coordinates are rounded to less than a billionth of
    the cloud's size); normals, colour and intensity in E57; normals and colour in OBJ; colour and
    intensity in PTS; normals in XYZN; nothing in XYZ, ASC, TXT and NPY. NPZ keeps the camera or
    the viewpoint as well, and E57 the viewpoint.

    Raises
    ------
    InputError
        The suffix is not known, the folder missing or not writable, or a library that the
        format needs not installed.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from hmrf_icp import PointCloud, read_cloud, write_cloud
    >>> cloud = PointCloud(np.random.default_rng(0).uniform(size=(100, 3)))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_cloud(Path(folder, "cloud.npz"), cloud)
    ...     read_cloud(Path(folder, "cloud.npz")) == cloud
    True
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
        kept = _WITH_SOME.get(suffix, ())
        names += [name for name in cloud.attributes if name not in kept]
    return names
