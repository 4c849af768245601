"""The pixels of a depth map whose points come as a list, told from the points alone.

A camera's pixels look along rays whose slopes x / z and y / z are equally far apart. A file of
points (N, 3) that was written from a depth map has them still: its points stand on a comb of
slopes. The comb shows as a peak of the periodogram of the slopes, and each point's place in the
image follows from it. What was moved, merged, or thinned by cells, stands on none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.recovered_camera import FEWEST, SHORTEST
from hmrf_icp.lazy import cached_property

Array = NDArray[np.float64]

SAMPLE = 4_000
"""Points whose slopes are looked at."""

WIDEST = 8192
"""Pixels along a side at most."""

BINS = 8 * WIDEST
"""Bins of the slopes: eight to the narrowest pixel."""

PEAK = 0.8
"""Length of the mean of the slopes' phases from which they may stand on a comb; 1 if all do."""

OFF = 0.3
"""Pixels that no point may be farther off the middle of its own."""

BESIDE = 0.3
"""Share of the points that must have another in the pixel to the right.

A few points of an image, drawn anywhere, have not: its windows hold too few of them for a plane.
"""

STEEPEST = 100.0
"""Largest slope of a ray: no camera sees farther aside than half a degree from its own plane."""

ROOM = 32
"""Pixels for each point at most: nobody lays a few points out on a huge grid."""


class Comb(NamedTuple):
    """Slopes that are equally far apart: pixel = slope * pixels_a_slope - first."""

    pixels_a_slope: float
    first: float

    def places(self, slopes: Array) -> Array:
        """Tell where on the comb slopes are, in pixels."""
        return slopes * self.pixels_a_slope - self.first


@dataclass(frozen=True, eq=False)
class DepthImage:
    """The points of a list in the pixels that they were seen in.

    Attributes
    ----------
    points
        (H, W, 3) the smallest image that holds them all, NaN in the other pixels.
    place
        (N,) pixel of each point of the list, row * W + column; no two are the same.
    """

    points: Array
    place: NDArray[np.intp]

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W)."""
        return self.points.shape[0], self.points.shape[1]

    def lay_out(self, values: NDArray[Any]) -> NDArray[Any]:
        """Lay one value a point, (N, ...), out in the image; NaN, or zero, in the other pixels."""
        fill = np.nan if values.dtype.kind == "f" else 0
        laid = np.full((math.prod(self.shape), *values.shape[1:]), fill, dtype=values.dtype)
        laid[self.place] = values
        return laid.reshape(*self.shape, *values.shape[1:])

    @cached_property
    def order(self) -> NDArray[np.intp] | None:
        """(N,) which point of the image, row by row, each of the list is; None: in order."""
        if (self.place[1:] > self.place[:-1]).all():
            return None
        taken = np.zeros(math.prod(self.shape), dtype=np.intp)
        taken[self.place] = 1
        return np.asarray((taken.cumsum() - 1)[self.place])


def depth_image(points: Array) -> DepthImage | None:
    """Find the pixel of a depth map in which each point (N, 3) of a list was seen.

    None where they come from no single depth map, or are no longer in its camera's frame: with
    z forward and y down, or with z backward and y up.
    """
    from hmrf_icp.kernels import pixels
    from hmrf_icp.kernels.compiled import read_only

    # Drawn at random: every n-th point of an image without holes stands in every n-th column.
    some = points
    if len(points) > SAMPLE:
        some = points[np.random.default_rng(0).integers(0, len(points), SAMPLE)]
    depth = some[:, 2]
    if len(some) < FEWEST or not ((depth > 0.0).all() or (depth < 0.0).all()):
        return None
    with np.errstate(over="ignore"):
        across, down = comb(some[:, 0] / np.abs(depth)), comb(some[:, 1] / depth)
    if across is None or down is None:
        return None
    points, combs = read_only(points), np.array([across, down])
    ends = pixels.extent(points, combs, OFF)
    width, height = ends[2:] - ends[:2] + 1.0
    room = min(ROOM * len(points), WIDEST**2)
    if not (min(width, height) >= SHORTEST and width * height <= room):
        return None
    image = np.full((int(height), int(width), 3), np.nan)
    place = np.empty(len(points), dtype=np.intp)
    if pixels.lay(points, combs, ends[:2], image, place) < len(points):
        return None
    taken = ~np.isnan(image[..., 0])
    beside = np.count_nonzero(taken[:, 1:] & taken[:, :-1])
    return DepthImage(image, place) if beside >= BESIDE * len(points) else None


def comb(slopes: Array) -> Comb | None:
    """Find the comb that slopes (n,) stand on, None where there is none."""
    if not np.abs(slopes).max() <= STEEPEST:
        return None
    low, high = np.quantile(slopes, (0.01, 0.99), method="nearest")
    if not high > low:
        return None
    scaled = (slopes - low) / (high - low)
    # Both ends are slopes of the comb: its frequency is a whole number, or nearly.
    counts = np.bincount((scaled % 1.0 * BINS).astype(np.intp) % BINS, minlength=BINS)
    strength = np.abs(np.fft.rfft(counts))[: WIDEST + 1] / len(slopes)
    inner = strength[1:-1]
    peaks = 1 + np.flatnonzero((inner >= PEAK) & (inner >= strength[:-2]) & (inner >= strength[2:]))
    peaks = peaks[peaks >= SHORTEST - 1]
    if not len(peaks):
        return None
    # Of the right frequency and its multiples, all of which are peaks, the right one is the first.
    found = _fitted(scaled, float(peaks[0]))
    scale = found.pixels_a_slope / (high - low)
    return Comb(scale, found.first + low * scale)


def _fitted(slopes: Array, frequency: float) -> Comb:
    """Least squares of the numbers of the pixels on the slopes."""
    turns = slopes * frequency
    first = float(np.angle(np.exp(2j * math.pi * turns).mean())) / (2.0 * math.pi)
    one = Comb(frequency, first)
    for _ in range(3):
        number = np.rint(one.places(slopes))
        spread = slopes - slopes.mean()
        step = float((spread * (number - number.mean())).sum() / (spread**2).sum())
        one = Comb(step, step * float(slopes.mean()) - float(number.mean()))
    return one
