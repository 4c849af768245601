"""Points painted as small discs, the nearest in front, into an array of pixels.

Written for pictures of many points that come by the dozen: a film's frame takes a few hundredths
of a second, where a scatter plot takes a second.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.drawing.oblique import Patches
from hmrf_icp.se3 import Array

SMOOTHING = 2
"""Painted so many times larger each way, and averaged."""

COVER = 1.35
"""Diameter of a disc in spacings of the points: a surface has no gaps then."""

SMALLEST, LARGEST = 1.6, 60.0
"""Diameters, in painted pixels, that a disc has at least and at most."""


def paint(
    layers: Sequence[tuple[Patches, Array]],
    frame: Array,
    limits: Array,
    size: tuple[int, int],
    smallest: float = SMALLEST,
) -> NDArray[np.uint8]:
    """Paint patches in orthographic projection.

    Parameters
    ----------
    layers
        Patches and their colours (M, 3), RGB in [0, 1], as they are or from ``lit``.
    frame
        (3, 3) as from ``viewing_frame``: right, up, towards who looks.
    limits
        ((left, right), (low, high)) of the picture, metres, as from ``bounds``.
    size
        Width and height, pixels.
    smallest
        Least diameter of a disc, pixels of a picture that is twice as large.

    Returns
    -------
    (H, W, 4) RGBA, the ground transparent; its first row is the highest.
    """
    width, height = (SMOOTHING * side for side in size)
    points = np.concatenate([patches.points for patches, _ in layers]) @ frame.T
    spacing = np.concatenate([patches.spacing for patches, _ in layers])
    colours = np.concatenate([colour for _, colour in layers])
    span = limits[:, 1] - limits[:, 0]
    across = (points[:, 0] - limits[0, 0]) / span[0] * width
    down = (limits[1, 1] - points[:, 1]) / span[1] * height
    inside = (across >= 0) & (across < width) & (down >= 0) & (down < height)
    order = np.flatnonzero(inside)[np.argsort(points[inside, 2], kind="stable")]

    diameter = np.round(COVER * spacing[order] * width / span[0])
    diameter = np.clip(diameter, np.ceil(smallest), LARGEST).astype(np.int64)
    # Which point a pixel shows: that of the highest rank, the nearest; 0 is none. With a margin,
    # so that no disc reaches beyond.
    margin = int(LARGEST) // 2 + 1
    wide = width + 2 * margin
    shown = np.zeros((height + 2 * margin) * wide, dtype=np.int32)
    rank = np.arange(1, len(order) + 1, dtype=np.int32)
    place = (down[order].astype(np.int64) + margin) * wide + across[order].astype(np.int64) + margin
    for one in np.unique(diameter):
        some = diameter == one
        dx, dy = _disc(int(one))
        disc = place[some, None] + (dy * wide + dx)
        np.maximum.at(shown, disc.ravel(), np.repeat(rank[some], len(dx)))
    inner = shown.reshape(-1, wide)[margin:-margin, margin:-margin]
    return _averaged(inner, colours[order])


def _disc(diameter: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Offsets of the pixels of a disc from its middle, across and down."""
    steps = np.arange(diameter) - (diameter - 1) / 2.0
    dy, dx = np.nonzero(steps[:, None] ** 2 + steps**2 <= max(diameter / 2.0, 0.75) ** 2)
    middle = (diameter - 1) // 2
    return dx - middle, dy - middle


def _averaged(shown: NDArray[np.int32], colours: Array) -> NDArray[np.uint8]:
    """Colours of the pixels, the mean over each square of painted ones."""
    table = np.zeros((len(colours) + 1, 4), dtype=np.float32)
    table[1:, :3], table[1:, 3] = colours, 1.0
    height, width = (side // SMOOTHING for side in shown.shape)
    mean = np.zeros((height, width, 4), dtype=np.float32)
    for row in range(SMOOTHING):
        for column in range(SMOOTHING):
            mean += table[shown[row::SMOOTHING, column::SMOOTHING]]
    # Only what is painted has a colour: the ground is black of no weight.
    mean[..., :3] /= np.maximum(mean[..., 3:], 1.0)
    mean[..., 3] /= SMOOTHING**2
    return np.asarray(np.round(255.0 * np.clip(mean, 0.0, 1.0)), dtype=np.uint8)
