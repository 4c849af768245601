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

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.errors import InputError
from hmrf_icp.io.files import reading
from hmrf_icp.io.lzf import decompress

_KEYS = (
    "VERSION",
    "FIELDS",
    "SIZE",
    "TYPE",
    "COUNT",
    "WIDTH",
    "HEIGHT",
    "VIEWPOINT",
    "POINTS",
    "DATA",
)
_LONGEST_HEADER = 1 << 16
_KINDS = {"F": "f", "I": "i", "U": "u"}

ROUNDING = 1e-4
"""Single precision is what readers of PCD expect; coordinates it would move by more than this many
metres (a map's northings, say) are written in double."""


@dataclass(frozen=True)
class _Header:
    fields: list[str]
    sizes: list[int]
    types: list[str]
    counts: list[int]
    width: int
    height: int
    viewpoint: NDArray[np.float64] | None
    data: str
    body: int
    """Where the points start in the file, bytes."""

    @property
    def points(self) -> int:
        return self.width * self.height

    @property
    def columns(self) -> list[int]:
        """Which of a point's numbers are x, y and z."""
        return [sum(self.counts[: self.fields.index(axis)]) for axis in "xyz"]

    def dtype(self, axis: str) -> np.dtype[np.generic]:
        index = self.fields.index(axis)
        return np.dtype(f"<{_KINDS[self.types[index]]}{self.sizes[index]}")

    def offset(self, axis: str) -> int:
        """Bytes of a point that stand before ``axis``."""
        index = self.fields.index(axis)
        return sum(s * c for s, c in zip(self.sizes[:index], self.counts[:index], strict=True))

    @property
    def stride(self) -> int:
        """Bytes of a point."""
        return sum(s * c for s, c in zip(self.sizes, self.counts, strict=True))


def read_pcd(path: Path) -> PointCloud:
    """Read x, y and z of a PCD file; organised where its HEIGHT is above 1.

    Raises
    ------
    InputError
        The header is not one of a PCD file, or the points are fewer than it promises.
    """
    with reading(path, "a PCD file"):
        data = path.read_bytes()
        header = _parse_header(path, data)
        body = data[header.body :]
        if header.data == "ascii":
            points = _ascii(path, header, body)
        elif header.data == "binary":
            points = _binary(path, header, body)
        else:
            points = _compressed(path, header, body)
        if header.height > 1 and header.width > 1:
            points = points.reshape(header.height, header.width, 3)
        return PointCloud(points, viewpoint=header.viewpoint)


def write_pcd(path: Path, cloud: PointCloud) -> None:
    """Write a binary PCD file; an organised cloud keeps its grid, NaN where unobserved."""
    points = cloud.points.reshape(-1, 3)
    with np.errstate(over="ignore"):
        single = points.astype("<f4")
    exact = bool(np.nanmax(np.abs(single - points), initial=0.0) <= ROUNDING)
    width, height = (cloud.shape[1], cloud.shape[0]) if cloud.organised else (len(points), 1)
    size = 4 if exact else 8
    header = (
        "# .PCD v0.7 - Point Cloud Data file format\n"
        "VERSION 0.7\nFIELDS x y z\n"
        f"SIZE {size} {size} {size}\n"
        "TYPE F F F\nCOUNT 1 1 1\n"
        f"WIDTH {width}\nHEIGHT {height}\n"
        "VIEWPOINT 0 0 0 1 0 0 0\n"
        f"POINTS {len(points)}\n"
        "DATA binary\n"
    )
    body = single if exact else points.astype("<f8")
    path.write_bytes(header.encode("ascii") + body.tobytes())


def _parse_header(path: Path, data: bytes) -> _Header:
    entries: dict[str, list[str]] = {}
    at = 0
    while "DATA" not in entries:
        end = data.find(b"\n", at, _LONGEST_HEADER)
        if end < 0:
            raise InputError(f"{path}: not a PCD file, or cut short: its header has no DATA line")
        words = data[at:end].decode("ascii", "replace").split()
        at = end + 1
        if not words or words[0].startswith("#"):
            continue
        if words[0] not in _KEYS:
            raise InputError(f"{path}: not a PCD file: its header has a line {words[0][:40]!r}")
        entries[words[0]] = words[1:]

    def numbers(key: str, default: list[int] | None = None) -> list[int]:
        if key not in entries and default is not None:
            return default
        try:
            values = [int(word) for word in entries[key]]
        except (KeyError, ValueError):
            raise InputError(
                f"{path}: the PCD header needs whole numbers for {key}, found "
                + (" ".join(entries[key]) if key in entries else "no such line")
            ) from None
        if not values or min(values) < 0:
            raise InputError(f"{path}: the PCD header has {key} {' '.join(entries[key])}")
        return values

    fields = entries.get("FIELDS", [])
    missing = [axis for axis in "xyz" if axis not in fields]
    if missing:
        raise InputError(
            f"{path}: the PCD file has no field {' or '.join(missing)}, only: {' '.join(fields)}"
        )
    sizes, types = numbers("SIZE"), entries.get("TYPE", [])
    counts = numbers("COUNT", [1] * len(fields))
    if not len(fields) == len(sizes) == len(types) == len(counts):
        raise InputError(f"{path}: FIELDS, SIZE, TYPE and COUNT of the PCD header differ in length")
    for axis in "xyz":
        index = fields.index(axis)
        kind = (types[index], sizes[index])
        known = kind[0] in _KINDS and kind[1] in ((4, 8) if kind[0] == "F" else (1, 2, 4, 8))
        if not known or counts[index] != 1:
            raise InputError(
                f"{path}: the PCD field {axis} is of TYPE {kind[0]}, SIZE {kind[1]}, "
                f"COUNT {counts[index]}; expected one number such as F of 4 bytes"
            )
    height = numbers("HEIGHT", [1])[0]
    width = numbers("WIDTH", numbers("POINTS", [-1]))[0]
    promised = numbers("POINTS", [width * height])[0]
    if width < 0 or promised != width * height:
        raise InputError(
            f"{path}: the PCD header promises {promised} points on a grid of {width} x {height}"
        )
    kind_of_data = " ".join(entries["DATA"])
    if kind_of_data not in ("ascii", "binary", "binary_compressed"):
        raise InputError(f"{path}: the PCD file has DATA {kind_of_data!r}, which is not known")
    viewpoint = _viewpoint(path, entries.get("VIEWPOINT", []))
    return _Header(fields, sizes, types, counts, width, height, viewpoint, kind_of_data, at)


def _viewpoint(path: Path, words: list[str]) -> NDArray[np.float64] | None:
    """Where the sensor stood among the points, as far as the header tells (see the module)."""
    try:
        pose = np.array(words, dtype=np.float64)
    except ValueError:
        raise InputError(f"{path}: the PCD header has VIEWPOINT {' '.join(words)}") from None
    if pose.shape != (7,) or not np.isfinite(pose).all():
        return None
    translation, quaternion = pose[:3], pose[3:]
    if not translation.any() or not np.allclose(np.abs(quaternion), (1.0, 0.0, 0.0, 0.0)):
        return None
    return translation


def _promised(path: Path, header: _Header, found: int) -> InputError:
    return InputError(
        f"{path}: cut short: the PCD header promises {header.points} points, the file holds {found}"
    )


def _ascii(path: Path, header: _Header, body: bytes) -> NDArray[np.float64]:
    lines = [line for line in body.decode("ascii").splitlines() if line.strip()]
    if len(lines) < header.points:
        raise _promised(path, header, len(lines))
    if not header.points:
        return np.empty((0, 3))
    width = sum(header.counts)
    rows = lines[: header.points]
    for number, row in enumerate(rows, 1):
        if len(row.split()) != width:
            raise InputError(
                f"{path}: point {number} has {len(row.split())} numbers, the PCD header promises "
                f"{width}"
            )
    return np.loadtxt(rows, dtype=np.float64, usecols=header.columns, ndmin=2)


def _binary(path: Path, header: _Header, body: bytes) -> NDArray[np.float64]:
    if len(body) < header.points * header.stride:
        raise _promised(path, header, len(body) // header.stride)
    return _columns(
        header,
        [
            np.ndarray(
                header.points,
                header.dtype(axis),
                body,
                offset=header.offset(axis),
                strides=(header.stride,),
            )
            for axis in "xyz"
        ],
    )


def _compressed(path: Path, header: _Header, body: bytes) -> NDArray[np.float64]:
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
    fields = decompress(body[8 : 8 + packed], unpacked)
    return _columns(
        header,
        [
            np.frombuffer(
                fields, header.dtype(axis), header.points, header.points * header.offset(axis)
            )
            for axis in "xyz"
        ],
    )


def _columns(header: _Header, columns: list[NDArray[np.generic]]) -> NDArray[np.float64]:
    points = np.empty((header.points, 3))
    # A NaN that signals is as good as any other.
    with np.errstate(invalid="ignore"):
        for axis, column in enumerate(columns):
            points[:, axis] = column
    return points
