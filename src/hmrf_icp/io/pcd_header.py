"""The header of a PCD file, in the dialects that are about.

The Point Cloud Library reads more than its description says: ``COLUMNS`` for ``FIELDS`` (the name
until version .5), a ``TYPE`` in lower case, headers of text without ``SIZE`` and ``TYPE``.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.errors import InputError

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
_OLD_KEYS = {"COLUMNS": "FIELDS"}
_LONGEST_HEADER = 1 << 16
_KINDS = {"F": "f", "I": "i", "U": "u"}
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_PADDING = "_"
"""Name of the fields that hold nothing."""


@dataclass(frozen=True)
class Field:
    """``count`` numbers of each point."""

    name: str
    size: int
    """Bytes of a number."""
    type: str
    count: int
    first: int
    """Numbers of a point that stand before."""
    offset: int
    """Bytes of a point that stand before."""

    @property
    def known(self) -> bool:
        """Whether it holds numbers of a type that NumPy has."""
        return self.type in _KINDS and self.size in ((4, 8) if self.type == "F" else (1, 2, 4, 8))

    @property
    def kept(self) -> bool:
        """Whether anything of it goes into the cloud."""
        return self.known and self.name != _PADDING and self.count > 0

    @property
    def dtype(self) -> np.dtype[Any]:
        """Of one number."""
        return np.dtype(f"<{_KINDS[self.type]}{self.size}")


@dataclass(frozen=True)
class Header:
    """What the file says of its points, before they come."""

    fields: tuple[Field, ...]
    width: int
    height: int
    viewpoint: NDArray[np.float64] | None
    data: str
    """``ascii``, ``binary`` or ``binary_compressed``."""
    body: int
    """Where the points start in the file, bytes."""

    @property
    def points(self) -> int:
        """How many there are."""
        return self.width * self.height

    @property
    def numbers(self) -> int:
        """Numbers of a point."""
        return sum(field.count for field in self.fields)

    @property
    def stride(self) -> int:
        """Bytes of a point."""
        return sum(field.size * field.count for field in self.fields)


def parse_header(path: Path, data: bytes) -> Header:
    """Read the header at the front of ``data``, the bytes of a file.

    Raises
    ------
    InputError
        It is not one of a PCD file with the fields x, y and z, or contradicts itself.
    """
    entries, body = _entries(path, data)
    kind = " ".join(entries["DATA"]).lower()
    if kind not in ("ascii", "binary", "binary_compressed"):
        raise InputError(f"{path}: the PCD file has DATA {kind!r}, which is not known")
    fields = _fields(path, entries, text=kind == "ascii")
    height = _numbers(path, entries, "HEIGHT", [1])[0]
    width = _numbers(path, entries, "WIDTH", _numbers(path, entries, "POINTS", [-1]))[0]
    promised = _numbers(path, entries, "POINTS", [width * height])[0]
    if width < 0 or promised != width * height:
        raise InputError(
            f"{path}: the PCD header promises {promised} points on a grid of {width} x {height}"
        )
    viewpoint = _viewpoint(path, entries.get("VIEWPOINT", []))
    return Header(fields, width, height, viewpoint, kind, body)


def _entries(path: Path, data: bytes) -> tuple[dict[str, list[str]], int]:
    """Words of each line by the first of them, and where the lines end."""
    entries: dict[str, list[str]] = {}
    at = len(_BYTE_ORDER_MARK) if data.startswith(_BYTE_ORDER_MARK) else 0
    while "DATA" not in entries:
        end = data.find(b"\n", at, _LONGEST_HEADER)
        if end < 0:
            raise InputError(f"{path}: not a PCD file, or cut short: its header has no DATA line")
        words = data[at:end].decode("ascii", "replace").split()
        at = end + 1
        if not words or words[0].startswith("#"):
            continue
        key = words[0].upper()
        key = _OLD_KEYS.get(key, key)
        if key not in _KEYS:
            raise InputError(f"{path}: not a PCD file: its header has a line {words[0][:40]!r}")
        if key in entries:
            raise InputError(f"{path}: the PCD header has two lines {key}, expected one")
        entries[key] = words[1:]
    return entries, at


def _numbers(
    path: Path, entries: dict[str, list[str]], key: str, default: list[int] | None = None
) -> list[int]:
    if key not in entries and default is not None:
        return default
    found = " ".join(entries[key])[:80] if key in entries else "no such line"
    try:
        values = [int(word) for word in entries[key]]
    except (KeyError, ValueError):
        raise InputError(
            f"{path}: the PCD header needs whole numbers for {key}, found {found}"
        ) from None
    if not values or min(values) < 0:
        raise InputError(f"{path}: the PCD header has {key} {found}")
    return values


def _fields(path: Path, entries: dict[str, list[str]], text: bool) -> tuple[Field, ...]:
    names = entries.get("FIELDS", [])
    missing = [axis for axis in "xyz" if axis not in names]
    if missing:
        found = " ".join(names)[:200]
        raise InputError(f"{path}: the PCD file has no field {' or '.join(missing)}, only: {found}")
    sizes = _numbers(path, entries, "SIZE", [4] * len(names) if text else None)
    types = [word.upper() for word in entries.get("TYPE", ["F"] * len(names) if text else [])]
    counts = _numbers(path, entries, "COUNT", [1] * len(names))
    if not len(names) == len(sizes) == len(types) == len(counts):
        raise InputError(f"{path}: FIELDS, SIZE, TYPE and COUNT of the PCD header differ in length")
    fields: list[Field] = []
    first = offset = 0
    for name, size, kind, count in zip(names, sizes, types, counts, strict=True):
        fields.append(Field(name, size, kind, count, first, offset))
        first, offset = first + count, offset + size * count
    for field in fields:
        if field.name in ("x", "y", "z") and not (field.known and field.count == 1):
            raise InputError(
                f"{path}: the PCD field {field.name} is of TYPE {field.type}, SIZE {field.size}, "
                f"COUNT {field.count}; expected one number such as F of 4 bytes"
            )
    return tuple(fields)


def _viewpoint(path: Path, words: list[str]) -> NDArray[np.float64] | None:
    """Where the sensor stood among the points, as far as the header tells (see `pcd`)."""
    try:
        pose = np.array(words, dtype=np.float64)
    except ValueError:
        found = " ".join(words)[:80]
        raise InputError(f"{path}: the PCD header has VIEWPOINT {found}") from None
    if pose.shape != (7,) or not np.isfinite(pose).all():
        return None
    translation, quaternion = pose[:3], pose[3:]
    if not translation.any() or not np.allclose(np.abs(quaternion), (1.0, 0.0, 0.0, 0.0)):
        return None
    return translation
