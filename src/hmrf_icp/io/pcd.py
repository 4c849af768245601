"""PCD, the files of the Point Cloud Library: ASCII, binary and binary_compressed.

Read and written here: pypcd4, the one package for them that is kept up, needs
python-lzf, which is published without wheels and so needs a C compiler, and pydantic.

What VIEWPOINT means is read in two ways by that library itself: its normals
take the translation for the place of the sensor among the points, its viewer
moves the points by it. The points are never moved here. The translation
becomes the cloud's viewpoint where the rotation is the identity and the two
readings differ least; ``0 0 0 1 0 0 0`` is what every program writes that knows nothing,
merged maps included, and says nothing. For the same reason nothing else is written: a viewer
would move an aligned cloud off its target.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.errors import InputError
from hmrf_icp.io.columns import (
    AXES,
    PCD_NORMALS,
    Columns,
    Names,
    cloud_of,
    columns_of,
    packed_colours,
    storable,
)
from hmrf_icp.io.files import reading, require_bounded
from hmrf_icp.io.lzf import decompress
from hmrf_icp.io.pcd_header import Field, Header, parse_header
from hmrf_icp.io.words import understood

ROUNDING = 1e-4
"""Single precision is what readers of PCD expect; coordinates it would move by more than this many
metres (a map's northings, say) are written in double."""


def read_pcd(path: Path) -> PointCloud:
    """Read a PCD file: x, y and z, and every other field; organised where its HEIGHT is above 1.

    Raises
    ------
    InputError
        The header is not one of a PCD file, or the points are fewer than it promises.
    """
    with reading(path, "a PCD file"):
        data = path.read_bytes()
        header = parse_header(path, data)
        body = data[header.body :]
        if header.data == "ascii":
            columns = _ascii(path, header, body)
        elif header.data == "binary":
            columns = _binary(path, header, body)
        else:
            columns = _compressed(path, header, body)
        points = np.empty((header.points, 3))
        # A NaN that signals is as good as any other.
        with np.errstate(invalid="ignore"):
            for axis, name in enumerate(AXES):
                points[:, axis] = columns.pop(name)
        grid: tuple[int, ...] = (header.points,)
        if header.height > 1 and header.width > 1:
            grid = (header.height, header.width)
        columns = {n: values.reshape(*grid, *values.shape[1:]) for n, values in columns.items()}
        return cloud_of(points.reshape(*grid, 3), columns, header.viewpoint)


def write_pcd(path: Path, cloud: PointCloud) -> None:
    """Write a binary PCD file; an organised cloud keeps its grid, NaN where unobserved."""
    points = cloud.points.reshape(-1, 3)
    with np.errstate(over="ignore"):
        single = points.astype("<f4")
    exact = bool(np.nanmax(np.abs(single - points), initial=0.0) <= ROUNDING)
    width, height = (cloud.shape[1], cloud.shape[0]) if cloud.organised else (len(points), 1)
    columns: Columns = dict(zip(AXES, (single if exact else points).T, strict=True))
    others = packed_colours(columns_of(cloud, PCD_NORMALS))
    for name, values in others.items():
        flat = values.reshape(len(points), *values.shape[len(cloud.shape) :])
        of_normals = name in PCD_NORMALS and cloud.normals is not None
        with np.errstate(over="ignore", invalid="ignore"):
            columns[name] = flat.astype(np.float32) if of_normals else storable(flat)
    kinds = [
        (name, values.dtype.newbyteorder("<"), values.shape[1:]) for name, values in columns.items()
    ]
    table = np.empty(len(points), dtype=kinds)
    for name, values in columns.items():
        table[name] = values
    header = (
        "# .PCD v0.7 - Point Cloud Data file format\n"
        f"VERSION 0.7\nFIELDS {' '.join(columns)}\n"
        f"SIZE {' '.join(str(kind.itemsize) for _, kind, _ in kinds)}\n"
        f"TYPE {' '.join(kind.kind.upper() for _, kind, _ in kinds)}\n"
        f"COUNT {' '.join(str(shape[0] if shape else 1) for *_, shape in kinds)}\n"
        f"WIDTH {width}\nHEIGHT {height}\n"
        "VIEWPOINT 0 0 0 1 0 0 0\n"
        f"POINTS {len(points)}\n"
        "DATA binary\n"
    )
    path.write_bytes(header.encode("ascii") + table.tobytes())


def _promised(path: Path, header: Header, found: int) -> InputError:
    return InputError(
        f"{path}: cut short: the PCD header promises {header.points} points, the file holds {found}"
    )


def _kept(header: Header) -> dict[str, Field]:
    """Give each field that is read a name that it has alone."""
    kept = {}
    for field in reversed(header.fields):  # x, y and z are the first of that name
        if field.name in AXES:
            kept[field.name] = field
    names = Names(AXES)
    for field in header.fields:
        if field.kept and field is not kept.get(field.name):
            kept[names.free(field.name)] = field
    return kept


def _ascii(path: Path, header: Header, body: bytes) -> Columns:
    lines = [line for line in understood(body.decode("ascii")).splitlines() if line.strip()]
    if len(lines) < header.points:
        raise _promised(path, header, len(lines))
    rows = lines[: header.points]
    for number, row in enumerate(rows, 1):
        if len(row.split()) != header.numbers:
            raise InputError(
                f"{path}: point {number} has {len(row.split())} numbers, the PCD header promises "
                f"{header.numbers}"
            )
    kept = _kept(header)
    if not header.points:
        return dict.fromkeys(kept, np.empty(0))
    kinds = [(f"f{i}", *_text_kind(field)) for i, field in enumerate(kept.values())]
    places = [field.first + k for field in kept.values() for k in range(field.count)]
    try:
        table = np.loadtxt(rows, dtype=kinds, usecols=places, comments=None, ndmin=1)
    except ValueError:
        # Integers that are none, or too large, in fields that nobody has to have.
        kinds = [(name, np.dtype(np.float64), shape) for name, _, shape in kinds]
        table = np.loadtxt(rows, dtype=kinds, usecols=places, comments=None, ndmin=1)
    return {name: table[f"f{i}"] for i, name in enumerate(kept)}


def _text_kind(field: Field) -> tuple[np.dtype[Any], tuple[int, ...]]:
    kind = field.dtype if field.name not in AXES and field.type != "F" else np.dtype(np.float64)
    if field.name in ("rgb", "rgba") and field.type == "F":
        kind = np.dtype(np.float32)  # four bytes of colour in the disguise of a number
    return kind, () if field.count == 1 else (field.count,)


def _binary(path: Path, header: Header, body: bytes) -> Columns:
    if len(body) < header.points * header.stride:
        raise _promised(path, header, len(body) // header.stride)
    return {
        name: np.ndarray(
            (header.points, field.count)[: 1 + (field.count > 1)],
            field.dtype,
            body,
            offset=field.offset,
            strides=(header.stride, field.size)[: 1 + (field.count > 1)],
        )
        for name, field in _kept(header).items()
    }


def _compressed(path: Path, header: Header, body: bytes) -> Columns:
    """Each field's numbers stand together, one field after the other."""
    if len(body) < 8:
        raise _promised(path, header, 0)
    packed, unpacked = (int(size) for size in np.frombuffer(body, "<u4", 2))
    if len(body) - 8 < packed:
        raise InputError(
            f"{path}: cut short: {packed} bytes of compressed points promised, the file holds "
            f"{len(body) - 8}"
        )
    if unpacked < header.points * header.stride:
        raise _promised(path, header, unpacked // header.stride)
    require_bounded(path, packed, unpacked)
    fields = decompress(body[8 : 8 + packed], unpacked)
    columns: Columns = {}
    for name, field in _kept(header).items():
        values = np.frombuffer(
            fields, field.dtype, header.points * field.count, header.points * field.offset
        )
        columns[name] = values if field.count == 1 else values.reshape(header.points, field.count)
    return columns
