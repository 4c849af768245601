"""PTS, Leica's text of points: their number, then x, y, z, and what was seen there."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.errors import InputError
from hmrf_icp.io.columns import AXES, RED_GREEN_BLUE, Columns, columns_of, unpacked_colours
from hmrf_icp.io.words import understood

_NAMES = {
    4: ("intensity",),
    6: RED_GREEN_BLUE,
    7: ("intensity", *RED_GREEN_BLUE),
}
"""What stands behind the coordinates, by the number of columns."""


def read_counted(
    path: Path, lines: Sequence[tuple[int, str]]
) -> tuple[dict[str, int], list[tuple[int, str]]]:
    """Tell the counts from the points; several scans may stand one behind the other.

    Returns
    -------
    columns, rows
        Place of each column by its name, and the lines that hold points, with their numbers.

    Raises
    ------
    InputError
        No points, or fewer than a count promises.
    """
    rows: list[tuple[int, str]] = []
    promised = 0
    for number, line in lines:
        words = line.split()
        if len(words) == 1 and words[0].isdecimal() and words[0].isascii():
            promised = min(promised + int(words[0][:18]), 10**18)
        elif words and not words[0].startswith(("#", "//")):
            rows.append((number, understood(line)))
    if not rows:
        raise InputError(f"{path}: no points in it")
    if promised > len(rows):
        raise InputError(f"{path}: cut short: {promised:,} points promised, {len(rows):,} found")
    names = (*AXES, *_NAMES.get(len(rows[0][1].split()), ()))
    return {name: place for place, name in enumerate(names)}, rows


def columns_of_pts(cloud: PointCloud) -> Columns:
    """Return what PTS has a place for beside the coordinates, in the cloud's shape."""
    held = unpacked_colours(columns_of(cloud, ()))
    single = {name: values for name, values in held.items() if values.shape == cloud.shape}
    found = {}
    if "intensity" in single and np.isfinite(single["intensity"]).all():
        found["intensity"] = single["intensity"]
    if all(name in single and single[name].dtype == np.uint8 for name in RED_GREEN_BLUE):
        found |= {name: single[name] for name in RED_GREEN_BLUE}
    return found
