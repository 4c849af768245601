"""Clouds as text, a point a line: XYZ, CSV, TXT."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.errors import InputError
from hmrf_icp.io.files import reading


def read_text(path: Path) -> PointCloud:
    """Read points from lines of numbers.

    The numbers stand apart by commas, semicolons or white space. A header line
    is optional: where it names x, y and z those columns are read, otherwise the
    first three. Lines that start with ``#`` or ``//`` are comments, but one before
    the points that names x, y and z is a header.

    Raises
    ------
    InputError
        Not text, or a line without three numbers; the message has its number.
    """
    with reading(path, "a text file of points"):
        # utf-8-sig: spreadsheets put a byte order mark in front of the first column.
        lines = path.read_text(encoding="utf-8-sig").splitlines()
        columns, rows = _without_header([(n, line) for n, line in enumerate(lines, 1)])
        if not rows:
            raise InputError(f"{path}: no points in it")
        delimiter = _delimiter(rows[0][1])
        try:
            points = np.loadtxt(
                [line for _, line in rows],
                dtype=np.float64,
                delimiter=delimiter,
                usecols=columns,
                comments=None,
                ndmin=2,
            )
        except ValueError:
            for number, line in rows:
                if not _holds_point(line, delimiter, columns):
                    raise InputError(
                        f"{path}: line {number} should hold three numbers or more, "
                        f"found {line.strip()[:60]!r}"
                    ) from None
            raise
        return PointCloud(points)


def write_text(path: Path, cloud: PointCloud) -> None:
    """Write the observed points, every digit of them; with a header and commas in a CSV."""
    csv = path.suffix.lower() == ".csv"
    mark = "," if csv else " "
    # Python writes the shortest digits that read back the same, in a fifth of NumPy's time.
    lines = [mark.join(map(repr, point)) + "\n" for point in cloud.observed_points.tolist()]
    with path.open("w", encoding="utf-8", newline="\n") as stream:
        stream.writelines(["x,y,z\n"] * csv + lines)


def _without_header(
    lines: list[tuple[int, str]],
) -> tuple[list[int], list[tuple[int, str]]]:
    """Columns of x, y and z, and the lines that hold points, with their numbers."""
    columns = [0, 1, 2]
    rows: list[tuple[int, str]] = []
    for number, line in lines:
        bare = line.strip()
        comment = bare.startswith(("#", "//"))
        if not rows and bare and (comment or not any(map(_is_number, _words(bare)))):
            names = [word.strip("\"'").lower() for word in _words(bare.lstrip("#/").lstrip())]
            if {"x", "y", "z"} <= set(names):
                columns = [names.index(axis) for axis in "xyz"]
                continue
            # A title without column names is passed over, on the first line only.
            comment = comment or number == 1
        if bare and not comment:
            rows.append((number, line))
    return columns, rows


def _delimiter(line: str) -> str | None:
    """Comma or semicolon where there is one; None is white space, as for NumPy."""
    return next((mark for mark in (";", ",") if mark in line), None)


def _words(line: str) -> list[str]:
    return [word.strip() for word in line.split(_delimiter(line))]


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _holds_point(line: str, delimiter: str | None, columns: list[int]) -> bool:
    words = line.split(delimiter)
    return max(columns) < len(words) and all(_is_number(words[column]) for column in columns)
