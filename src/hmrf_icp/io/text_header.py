"""Which column of a table of points is which, by the names that people give them."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from pathlib import Path

from hmrf_icp.errors import InputError
from hmrf_icp.io.columns import PCD_NORMALS, PLY_NORMALS, RED_GREEN_BLUE

_COORDINATES = (
    ("x", "y", "z"),
    ("px", "py", "pz"),
    ("point_x", "point_y", "point_z"),
    ("points:0", "points:1", "points:2"),
    ("points_0", "points_1", "points_2"),
    ("pos_x", "pos_y", "pos_z"),
    ("position_x", "position_y", "position_z"),
    ("position.x", "position.y", "position.z"),
    ("coord_x", "coord_y", "coord_z"),
    ("x_coord", "y_coord", "z_coord"),
    ("easting", "northing", "height"),
    ("easting", "northing", "elevation"),
    ("easting", "northing", "altitude"),
)
"""In lower case and without a unit; the first of these that are all there."""

_UNIT = re.compile(r"(?:_|\s*[\[(]\s*)(?:m|met(?:er|re)s?)\s*[\])]?$")


def coordinate_columns(names: Sequence[str]) -> list[int] | None:
    """Places of x, y and z among the names of columns, None where they are not told."""
    return _places(names, _COORDINATES)


def normal_columns(names: Sequence[str]) -> list[int] | None:
    """Places of the three components of a normal, None where there is none."""
    return _places(names, (PLY_NORMALS, PCD_NORMALS))


def named_colours(names: Sequence[str]) -> list[str]:
    """Call R, G and B what they are; CloudCompare writes them so."""
    plain = [name.lower() for name in names]
    if not all(plain.count(each) == 1 for each in "rgb") or set(RED_GREEN_BLUE) & {*plain}:
        return list(names)
    full = dict(zip("rgb", RED_GREEN_BLUE, strict=True))
    return [full.get(name.lower(), name) for name in names]


def refuse_grid(path: Path, lines: Sequence[str]) -> None:
    """Refuse the raster of heights that goes by the same suffix as points.

    Raises
    ------
    InputError
        It is one.
    """
    if next((line for line in lines if line.strip()), "").lower().split()[:1] == ["ncols"]:
        raise InputError(
            f"{path}: an ESRI grid of heights, not points; write it as x y z, a point a line"
        )


def _places(names: Sequence[str], known: Sequence[Sequence[str]]) -> list[int] | None:
    plain: dict[str, int] = {}
    for place, name in enumerate(names):
        plain.setdefault(_UNIT.sub("", name.lower()), place)
    for three in known:
        if all(name in plain for name in three):
            return [plain[name] for name in three]
    return None


def names_in(line: str) -> list[str]:
    """Split a line of names, with or without the mark of a comment before it."""
    bare = line.strip().lstrip("#/").strip()
    mark = delimiter(bare)
    if mark is not None:
        words = next(csv.reader([bare], delimiter=mark, skipinitialspace=True), [])
    else:
        # The unit of 'x [m] y [m] z [m]' belongs to the name before it.
        words = re.findall(
            r"\"[^\"]*\"|'[^']*'|[^\s]+(?:\s+(?:\[\s*\w*\s*\]|\(\s*\w*\s*\)))?", bare
        )
    return [word.strip().strip("\"'").strip() for word in words]


def words_in(line: str) -> list[str]:
    """Split a line of values."""
    mark = delimiter(line)
    if mark is not None and '"' in line:
        return [word.strip() for word in next(csv.reader([line], delimiter=mark), [])]
    return [word.strip() for word in line.split(mark)]


def delimiter(line: str) -> str | None:
    """Comma or semicolon where there is one; None is white space, as for NumPy."""
    return next((mark for mark in (";", ",") if mark in line), None)


def is_number(word: str) -> bool:
    """Whether a word is a number, NaN and infinity included."""
    try:
        float(word)
    except ValueError:
        return False
    return True
