"""Depth maps in EXR, as renderers write them (``pip install 'hmrf-icp[exr]'``)."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.errors import InputError
from hmrf_icp.io.files import reading, require_bounded
from hmrf_icp.io.optional import optional

MOST_PIXELS = 100_000_000
"""Images of more are taken for damaged."""

_START = b"v/1\x01"
_DEEP, _PARTS = 0x800, 0x1000
"""Bits of the version."""

_KINDS = {"FLOAT": np.float32, "HALF": np.float16, "UINT": np.uint32}
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
        with path.open("rb") as stream:
            start = stream.read(8)
        if start[:4] != _START or len(start) < 8:
            raise InputError(f"{path}: not an EXR image, its first bytes are {start!r}")
        (flags,) = struct.unpack("<I", start[4:])
        for bit, found in ((_DEEP, "several depths a pixel"), (_PARTS, "several images")):
            if flags & bit:
                raise InputError(f"{path}: an EXR file with {found}, expected one")
        # Not its File, which warns of pixels that it cannot read, and hands out zeros for them.
        image = library.InputFile(str(path))
        try:
            header = image.header()
            stored, shown = _windows(path, header)
            channels = {}
            for name, channel in header["channels"].items():
                kind = _KINDS[str(channel).partition(" ")[0]]
                values = np.frombuffer(image.channel(name), kind)
                channels[str(name)] = values.reshape(stored.height, stored.width)
        finally:
            image.close()
        return _in_window(_chosen(path, channels), stored, shown)


class _Window(NamedTuple):
    left: int
    top: int
    width: int
    height: int


def _windows(path: Path, header: Any) -> tuple[_Window, _Window]:
    """Return the pixels that are stored and those that are shown, if there is room for them."""
    channels = header["channels"]
    if any((each.xSampling, each.ySampling) != (1, 1) for each in channels.values()):
        raise InputError(f"{path}: an EXR image with channels of fewer pixels than the others")
    found = []
    for name in ("dataWindow", "displayWindow"):
        low, high = header[name].min, header[name].max
        window = _Window(
            int(low.x), int(low.y), int(high.x) - int(low.x) + 1, int(high.y) - int(low.y) + 1
        )
        pixels = window.width * window.height
        if min(window.width, window.height) < 1 or pixels > MOST_PIXELS:
            raise InputError(
                f"{path}: an image of {window.width} x {window.height} pixels is larger than any "
                "depth map, or its header is damaged"
            )
        require_bounded(path, path.stat().st_size, 4 * pixels * len(channels))
        found.append(window)
    return found[0], found[1]


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


def _in_window(depth: NDArray[Any], stored: _Window, shown: _Window) -> NDArray[np.float32]:
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
