"""Depth maps in PGM, 16-bit binary (P5) and plain (P2).

Read here and not with Pillow: it stretches samples to 0 ... 65535 whenever the
header's largest value is smaller, as image formats for eyes may, and a map in
millimetres would come out in some other unit.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.errors import InputError
from hmrf_icp.io.files import reading

_BLANK = rb"(?:\s|#[^\n\r]*[\n\r])+"
_HEADER = re.compile(
    rb"(P[25])" + _BLANK + rb"(\d+)" + _BLANK + rb"(\d+)" + _BLANK + rb"(\d+)(?:#[^\n\r]*)?\s"
)


def read_pgm(path: Path) -> NDArray[np.uint16]:
    """Read a PGM image of more than 8 bits, (H, W).

    Raises
    ------
    InputError
        Not a PGM, 8-bit, cut short, or with a sample above the maximum of its header.
    """
    with reading(path, "a PGM image"):
        data = path.read_bytes()
        header = _HEADER.match(data)
        if header is None:
            raise InputError(
                f"{path}: not a PGM image: expected a header 'P5 WIDTH HEIGHT MAXIMUM' (or P2), "
                f"found {data[:16]!r}"
            )
        width, height, maximum = (int(number) for number in header.groups()[1:])
        if maximum < 256:
            raise InputError(
                f"{path}: an 8-bit image (maximum {maximum}) is too coarse for depth, "
                "expected 16 bits"
            )
        if maximum > 65535 or width < 1 or height < 1:
            raise InputError(
                f"{path}: a PGM header of {width} x {height} pixels and maximum {maximum} is "
                "out of range"
            )
        samples = _samples(data[header.end() :], header.group(1) == b"P5", width * height)
        if len(samples) < width * height:
            raise InputError(
                f"{path}: cut short: {width} x {height} pixels promised, {len(samples)} found"
            )
        if samples.max() > maximum:
            raise InputError(
                f"{path}: a sample of {samples.max()} above the maximum of the header, {maximum}"
            )
    return samples.astype(np.uint16).reshape(height, width)


def _samples(body: bytes, binary: bool, count: int) -> NDArray[np.integer]:
    if binary:
        return np.frombuffer(body, dtype=">u2", count=min(count, len(body) // 2))
    numbers = re.sub(rb"#[^\n\r]*", b"", body).split()
    return np.array(numbers[:count], dtype=np.int64)
