"""NumPy's files: a depth map or a cloud in NPY, a cloud with all that it has in NPZ."""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.errors import InputError
from hmrf_icp.io.columns import Columns
from hmrf_icp.io.files import quietly, reading, require_bounded

_OWN = ("points", "camera", "viewpoint", "normals")
"""Arrays of an archive that are not attributes."""

_SHOWN = 20
"""Names in a message, at most."""

_ZIP_START = b"PK"


def read_npy(path: Path) -> NDArray[Any]:
    """Read one array of numbers.

    Raises
    ------
    InputError
        Not an NPY file, cut short, or an array of something else.
    """
    with reading(path, "an NPY array"), quietly(), path.open("rb") as stream:
        if stream.read(2) == _ZIP_START:
            raise InputError(f"{path}: an NPZ archive by the name of an NPY array")
        stream.seek(0)
        _, kind = _check_header(path, stream, path.stat().st_size)
        if kind.kind not in "iuf":
            raise InputError(f"{path}: expected an array of numbers, found one of {kind}")
        stream.seek(0)
        return np.lib.format.read_array(stream, allow_pickle=False)


def read_npz(path: Path) -> PointCloud:
    """Read a cloud from the array ``points`` of an archive, or from its only array.

    Open3D's archives call it ``positions``.

    ``camera`` (3, 3), ``viewpoint`` (3,) and ``normals``, which `write_npz` adds, are read where
    they are there. Any other array with one value, or one row of values, for each point is an
    attribute.

    Raises
    ------
    InputError
        Not an NPZ archive, cut short, without an array that holds points, or
        one that would fill the memory.
    """
    with reading(path, "an NPZ archive"):
        with path.open("rb") as stream:
            if stream.read(6) == np.lib.format.MAGIC_PREFIX:
                raise InputError(f"{path}: an NPY array by the name of an NPZ archive")
        with quietly(), zipfile.ZipFile(path) as archive:
            members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
            named = [name for name in ("points", "positions") if name in members]
            if not named and len(members) != 1:
                shown = ", ".join(repr(name) for name in [*members][:_SHOWN])
                more = f" and {len(members) - _SHOWN} more" if len(members) > _SHOWN else ""
                raise InputError(
                    f"{path}: expected an array called 'points', found "
                    + (shown + more or "no array at all")
                )
            first = named[0] if named else next(iter(members))
            require_bounded(
                path,
                sum(info.compress_size for info in members.values()),
                sum(info.file_size for info in members.values()),
            )
            points = _member(path, archive, members[first], ())
            if points is None:
                raise InputError(f"{path}: {first!r} in it is not an array of numbers")
            if points.dtype.itemsize < 2:
                raise InputError(
                    f"{path}: {first!r} is an array of {points.dtype}, a picture; expected "
                    "coordinates"
                )
            shape = points.shape[:-1]
            special = {
                name: _member(path, archive, members[name], ())
                for name in _OWN[1:]
                if name in members
            }
            attributes: Columns = {}
            for name, info in members.items():
                if name not in _OWN and name != first:
                    values = _member(path, archive, info, shape)
                    if values is not None:
                        attributes[name] = values
        return _cloud(path, points, special, attributes)


def write_npy(path: Path, cloud: PointCloud) -> None:
    """Write the points, (H, W, 3) or (N, 3) float64, NaN where unobserved."""
    np.save(path, cloud.points)


def write_npz(path: Path, cloud: PointCloud) -> None:
    """Write the points and all that the cloud has beside them."""
    arrays: dict[str, NDArray[Any]] = {"points": cloud.points}
    if cloud.camera is not None:
        arrays["camera"] = cloud.camera.matrix
    elif cloud.viewpoint is not None:
        arrays["viewpoint"] = cloud.viewpoint
    if cloud.normals is not None:
        arrays["normals"] = cloud.normals
    for name, values in cloud.attributes.items():
        plain = name.encode("utf-8", "backslashreplace").decode()  # half a character is none
        arrays[f"attribute {plain}" if plain in _OWN else plain] = values
    # Not with np.savez, to which an attribute called "file" would be its own argument.
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, values in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as stream:
                np.lib.format.write_array(stream, np.asanyarray(values), allow_pickle=False)


def _cloud(
    path: Path,
    points: NDArray[Any],
    special: dict[str, NDArray[Any] | None],
    attributes: Columns,
) -> PointCloud:
    for name, values in special.items():
        if values is None:
            raise InputError(f"{path}: {name!r} in it is not an array of numbers")
    matrix, viewpoint, normals = (special.get(name) for name in _OWN[1:])
    camera = None
    try:
        if matrix is not None and points.ndim == 3:
            camera = PinholeCamera.from_matrix(matrix, points.shape[1], points.shape[0])
            viewpoint = None
        return PointCloud(points, camera, viewpoint, normals, attributes)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _member(
    path: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo, shape: tuple[int, ...]
) -> NDArray[Any] | None:
    """Read an array; None where it is not one of numbers, or has not an entry a point."""
    with archive.open(info) as stream:
        if stream.read(6) != np.lib.format.MAGIC_PREFIX:
            return None
    with archive.open(info) as stream:
        promised, kind = _check_header(path, stream, info.file_size)
    fits = promised[: len(shape)] == shape and (not shape or len(promised) <= len(shape) + 1)
    if not fits or kind.kind not in ("iufb" if shape else "iuf"):
        return None
    with archive.open(info) as stream:
        return np.lib.format.read_array(stream, allow_pickle=False)


def _check_header(
    path: Path, stream: IO[bytes], size: int
) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Refuse an array that promises more than its file holds, before there is memory for it.

    Returns
    -------
    Its shape and type.
    """
    version = np.lib.format.read_magic(stream)
    start = stream.tell()
    if version == (1, 0):
        shape, _, kind = np.lib.format.read_array_header_1_0(stream)
    else:
        length = int.from_bytes(stream.read(4), "little")
        if length > size:
            raise InputError(f"{path}: cut short: a header of {length:,} bytes promised")
        stream.seek(start)
        shape, _, kind = np.lib.format.read_array_header_2_0(stream)
    promised = math.prod(shape) * kind.itemsize
    if min(shape, default=0) < 0:
        raise InputError(f"{path}: an array of shape {shape}")
    if not kind.hasobject and promised > size - stream.tell():
        raise InputError(
            f"{path}: cut short: an array of shape {shape} promised, which takes {promised:,} "
            f"bytes, {size - stream.tell():,} found"
        )
    return shape, kind
