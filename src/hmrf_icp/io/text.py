"""Clouds as text, a point a line: XYZ, XYZN, ASC, PTS, CSV, TXT."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.errors import InputError
from hmrf_icp.io.columns import (
    AXES,
    PLY_NORMALS,
    Columns,
    Names,
    bytes_of_colours,
    cloud_of,
    columns_of,
    one_number_a_column,
    unpacked_colours,
)
from hmrf_icp.io.files import reading
from hmrf_icp.io.pts import columns_of_pts, read_counted
from hmrf_icp.io.text_header import (
    coordinate_columns,
    delimiter,
    is_number,
    named_colours,
    names_in,
    normal_columns,
    refuse_grid,
    words_in,
)
from hmrf_icp.io.words import understood

_INTEGER = re.compile(r"[-+]?[0-9]{1,18}")
_SHOWN = 20
"""Columns in a message, at most."""


@dataclass(frozen=True)
class _Table:
    """What a file holds: where its numbers are, and what they are called."""

    columns: dict[str, int]
    """Place of each column that has a name: x, y, z, those of a normal, and what the file calls."""
    rows: list[tuple[int, str]]
    """Lines that hold points, with their numbers."""


def read_text(path: Path) -> PointCloud:
    """Read points from lines of numbers.

    The numbers stand apart by commas, semicolons or white space. A header line
    is optional: without one the first three columns are x, y and z (and the
    next three a normal in XYZN). PTS begins with the number of its points, and they may have an
    intensity, a colour, or both behind the coordinates. With a header they are those called
    x, y, z, or in another common way (``px``, ``POINT_X``, ``Points:0``, ``x [m]``, ``Easting``);
    columns ``nx``, ``ny``, ``nz`` or ``normal_x`` and so on are normals, and others that hold
    numbers alone are attributes. Lines that start with ``#`` or ``//`` are comments,
    but one before the points that names x, y and z is a header.

    Raises
    ------
    InputError
        Not text, a header that does not tell which columns are x, y and z (the
        message lists those it found), or a line without three numbers (the message has its number).
    """
    with reading(path, "a text file of points"):
        # utf-8-sig: spreadsheets put a byte order mark in front of the first column.
        lines = path.read_text(encoding="utf-8-sig").splitlines()
        numbered = [(n, line) for n, line in enumerate(lines, 1)]
        suffix = path.suffix.lower()
        if suffix == ".pts":
            table = _Table(*read_counted(path, numbered))
        else:
            if suffix == ".asc":
                refuse_grid(path, lines)
            table = _table(path, numbered)
        columns = bytes_of_colours(_numbers(path, table))
        points = np.stack([columns.pop(axis) for axis in AXES], axis=-1)
        return cloud_of(points, columns)


def write_text(path: Path, cloud: PointCloud) -> None:
    """Write the observed points, every digit of them; in a CSV with a header and all they have."""
    csv = path.suffix.lower() == ".csv"
    columns: Columns = dict(zip(AXES, np.moveaxis(cloud.points, -1, 0), strict=True))
    if csv:
        others = unpacked_colours(columns_of(cloud, PLY_NORMALS))
        for name, column in one_number_a_column(others, len(cloud.shape)).items():
            columns[f"_{name}" if is_number(name) else name] = column
    elif path.suffix.lower() == ".xyzn" and cloud.normals is not None:
        columns |= dict(zip(PLY_NORMALS, np.moveaxis(cloud.normals, -1, 0), strict=True))
    elif path.suffix.lower() == ".pts":
        columns |= columns_of_pts(cloud)
    mark = "," if csv else " "
    # Python writes the shortest digits that read back the same, in a fifth of NumPy's time.
    values = [_written(column[cloud.observed]).tolist() for column in columns.values()]
    lines = [mark.join(map(repr, row)) + "\n" for row in zip(*values, strict=True)]
    with path.open("w", encoding="utf-8", newline="\n") as stream:
        stream.writelines([f"{len(lines)}\n"] * (path.suffix.lower() == ".pts"))
        stream.writelines([mark.join(columns) + "\n"] * csv + lines)


def _written(values: NDArray[Any]) -> NDArray[Any]:
    return values.astype(np.uint8) if values.dtype.kind == "b" else values


def _table(path: Path, lines: list[tuple[int, str]]) -> _Table:
    """Tell the header from the points, and the columns apart."""
    columns = dict(zip(AXES, range(3), strict=True))
    if path.suffix.lower() == ".xyzn":
        columns |= dict(zip(PLY_NORMALS, range(3, 6), strict=True))
    rows: list[tuple[int, str]] = []
    title: tuple[int, list[str]] | None = None
    for number, line in lines:
        bare = line.strip()
        comment = bare.startswith(("#", "//"))
        if not rows and bare and (comment or not any(map(is_number, words_in(understood(bare))))):
            names = names_in(bare)
            found = coordinate_columns(names)
            if found is not None:
                columns, title = _named(named_colours(names), found), None
                continue
            if not comment and number == 1:
                # A title is passed over, on the first line only; whether it is one, a row tells.
                title, comment = (number, names), True
        if bare and not comment:
            rows.append((number, understood(line)))
    if not rows:
        raise InputError(f"{path}: no points in it")
    if title is not None and len(title[1]) >= max(3, len(words_in(rows[0][1]))):
        shown = ", ".join(repr(name) for name in title[1][:_SHOWN])
        more = f" and {len(title[1]) - _SHOWN} more" if len(title[1]) > _SHOWN else ""
        raise InputError(
            f"{path}: line {title[0]} names the columns {shown}{more}, which does not tell which "
            "are the coordinates; call those x, y and z, metres (or remove the line if they are "
            "the first three)"
        )
    return _Table(columns, rows)


def _named(names: list[str], coordinates: list[int]) -> dict[str, int]:
    columns = dict(zip(AXES, coordinates, strict=True))
    normals = normal_columns(names)
    if normals is not None:
        columns |= dict(zip(PLY_NORMALS, normals, strict=True))
    free = Names(columns)
    known = set(columns.values())
    for place, name in enumerate(names):
        if place not in known and name:
            columns[free.free(name)] = place
    return columns


def _numbers(path: Path, table: _Table) -> Columns:
    """Columns of numbers; those beside the coordinates only where each of their rows has one."""
    mark = delimiter(table.rows[0][1])
    first = words_in(table.rows[0][1])
    kinds: dict[str, type] = dict.fromkeys(AXES, np.float64)
    for name, place in table.columns.items():
        if name not in AXES and place < len(first) and is_number(first[place]):
            whole = name not in PLY_NORMALS and _INTEGER.fullmatch(first[place])
            kinds[name] = np.int64 if whole else np.float64
    try:
        return _loaded(table, kinds, mark)
    except ValueError:
        pass
    try:
        columns = _loaded(table, dict.fromkeys(AXES, np.float64), mark)
    except ValueError:
        places = [table.columns[axis] for axis in AXES]
        for number, line in table.rows:
            if not _holds_point(line, mark, places):
                raise InputError(
                    f"{path}: line {number} should hold three numbers or more, "
                    f"found {line.strip()[:60]!r}"
                ) from None
        raise
    for name in kinds:
        if name not in AXES:
            columns |= _column_alone(table, name, mark)
    return columns


def _column_alone(table: _Table, name: str, mark: str | None) -> Columns:
    for kind in (np.int64, np.float64):
        try:
            return _loaded(table, {name: kind}, mark)
        except ValueError:
            continue
    return {}


def _loaded(table: _Table, kinds: Mapping[str, type], mark: str | None) -> Columns:
    with warnings.catch_warnings():
        # NumPy before 2.3 cuts 1.5 to an integer, and warns of it.
        warnings.simplefilter("error", DeprecationWarning)
        try:
            loaded = np.loadtxt(
                [line for _, line in table.rows],
                dtype=[(f"f{place}", kind) for place, kind in enumerate(kinds.values())],
                delimiter=mark,
                usecols=[table.columns[name] for name in kinds],
                comments=None,
                quotechar='"' if '"' in table.rows[0][1] else None,
                ndmin=1,
            )
        except DeprecationWarning as warning:
            raise ValueError(str(warning)) from None
    return {name: loaded[f"f{place}"] for place, name in enumerate(kinds)}


def _holds_point(line: str, mark: str | None, places: list[int]) -> bool:
    words = line.split(mark)
    return max(places) < len(words) and all(is_number(words[place]) for place in places)
