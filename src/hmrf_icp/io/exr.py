"""Depth maps in EXR, as renderers write them (``pip install 'hmrf-icp[exr]'``)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.errors import InputError
from hmrf_icp.io.files import reading, require_bounded
from hmrf_icp.io.optional import optional

MOST_PIXELS = 100_000_000
"""Images of more are taken for damaged."""

_START = b"v/1\x01"
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
        if start[:4] != _START:
            raise InputError(f"{path}: not an EXR image, its first bytes are {start!r}")
        described = _opened(library, path, header_only=True)
        if len(described.parts) != 1:
            raise InputError(f"{path}: {len(described.parts)} images in one file, expected one")
        header = described.header()
        names = _check_header(path, header)
        image = _opened(library, path, header_only=False)
        channels = image.channels()
        depth = np.asarray(_chosen(path, {name: channels[name].pixels for name in names}))
        return _in_window(path, depth, header)


def _opened(library: Any, path: Path, header_only: bool) -> Any:
    # Without threads of its own, which would not survive a fork.
    return library.File(str(path), separate_channels=True, header_only=header_only, num_threads=0)


def _check_header(path: Path, header: Any) -> list[str]:
    """Names of the channels, if there is room for them."""
    if "deep" in str(header.get("type", "")).lower():
        raise InputError(f"{path}: a deep EXR image, with several depths a pixel; expected one")
    channels = header["channels"]
    if any((each.xSampling, each.ySampling) != (1, 1) for each in channels):
        raise InputError(f"{path}: an EXR image with channels of fewer pixels than the others")
    for window in ("dataWindow", "displayWindow"):
        width, height = _size(header[window])
        if width < 1 or height < 1 or width * height > MOST_PIXELS:
            raise InputError(
                f"{path}: an image of {width} x {height} pixels is larger than any depth map, or "
                "its header is damaged"
            )
        require_bounded(path, path.stat().st_size, 4 * width * height * len(channels))
    return [str(each.name) for each in channels]


def _size(window: Any) -> tuple[int, int]:
    (left, top), (right, bottom) = ([int(number) for number in corner] for corner in window)
    return right - left + 1, bottom - top + 1


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


def _in_window(path: Path, depth: NDArray[Any], header: Any) -> NDArray[np.float32]:
    """Lay the pixels that are stored out on those that are shown."""
    width, height = _size(header["dataWindow"])
    if depth.shape != (height, width):
        raise InputError(f"{path}: an EXR channel of shape {depth.shape}, not {height, width}")
    shown = np.full(_size(header["displayWindow"])[::-1], np.nan, np.float32)
    left, top = (int(n) for n in header["dataWindow"][0] - header["displayWindow"][0])
    rows = slice(max(top, 0), min(top + height, shown.shape[0]))
    columns = slice(max(left, 0), min(left + width, shown.shape[1]))
    if rows.start < rows.stop and columns.start < columns.stop:
        shown[rows, columns] = depth[
            rows.start - top : rows.stop - top, columns.start - left : columns.stop - left
        ]
    return shown
