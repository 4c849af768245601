"""One meaning a colour, in every figure, film and summary of this package.

Okabe and Ito's colours, which people with any common colour blindness tell apart, but for the
inliers' green, which is a shade darker, and the outliers' grey: so what lies beside each other in
one picture (source and target; inliers, outliers and target) differs in lightness too, and a
print in grey can be read.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

SOURCE = "#0072b2"
"""The cloud that moves."""

TARGET = "#e69f00"
"""The cloud that stays."""

INLIER = "#007a5a"
"""A source point that has a counterpart in the target."""

OUTLIER = "#cfcfcf"
"""A source point that has none."""

VIOLATED = "#d55e00"
"""What cannot be: space that was seen to be empty and is not, a pose that is not to be believed."""

FREE = "#cc79a7"
"""A direction of which the surfaces tell nothing."""

MIDDLE_INK = "#77818c"
"""Ink that is read on white and on black, for pictures without a ground of their own."""

DARK_INK, LIGHT_INK = "#222222", "#e8e8e8"
"""Ink on a light ground, and on a dark one."""

LIGHT_GROUND, DARK_GROUND = "#ffffff", "#0d1117"

UNSIGNED, SIGNED = "viridis", "cividis"
"""Colour maps of distances, and of deviations to both sides (dark below, light above): lightness
rises from end to end in either."""

MEANINGS = {
    "source": SOURCE,
    "target": TARGET,
    "inlier": INLIER,
    "outlier": OUTLIER,
    "violated": VIOLATED,
    "free": FREE,
}
"""The colours by what they mean."""


def rgb(colour: str) -> Array:
    """(3,) of a colour ``#rrggbb``, in [0, 1]."""
    return np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0


def between(probability: ArrayLike) -> Array:
    """Colours (..., 3) from an outlier's, at probability 0, to an inlier's, at 1."""
    share = np.asarray(probability, dtype=np.float64)[..., None]
    return np.asarray((1.0 - share) * rgb(OUTLIER) + share * rgb(INLIER))


def lightness(colour: str) -> float:
    """L* of CIELAB, 0 for black and 100 for white: what is left of a colour in grey."""
    value = rgb(colour)
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    luminance = float(linear @ [0.2126, 0.7152, 0.0722])
    return 116.0 * float(np.cbrt(luminance)) - 16.0 if luminance > 0.008856 else 903.3 * luminance
