"""The body of a PLY file: the rows of its elements, one element after the other.

Rows without lists are one NumPy structure each and are not copied. Rows with
lists are so as well where all lists have the length of the first (the
triangles of a mesh); only where they differ are they walked one by one.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.errors import InputError
from hmrf_icp.io.ply_header import ASCII, Element, Header
from hmrf_icp.io.words import understood


@dataclass(frozen=True)
class Column:
    """The numbers of one property in all rows."""

    values: NDArray[Any]
    """One a row, or the numbers of all lists, end to end."""
    lengths: NDArray[np.int64] | None = None
    """How many numbers each row lists; None where there is one a row."""


def read_columns(
    path: Path, header: Header, data: bytes, wanted: Mapping[str, Collection[str]]
) -> dict[str, dict[str, Column]]:
    """Read the properties ``wanted`` of each element, and step over all else.

    Parameters
    ----------
    path
        For the messages.
    header
        As it was read from ``data``.
    data
        The whole file.
    wanted
        Properties by element; those that the file does not have are left out.

    Raises
    ------
    InputError
        An element, wanted or not, has fewer rows than the header promises; a
        row of text is malformed, with the number of its line.
    """
    if header.order == ASCII:
        return _read_text(path, header, data, wanted)
    columns = {}
    at = header.body
    for name, element in header.elements.items():
        columns[name], at = _binary_rows(path, header, element, data, at, wanted.get(name, ()))
    return columns


def _cut_short(path: Path, element: Element, found: int) -> InputError:
    return InputError(
        f"{path}: cut short: the PLY header promises {element.count} of element "
        f"{element.name!r}, the file holds {found}"
    )


# ---- Binary -----------------------------------------------------------------------------------


def _binary_rows(
    path: Path, header: Header, element: Element, data: bytes, at: int, wanted: Collection[str]
) -> tuple[dict[str, Column], int]:
    """Columns of the element that starts at byte ``at``, and where it ends."""
    lengths: dict[str, int] = {}
    if element.has_lists and element.count:
        places, _ = _Steps(path, header, element, data).over(0, at)
        lengths = {e.name: places[e.name][1] for e in element.properties if e.length is not None}
    row = _layout(header, element, lengths)
    if element.count == 0:
        rows = np.empty(0, row)
    elif len(data) - at >= element.count * row.itemsize:
        rows = np.ndarray(element.count, row, data, at)
    elif element.has_lists:
        return _walk(path, header, element, data, at, wanted)
    else:
        raise _cut_short(path, element, (len(data) - at) // row.itemsize)
    if any((rows[_length_of(name)] != length).any() for name, length in lengths.items()):
        return _walk(path, header, element, data, at, wanted)
    columns: dict[str, Column] = {}
    for each in element.properties:
        if each.name not in wanted:
            continue
        if each.length is None:
            columns[each.name] = Column(rows[each.name])
        else:
            sizes = np.full(element.count, lengths.get(each.name, 0), dtype=np.int64)
            columns[each.name] = Column(rows[each.name].reshape(-1), sizes)
    return columns, at + element.count * row.itemsize


def _length_of(name: str) -> str:
    # No property has a blank in its name, so that this one is free.
    return f"length of {name}"


def _layout(header: Header, element: Element, lengths: Mapping[str, int]) -> np.dtype[np.void]:
    """Structure of a row whose lists have these lengths."""
    fields: list[Any] = []
    for each in element.properties:
        if each.length is None:
            fields.append((each.name, header.order + each.code))
        else:
            fields.append((_length_of(each.name), header.order + each.length))
            fields.append((each.name, header.order + each.code, (lengths.get(each.name, 0),)))
    return np.dtype(fields)


class _Steps:
    """How to get from one property of a row to the next."""

    def __init__(self, path: Path, header: Header, element: Element, data: bytes) -> None:
        self._path, self._element, self._data = path, element, data
        self._steps = [
            (
                each.name,
                np.dtype(each.code).itemsize,
                None
                if each.length is None
                else struct.Struct(header.order + np.dtype(each.length).char),
            )
            for each in element.properties
        ]

    def over(self, row: int, at: int) -> tuple[dict[str, tuple[int, int]], int]:
        """Where the numbers of each property start and how many they are; where the row ends."""
        places = {}
        for name, size, head in self._steps:
            count = 1
            if head is not None:
                if at + head.size > len(self._data):
                    raise _cut_short(self._path, self._element, row)
                (count,) = head.unpack_from(self._data, at)
                at += head.size
                if count < 0:
                    raise InputError(
                        f"{self._path}: row {row + 1} of element {self._element.name!r} has a list "
                        f"{name!r} of length {count}"
                    )
            places[name] = (at, count)
            at += count * size
        if at > len(self._data):
            raise _cut_short(self._path, self._element, row)
        return places, at


def _walk(
    path: Path, header: Header, element: Element, data: bytes, at: int, wanted: Collection[str]
) -> tuple[dict[str, Column], int]:
    """As `_binary_rows`, for lists of different lengths."""
    steps = _Steps(path, header, element, data)
    kept = [each for each in element.properties if each.name in wanted]
    places: dict[str, list[tuple[int, int]]] = {each.name: [] for each in kept}
    for row in range(element.count):
        found, at = steps.over(row, at)
        for name, rows in places.items():
            rows.append(found[name])
    columns: dict[str, Column] = {}
    for each in kept:
        starts, lengths = np.array(places[each.name], dtype=np.int64).reshape(-1, 2).T
        kind = np.dtype(header.order + each.code)
        within = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
        first = np.repeat(starts, lengths) + kind.itemsize * within
        # The numbers stand at any byte: collected byte by byte, they are numbers again.
        bytes_of = np.frombuffer(data, np.uint8)[first[:, None] + np.arange(kind.itemsize)]
        values = bytes_of.view(kind)[:, 0]
        columns[each.name] = Column(values, None if each.length is None else lengths)
    return columns, at


# ---- Text -------------------------------------------------------------------------------------


def _read_text(
    path: Path, header: Header, data: bytes, wanted: Mapping[str, Collection[str]]
) -> dict[str, dict[str, Column]]:
    """Read a body of text, a row a line; blank lines are passed over."""
    text = understood(data[header.body :].decode("ascii", "replace"))
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    full = [line for line in lines if line and not line.isspace()]
    columns: dict[str, dict[str, Column]] = {}
    end = 0
    for name, element in header.elements.items():
        start, end = end, end + element.count
        rows = full[start:end]
        if len(rows) < element.count:
            raise _cut_short(path, element, len(rows))
        if name not in wanted:
            continue
        try:
            columns[name] = _text_rows(element, rows, wanted[name])
        except ValueError:
            bad = next((n for n, row in enumerate(rows) if not _is_well_formed(element, row)), None)
            if bad is None:
                raise
            number = [n for n, line in enumerate(lines) if line and not line.isspace()][start + bad]
            form = (e.name if e.length is None else f"LENGTH {e.name}" for e in element.properties)
            raise InputError(
                f"{path}: line {header.lines + 1 + number} should hold the numbers "
                f"{' '.join(form)} of element {name!r}, found {rows[bad].strip()[:60]!r}"
            ) from None
    return columns


def _text_rows(element: Element, rows: list[str], wanted: Collection[str]) -> dict[str, Column]:
    """Columns of these lines; raises ValueError where one of them is malformed."""
    if element.has_lists:
        return _text_lists(element, rows, wanted)
    table = np.empty((0, len(element.properties)))
    if rows:
        table = np.loadtxt(rows, dtype=np.float64, comments=None, ndmin=2)
    if table.shape[1] != len(element.properties):
        raise ValueError("another number of columns")
    return {
        each.name: Column(_as_promised(table[:, index], each.code))
        for index, each in enumerate(element.properties)
        if each.name in wanted
    }


def _as_promised(values: NDArray[np.float64], code: str) -> NDArray[Any]:
    """Give integers of the header their type, if that is what the text holds."""
    kind = np.dtype(code)
    if kind.kind == "f" or not np.isfinite(values).all():
        return values
    limits = np.iinfo(kind)
    whole = (values == np.rint(values)) & (values >= limits.min) & (values <= limits.max)
    return values.astype(kind) if whole.all() else values


def _text_lists(element: Element, rows: list[str], wanted: Collection[str]) -> dict[str, Column]:
    parsed = [_text_row(element, row) for row in rows]
    columns: dict[str, Column] = {}
    for index, each in enumerate(element.properties):
        if each.name in wanted:
            lists = [row[index] for row in parsed]
            values = np.array([value for entries in lists for value in entries], dtype=np.float64)
            lengths = np.array([len(entries) for entries in lists], dtype=np.int64)
            columns[each.name] = Column(values, None if each.length is None else lengths)
    return columns


def _text_row(element: Element, row: str) -> list[list[float]]:
    """Numbers of each property of one line; raises ValueError where it is malformed."""
    words = row.split()
    numbers: list[list[float]] = []
    at = 0
    for each in element.properties:
        count = 1
        if each.length is not None:
            count = int("".join(words[at : at + 1]))
            at += 1
        entries = [float(word) for word in words[at : at + count]]
        if len(entries) != count:
            raise ValueError("fewer numbers than promised")
        numbers.append(entries)
        at += count
    if at != len(words):
        raise ValueError("more numbers than promised")
    return numbers


def _is_well_formed(element: Element, row: str) -> bool:
    try:
        _text_row(element, row)
    except ValueError:
        return False
    return True
