"""Depth maps in EXR, as renderers write them (``pip install 'hmrf-icp[exr]'``)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.errors import InputError
from hmrf_icp.io.exr_outline import Window, read_outline
from hmrf_icp.io.files import reading
from hmrf_icp.io.optional import optional

_DEPTH = ("z", "depth", "v", "y")
"""Last part of the name of a channel of depth, in lower case, the likeliest first."""

_PICTURE = ("r", "g", "b", "x")
"""Of a colour, one of which may hold a depth if all are the same; X is what some call the first."""


def read_exr(path: Path) -> NDArray[np.float32]:
    """Read the channel of depth, (H, W), in whatever unit it has.

    It is the one called ``Z``, ``depth``, ``V`` or ``Y``, whatever layer it is in, or the only one,
    or the first of three that are the same. Where the pixels stored are fewer than those
    shown, the others are NaN.

    Raises
    ------
    InputError
        Not EXR, damaged, deep or of several parts or channels that do not tell which is the depth,
        or OpenEXR is missing.
    """
    library = optional(path, "OpenEXR", "exr")
    with reading(path, "an EXR image"):
        stored, shown, kinds = read_outline(path)
        # Not its File, which warns of pixels that it cannot read, and hands out zeros for them.
        image = library.InputFile(str(path))
        try:
            channels: dict[str, NDArray[Any]] = {
                name: np.frombuffer(image.channel(name), kind).reshape(stored.height, stored.width)
                for name, kind in kinds.items()
            }
        finally:
            image.close()
        return _in_window(_chosen(path, channels), stored, shown)


def _chosen(path: Path, channels: dict[str, NDArray[Any]]) -> NDArray[Any]:
    if len(channels) == 1:
        return next(iter(channels.values()))
    last = {name: name.rpartition(".")[2].lower() for name in channels}
    for sought in _DEPTH:
        found = [name for name in channels if last[name] == sought]
        if len(found) == 1:
            return channels[found[0]]
    colours = [channels[name] for name in channels if last[name] in _PICTURE]
    if len(colours) > 1 and all(np.array_equal(colours[0], each, True) for each in colours):
        return colours[0]
    raise InputError(
        f"{path}: channels {', '.join(sorted(channels)[:20])}, none of which is called Z or depth"
    )


def _in_window(depth: NDArray[Any], stored: Window, shown: Window) -> NDArray[np.float32]:
    """Lay the pixels that are stored out on those that are shown."""
    left, top = stored.left - shown.left, stored.top - shown.top
    laid = np.full((shown.height, shown.width), np.nan, np.float32)
    rows = slice(max(top, 0), max(min(top + stored.height, shown.height), 0))
    columns = slice(max(left, 0), max(min(left + stored.width, shown.width), 0))
    if rows.start < rows.stop and columns.start < columns.stop:
        laid[rows, columns] = depth[
            rows.start - top : rows.stop - top, columns.start - left : columns.stop - left
        ]
    return laid
