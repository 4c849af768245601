"""Depth maps as they are recorded, in metres."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.errors import InputError

SATURATED = 65535
"""The value that 16-bit depth recorders write for "too far", beside 0 for "nothing seen"."""

SAMPLE = 10_000
"""Pixels that are enough to tell how far most are."""

FAR = 100.0
"""Median depth in metres above which a map was probably written in millimetres: depth cameras see
some metres, and rooms in millimetres begin at some hundred."""

NEAR = 0.02
"""Median depth in metres below which it was probably written in metres, or in centimetres."""


def in_metres(
    raw: NDArray[Any], depth_scale: float | None = None, max_depth: float | None = None
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return depths (H, W) in metres, NaN where unobserved, and what is odd about them.

    The unit is never guessed: where nobody gave one and the depths look like those of another,
    a note says so, and they stay as they are.

    Parameters
    ----------
    raw, depth_scale, max_depth
        As for `PointCloud.from_depth`.

    Raises
    ------
    InputError
        No numbers, 8 bits, or a scale or largest depth that is not positive.
    """
    if raw.dtype.kind not in "iuf":
        raise InputError(f"depth: expected integers or floating point, got {raw.dtype}")
    if raw.dtype.itemsize == 1:
        raise InputError(
            f"depth: {raw.dtype} holds 256 values, too few for a depth map; "
            "expected 16-bit integers or floating point (a colour image given by mistake?)"
        )
    scale = depth_scale
    if scale is None:
        scale = 1.0 if raw.dtype.kind == "f" else 1000.0
    if not math.isfinite(scale) or scale <= 0:
        raise InputError(
            f"depth_scale: expected a positive number of units per metre, got {scale:g}"
        )
    if max_depth is not None and not max_depth > 0:
        raise InputError(f"max_depth: expected a positive number of metres, got {max_depth:g}")
    with np.errstate(invalid="ignore", over="ignore"):  # NaN that signals, or too large
        metres = raw.astype(np.float64) / scale
        unobserved = ~(np.isfinite(metres) & (metres > 0))
    if raw.dtype == np.uint16:
        unobserved |= raw == SATURATED
    notes: tuple[str, ...] = ()
    if depth_scale is None:
        every = max(1, metres.size // SAMPLE)
        some = metres.ravel()[::every][~unobserved.ravel()[::every]]
        notes = _doubts(some, raw.dtype.kind == "f")
    if max_depth is not None:
        unobserved |= metres > max_depth
    metres[unobserved] = np.nan
    return metres, notes


def _doubts(seen: NDArray[np.float64], floating: bool) -> tuple[str, ...]:
    """Say where depths look like those of another unit than they were taken for."""
    if not len(seen):
        return ()
    median = float(np.median(seen))
    taken = "floating point, taken for metres" if floating else "integers, taken for millimetres"
    if floating and median > FAR:
        return (
            f"a median depth of {median:.4g} m ({taken}): probably millimetres; "
            "give depth_scale=1000 if so",
        )
    if not floating and median < NEAR:
        return (
            f"a median depth of {median:.4g} m ({taken}): probably another unit; "
            "give depth_scale, units per metre (100 for centimetres)",
        )
    return ()
