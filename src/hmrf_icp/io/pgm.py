"""Depth maps in PGM, 16-bit binary (P5) and plain (P2), and how sure they are, of 8 bits.

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


def read_pgm(path: Path, eight: bool = False) -> NDArray[np.uint16]:
    """Read a PGM image of more than 8 bits, or with ``eight`` of any number, (H, W).

    Raises
    ------
    InputError
        Not a PGM, 8-bit, cut short, with more than one image in it, or with a sample
        that is no whole number from 0 to the maximum of its header.
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
        if maximum < 256 and not eight:
            raise InputError(
                f"{path}: an 8-bit image (maximum {maximum}) is too coarse for depth, "
                "expected 16 bits"
            )
        if maximum > 65535 or width < 1 or height < 1:
            raise InputError(
                f"{path}: a PGM header of {width} x {height} pixels and maximum {maximum} is "
                "out of range"
            )
        body = data[header.end() :]
        if header.group(1) == b"P5":
            # A line end that a writer put behind the last sample is no sample.
            size = 2 if maximum > 255 else 1
            end = size * width * height
            whole = body[:end] if body[end:].isspace() else body
            samples: NDArray[np.integer] = np.frombuffer(whole, f">u{size}", len(whole) // size)
        else:
            samples = _plain_samples(path, body)
        if len(samples) < width * height:
            raise InputError(
                f"{path}: cut short: {width} x {height} pixels promised, {len(samples)} found"
            )
        if len(samples) > width * height:
            raise InputError(
                f"{path}: {width} x {height} pixels promised, {len(samples)} found: several images "
                "in one file, several channels, or a wrong size; expected one map of depth"
            )
        if samples.max() > maximum:
            raise InputError(
                f"{path}: a sample of {samples.max()} above the maximum of the header, {maximum}"
            )
    return samples.astype(np.uint16).reshape(height, width)


def _plain_samples(path: Path, body: bytes) -> NDArray[np.int64]:
    numbers = re.sub(rb"#[^\n\r]*", b"", body).split()
    # Not left to NumPy: it takes -5 for a sample, and 1_0 for ten.
    odd = next((word for word in numbers if not word.isdigit() or len(word) > 5), None)
    if odd is not None:
        raise InputError(
            f"{path}: a sample of {odd[:20].decode('ascii', 'replace')!r}, expected whole numbers "
            "up to 65535"
        )
    return np.array(numbers, dtype=np.int64)
