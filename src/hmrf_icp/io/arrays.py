"""NumPy's files: a depth map or a cloud in NPY, a cloud with its camera in NPZ."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.errors import InputError
from hmrf_icp.io.files import reading


def read_npy(path: Path) -> NDArray[Any]:
    """Read one array of numbers.

    Raises
    ------
    InputError
        Not an NPY file, cut short, or an array of something else.
    """
    with reading(path, "an NPY array"):
        array = np.load(path, allow_pickle=False)
        if not isinstance(array, np.ndarray):
            array.close()
            raise InputError(f"{path}: an NPZ archive by the name of an NPY array")
    return _numbers(path, array)


def read_npz(path: Path) -> PointCloud:
    """Read a cloud from the array ``points`` of an archive, or from its only array.

    ``camera`` (3, 3) and ``viewpoint`` (3,), which `write_npz` adds, are read where they are there.

    Raises
    ------
    InputError
        Not an NPZ archive, cut short, or without an array that holds points.
    """
    with reading(path, "an NPZ archive"):
        archive = np.load(path, allow_pickle=False)
        if isinstance(archive, np.ndarray):
            raise InputError(f"{path}: an NPY array by the name of an NPZ archive")
        with archive:
            names = archive.files
            if "points" not in names and len(names) != 1:
                raise InputError(
                    f"{path}: expected an array called 'points', found "
                    + (", ".join(repr(name) for name in names) or "no array at all")
                )
            points = _numbers(path, archive["points" if "points" in names else names[0]])
            matrix = archive["camera"] if "camera" in names else None
            viewpoint = archive["viewpoint"] if "viewpoint" in names else None
    try:
        if matrix is None or points.ndim != 3:
            return PointCloud(points, viewpoint=viewpoint)
        height, width, _ = points.shape
        return PointCloud(points, PinholeCamera.from_matrix(matrix, width, height))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def write_npy(path: Path, cloud: PointCloud) -> None:
    """Write the points, (H, W, 3) or (N, 3) float64, NaN where unobserved."""
    np.save(path, cloud.points)


def write_npz(path: Path, cloud: PointCloud) -> None:
    """Write the points, and the camera matrix or the viewpoint where they are known."""
    arrays: dict[str, NDArray[np.float64]] = {"points": cloud.points}
    if cloud.camera is not None:
        arrays["camera"] = cloud.camera.matrix
    elif cloud.viewpoint is not None:
        arrays["viewpoint"] = cloud.viewpoint
    np.savez_compressed(path, **arrays)  # type: ignore[arg-type]  # its stub: numpy>=2 has a flag


def _numbers(path: Path, array: NDArray[Any]) -> NDArray[Any]:
    if array.dtype.kind not in "iuf":
        raise InputError(f"{path}: expected an array of numbers, found one of {array.dtype}")
    return array
