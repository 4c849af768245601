"""Fewer points that stand for all."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.grid import beside, lengths, median
from hmrf_icp.clouds.per_point import Attributes
from hmrf_icp.clouds.tree import Tree
from hmrf_icp.lazy import cached_property
from hmrf_icp.stages import stage

NEAR = 1.1
"""Times an edge that leaves too many, within which the smallest that does not is found."""

PASSES = 12
"""Edges that are guessed for the cells of a grid before they are found by halves."""

Array = NDArray[np.float64]

SAMPLED = 4
"""Points looked at for each that is to stay, to begin with, where there are many more."""

SEEN = 0.85
"""Share of the cells of a surface that so many points are seen to be in."""

CLOSE = 0.9
"""Share of the points asked for that are enough."""

FINEST = 1e-15
"""Smallest edge of a cell, as a share of the cloud's longest side: cells are counted in 63 bits."""

HIT = 0.25
"""Share of the pixels expected that a thinned image must have; otherwise it is thinned less.

Points on every fourth row, or a few of them anywhere, can all fall between the rows that stay.
"""


class Downsampled:
    """Fewer points, and which of them stands for each of all.

    Attributes
    ----------
    cloud
        About as many points as were asked for.
    """

    def __init__(self, cloud: PointCloud, stand_ins: Callable[[], NDArray[np.intp]]) -> None:
        self.cloud = cloud
        self._stand_ins = stand_ins

    @cached_property
    def representative(self) -> NDArray[np.intp]:
        """(M,) rows of its observed points, one for each observed point of the whole.

        The kept point of the same cell, and of a grid the kept pixel of the same block, or
        the nearest point where there is none.
        """
        return self._stand_ins()


@stage("thinning")
def downsample(cloud: PointCloud, most: int) -> Downsampled:
    """Thin a cloud out to about ``most`` points; the same cloud where it has no more.

    An organised cloud keeps every n-th row and every m-th column, so that it stays one;
    any other keeps one point of every cell of a grid of cubes, so that what is
    dense is thinned first. The time it takes grows with the points.
    """
    if len(cloud) <= most:
        return Downsampled(cloud, lambda: np.arange(len(cloud)))
    return _every_nth(cloud, most) if cloud.organised else _one_a_cell(cloud, most)


def _every_nth(cloud: PointCloud, most: int) -> Downsampled:
    down, across = _steps(cloud, most)
    while max(down, across) > 1 and np.count_nonzero(cloud.observed[::down, ::across]) < HIT * min(
        most, len(cloud) / (down * across)
    ):
        down, across = max(1, down - 1), max(1, across - 1)
    few = cloud.subsample(down, across)
    return Downsampled(few, lambda: _of_blocks(cloud, few, down, across))


def _steps(cloud: PointCloud, most: int) -> tuple[int, int]:
    """Of how many rows, and of how many columns, one stays: as far apart both ways as can be.

    The rings of a spinning LiDAR are farther apart than the points along them, and none is
    to spare.
    """
    share = len(cloud) / most
    even = math.ceil(math.sqrt(share))
    if cloud.camera is not None:
        return even, even
    rows, columns = (median(lengths(far - near)) for near, far in beside(cloud.points))
    if min(rows, columns) == 0.0:
        return even, even  # none are beside each other, or they coincide

    def uneven(steps: tuple[int, int]) -> float:
        return abs(math.log(steps[0] * rows / (steps[1] * columns)))

    pairs = [(down, math.ceil(share / down)) for down in range(1, math.ceil(share) + 1)]
    return min(pairs, key=uneven)


def _of_blocks(cloud: PointCloud, few: PointCloud, down: int, across: int) -> NDArray[np.intp]:
    """Rows of the pixels that stay, for each pixel observed: of its block, or the nearest."""
    place = np.full(few.shape, -1, dtype=np.intp)
    place[few.observed] = np.arange(len(few))
    height, width = cloud.shape
    blocks = place.repeat(down, axis=0)[:height].repeat(across, axis=1)[:, :width]
    rows = blocks[cloud.observed]
    lost = rows < 0
    if lost.any():
        _, rows[lost] = Tree(few.observed_points).query(cloud.observed_points[lost])
    return rows


def _one_a_cell(cloud: PointCloud, most: int) -> Downsampled:
    points = cloud.observed_points
    owner = np.empty(len(points), np.int32)
    rows, _ = _few_rows(points, most, owner)
    held = cloud.attributes
    beside = held.at(cloud.observed, rows) if isinstance(held, Attributes) and held else None
    facing = None if cloud.normals is None else cloud.normals[cloud.observed][rows]
    few = cloud.derived(points[rows], cloud.viewpoint, beside, normals=facing)
    return Downsampled(few, lambda: owner.astype(np.intp))


def thinned(points: Array, edge: float) -> NDArray[np.int64]:
    """Rows of the points (M, 3) that come first in their cell of ``edge`` metres, in order.

    0 keeps one of the points that coincide.
    """
    return Cells(points).first(edge)


class Cells:
    """A grid of cubes laid over points.

    Parameters
    ----------
    points
        (M, 3) finite, M of 1 or more; metres.
    """

    def __init__(self, points: Array) -> None:
        from hmrf_icp.kernels.cells import bounds
        from hmrf_icp.kernels.compiled import read_only

        self._points = read_only(points)
        self._corner, high = bounds(self._points)
        self.side = float((high - self._corner).max())

    def first(
        self, edge: float, most: int | None = None, owner: NDArray[np.int32] | None = None
    ) -> NDArray[np.int64]:
        """Rows of the points that come first in their cell of ``edge`` metres, in order.

        Parameters
        ----------
        edge
            Of the cells; 0 keeps one of the points that coincide.
        most
            Cells after which it gives up, and returns one row more than that.
        owner
            (M,) to write to which of the rows returned is of the cell of each point.
        """
        from hmrf_icp.kernels.cells import first_of_each

        rows: NDArray[np.int64] = first_of_each(
            self._points,
            self._corner,
            max(edge, FINEST * self.side) if self.side > 0.0 else 1.0,
            len(self._points) if most is None else most,
            np.empty(0, np.int32) if owner is None else owner,
        )
        return rows


def _few_rows(
    points: Array, most: int, owner: NDArray[np.int32]
) -> tuple[NDArray[np.int64], float]:
    """Rows of about ``most`` points and no more, one a cell, and the edge of the cells, metres.

    ``owner`` (M,) is written to as :meth:`Cells.first` has it.
    """
    cells = Cells(points)
    if len(points) > 2 * SAMPLED * most:
        # Some cells have none of the sample.
        sample = np.ascontiguousarray(points[:: len(points) // (SAMPLED * most)])
        fewer = math.ceil(SEEN * most)
        _, found = _few_rows(sample, fewer, np.empty(0, np.int32))
    else:
        found = cells.side / math.sqrt(most)
    low, high = 0.0, cells.side
    for _ in range(PASSES):
        rows = cells.first(found, 2 * most, owner)
        count = len(rows)
        if CLOSE * most <= count <= most:
            return rows, found
        low, high = (found, high) if count > most else (low, found)
        # Cells of a surface: as many as the square of the edge is small.
        found *= math.sqrt(count / (0.5 * (1.0 + CLOSE) * most))
        if not low < found < high:
            found = 0.5 * (low + high) if low > 0.0 else 0.1 * high
    finest = FINEST * cells.side
    while high > NEAR * low and high > finest:
        middle = 0.5 * (low + high) if low > 0.0 else 0.1 * high
        if len(cells.first(middle, most)) > most:
            low = middle
        else:
            high = middle
    return cells.first(high, owner=owner), high
