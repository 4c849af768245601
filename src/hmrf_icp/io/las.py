"""LAS and LAZ, the formats of surveys, by laspy and lazrs (``pip install 'hmrf-icp[las]'``)."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.las_dimensions import COLOURS, las_dimensions
from hmrf_icp.errors import InputError
from hmrf_icp.io.columns import (
    AXES,
    PLY_NORMALS,
    Columns,
    Names,
    columns_of,
    one_number_a_column,
    unpacked_colours,
)
from hmrf_icp.io.files import reading, require_bounded
from hmrf_icp.io.las_reference import doubts
from hmrf_icp.io.laz_outline import check_chunks
from hmrf_icp.io.optional import optional

LARGEST = 2**31 - 1
"""Steps that a coordinate may be away from the offset."""

_SMALLEST_HEADER = 227
_LAZ = 0x80
"""Bit of the point format that says that the points are compressed."""

_WRITTEN_SCALE = 257
"""A byte of colour in 16 bits: 255 becomes 65535."""

_LONGEST_NAME = 31


def read_las(path: Path) -> PointCloud:
    """Read the points of LAS or LAZ, whichever it is, in metres or what the file has instead.

    Coordinates are whole numbers with a scale and an offset there, and float64 here: those of a
    national grid keep every digit. Intensity, colour, normals, times and all other dimensions come
    along that are not 0 throughout. Points marked as withheld are left out.

    Raises
    ------
    InputError
        Not LAS, damaged, cut short, more points promised than the file can hold, or laspy (for
        LAZ, lazrs too) is missing.
    """
    laspy = optional(path, "laspy", "las")
    with reading(path, "a LAS file"), path.open("rb") as stream, _panics(path):
        packed = _check_header(path, stream)
        if packed:
            optional(path, "lazrs", "las")
        stream.seek(0)
        with laspy.open(
            stream, closefd=False, read_evlrs=False, laz_backend=laspy.LazBackend.Lazrs
        ) as reader:
            header = reader.header
            count, record = int(header.point_count), int(header.point_format.size)
            held = path.stat().st_size - int(header.offset_to_point_data)
            if packed:
                described = header.vlrs.get("LasZipVlr")
                check_chunks(
                    path,
                    stream,
                    int(header.offset_to_point_data),
                    count,
                    described[0].record_data if described else b"",
                )
                stream.seek(int(header.offset_to_point_data))
                require_bounded(path, max(held, 0), count * record)
            elif count * record > held:
                raise InputError(
                    f"{path}: cut short: {count:,} points of {record} bytes promised, "
                    f"{max(held, 0):,} bytes found"
                )
            scaled = np.array([*header.scales, *header.offsets])
            if not np.isfinite(scaled).all():
                raise InputError(f"{path}: its scales or offsets are not finite")
            points = reader.read_points(-1)
            if len(points) != count:
                raise InputError(
                    f"{path}: cut short: {count:,} points promised, {len(points):,} found"
                )
            return _cloud(points, doubts(header))


def write_las(path: Path, cloud: PointCloud) -> None:
    """Write the observed points to LAS 1.4, or LAZ by the suffix, with all that they have.

    Coordinates are rounded to a power of ten that is a billionth of the cloud's size or less.
    What LAS has no dimension for, or that does not fit into it, becomes an extra dimension.
    """
    laspy = optional(path, "laspy", "las")
    packed = path.suffix.lower() == ".laz"
    if packed:
        optional(path, "lazrs", "las")
    points = cloud.observed_points
    others = unpacked_colours(columns_of(cloud, PLY_NORMALS))
    columns = {
        name: values[cloud.observed]
        for name, values in one_number_a_column(others, len(cloud.shape)).items()
    }
    coloured = all(name in columns and columns[name].dtype == np.uint8 for name in COLOURS)
    header = laspy.LasHeader(version="1.4", point_format=7 if coloured else 6)
    header.scales, header.offsets = _steps(points)
    standard, extra = _placed(laspy.LasData(header), columns, coloured)
    header.add_extra_dims(
        [laspy.ExtraBytesParams(name=name, type=values.dtype) for name, values in extra.items()]
    )
    las = laspy.LasData(header)
    las.points = laspy.ScaleAwarePointRecord.zeros(len(points), header=header)
    with np.errstate(over="ignore"):  # the limits of what would fit may be
        las.x, las.y, las.z = points.T
    for name in ("return_number", "number_of_returns"):
        las[name] = np.ones(len(points), np.uint8)
    for name, values in (standard | extra).items():
        las[name] = values
    with path.open("wb") as stream, np.errstate(over="ignore"):
        las.write(
            stream, do_compress=packed, laz_backend=laspy.LazBackend.Lazrs if packed else None
        )


def _cloud(points: Any, notes: tuple[str, ...]) -> PointCloud:
    normals, attributes = las_dimensions(points)
    with np.errstate(over="ignore"):  # what is infinite is unobserved
        xyz = np.stack([np.asarray(points[axis], dtype=np.float64) for axis in AXES], axis=-1)
    withheld = attributes.pop("withheld", None)
    if withheld is not None:
        kept = withheld == 0
        notes += (
            f"{np.count_nonzero(~kept)} of {len(xyz)} points are marked as withheld: left out",
        )
        xyz = xyz[kept]
        normals = None if normals is None else normals[kept]
        attributes = {name: values[kept] for name, values in attributes.items()}
    return PointCloud(xyz, None, None, normals, attributes, notes)


def _check_header(path: Path, stream: IO[bytes]) -> bool:
    """Refuse what is no LAS file; tell whether it is compressed."""
    head = stream.read(_SMALLEST_HEADER)
    if head[:4] != b"LASF":
        raise InputError(f"{path}: not a LAS file, its first bytes are {head[:8]!r}")
    if len(head) < _SMALLEST_HEADER:
        raise InputError(f"{path}: cut short: a header of {len(head)} bytes")
    size = path.stat().st_size
    start, records = struct.unpack_from("<II", head, 96)
    if start > size or 54 * records > size:
        raise InputError(
            f"{path}: cut short: {records:,} records and points from byte {start:,} on promised, "
            f"{size:,} bytes found"
        )
    return bool(head[104] & _LAZ)


@contextmanager
def _panics(path: Path) -> Iterator[None]:
    """Turn the panics of lazrs, which are no Exception, into an InputError."""
    try:
        yield
    except BaseException as error:
        if type(error).__name__ != "PanicException":
            raise
        raise InputError(f"{path}: cannot be read as a LAS file: {error}") from error


def _steps(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Scales and offsets (3,) that the coordinates fit with."""
    if not len(points):
        return np.full(3, 1e-3), np.zeros(3)
    low, high = points.min(axis=0), points.max(axis=0)
    side = float((high - low).max())
    if side == 0.0:
        return np.full(3, 1e-3), low
    # Half of it lies on either side of the offset, which leaves room for rounding that.
    scale = 10.0 ** math.ceil(math.log10(max(side / LARGEST, np.finfo(float).tiny)))
    unit = 10.0 ** math.floor(math.log10(side))
    return np.full(3, scale), np.rint(0.5 * (low + high) / unit) * unit


def _placed(las: Any, columns: Columns, coloured: bool) -> tuple[Columns, Columns]:
    """Tell what has a dimension of LAS from what needs one of its own, which gets its type."""
    dimensions = {each.name: each for each in las.header.point_format.standard_dimensions}
    standard: Columns = {}
    extra: Columns = {}
    # Names that laspy's clouds have a meaning of their own for.
    names = Names((*dimensions, *AXES, *dir(las)))
    for name, values in columns.items():
        if coloured and name in COLOURS:
            standard[name] = values.astype(np.uint16) * _WRITTEN_SCALE
        elif name in dimensions and name not in COLOURS and _fits(values, dimensions[name]):
            standard[name] = values
        else:
            # A colon is what divides fields of the format's records in memory.
            kept = names.free(name.replace(":", "_")[:_LONGEST_NAME])
            while len(kept) > _LONGEST_NAME:
                kept = names.free(kept[: _LONGEST_NAME - 6])
            if values.dtype.kind == "b":
                values = values.astype(np.uint8)
            elif values.dtype.kind == "f" and values.dtype.itemsize not in (4, 8):
                values = values.astype(np.float32 if values.dtype.itemsize < 4 else np.float64)
            extra[kept] = values
    return standard, extra


def _fits(values: NDArray[Any], dimension: Any) -> bool:
    """Whether a dimension of LAS holds all of the values as they are."""
    if dimension.kind.name == "FloatingPoint":
        return values.dtype.kind == "f" and values.dtype.itemsize <= dimension.num_bits // 8
    if values.dtype.kind not in "iub":
        return False
    return not values.size or bool(values.min() >= dimension.min and values.max() <= dimension.max)
