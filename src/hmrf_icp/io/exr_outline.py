"""The header of an EXR file, read here: its library's answer to a damaged one is to crash."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hmrf_icp.errors import InputError
from hmrf_icp.io.files import require_bounded

MOST_PIXELS = 100_000_000
"""Images of more are taken for damaged."""

_START = b"v/1\x01"
_DEEP, _PARTS = 0x800, 0x1000
"""Bits of the version."""

_LONGEST = 255
"""Letters of a name."""

_KINDS = (np.uint32, np.float16, np.float32)
"""Numbers of a channel, by EXR's code."""


class Window(NamedTuple):
    """A rectangle of pixels."""

    left: int
    top: int
    width: int
    height: int


class Outline(NamedTuple):
    """What the pixels are.

    Attributes
    ----------
    stored, shown
        Pixels that are in the file, and those of the picture.
    channels
        Type of the numbers of each channel by its name.
    """

    stored: Window
    shown: Window
    channels: dict[str, type]


def read_outline(path: Path) -> Outline:
    """Read what is needed of the header, and see that it is one.

    Raises
    ------
    InputError
        Not EXR, several images or depths a pixel, damaged, or more pixels than the file can hold.
    """
    size = path.stat().st_size
    with path.open("rb") as stream:
        data = stream.read(1 << 20)
    if data[:4] != _START or len(data) < 8:
        raise InputError(f"{path}: not an EXR image, its first bytes are {data[:8]!r}")
    (flags,) = struct.unpack_from("<I", data, 4)
    for bit, found in ((_DEEP, "several depths a pixel"), (_PARTS, "several images")):
        if flags & bit:
            raise InputError(f"{path}: an EXR file with {found}, expected one")
    attributes = _attributes(path, data)
    for name, kind in (
        *(("channels", "chlist"), ("compression", "compression"), ("lineOrder", "lineOrder")),
        *(("dataWindow", "box2i"), ("displayWindow", "box2i")),
    ):
        if attributes.get(name, ("", b""))[0] != kind:
            raise InputError(f"{path}: damaged: its EXR header has no {name!r}")
    channels = _channels(path, attributes["channels"][1])
    windows = [
        _window(path, attributes[name][1], size, len(channels))
        for name in ("dataWindow", "displayWindow")
    ]
    return Outline(windows[0], windows[1], channels)


def _attributes(path: Path, data: bytes) -> dict[str, tuple[str, bytes]]:
    """Type and bytes of each attribute by its name."""
    found: dict[str, tuple[str, bytes]] = {}
    at = 8
    while data[at : at + 1] != b"\0":
        name, at = _word(path, data, at)
        kind, at = _word(path, data, at)
        length = int.from_bytes(data[at : at + 4], "little", signed=True)
        at += 4
        if not 0 <= length <= len(data) - at:
            raise InputError(f"{path}: cut short or damaged: its EXR header ends in {name!r}")
        if name in found:
            raise InputError(f"{path}: damaged: its EXR header has two {name!r}")
        found[name] = kind, data[at : at + length]
        at += length
    return found


def _word(path: Path, data: bytes, at: int) -> tuple[str, int]:
    end = data.find(b"\0", at, at + _LONGEST + 1)
    word = data[at:end] if end >= 0 else b""
    if not word or not word.isascii() or not word.decode("ascii").isprintable():
        raise InputError(f"{path}: cut short or damaged: no name at byte {at} of its EXR header")
    return word.decode("ascii"), end + 1


def _channels(path: Path, data: bytes) -> dict[str, type]:
    found: dict[str, type] = {}
    at = 0
    while data[at : at + 1] != b"\0":
        name, at = _word(path, data, at)
        if len(data) < at + 16:
            raise InputError(f"{path}: damaged: its EXR header ends in channel {name!r}")
        kind, _, across, down = struct.unpack_from("<iIii", data, at)
        at += 16
        if kind not in range(len(_KINDS)) or name in found:
            raise InputError(f"{path}: damaged: channel {name!r} of its EXR header")
        if (across, down) != (1, 1):
            raise InputError(f"{path}: an EXR image with channels of fewer pixels than others")
        found[name] = _KINDS[kind]
    if not found:
        raise InputError(f"{path}: an EXR image without channels")
    return found


def _window(path: Path, data: bytes, size: int, channels: int) -> Window:
    if len(data) != 16:
        raise InputError(f"{path}: damaged: a window of {len(data)} bytes in its EXR header")
    left, top, right, bottom = struct.unpack("<4i", data)
    window = Window(left, top, right - left + 1, bottom - top + 1)
    pixels = window.width * window.height
    if min(window.width, window.height) < 1 or pixels > MOST_PIXELS:
        raise InputError(
            f"{path}: an image of {window.width} x {window.height} pixels is larger than any depth "
            "map, or its header is damaged"
        )
    require_bounded(path, size, 4 * pixels * channels)
    return window
