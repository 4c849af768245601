"""Shifts of a turned cloud under which two surfaces agree, all at once, by Fourier transforms.

Two clouds are laid into grids that wrap round. For every shift of one by whole cells, their
correlation counts what stands on the other's surface and faces alike, and what stands where
the other saw through; the highest ratios of the two are the shifts to look at. A plane
agrees with a plane wherever it slides, so each point counts by how rare its normal is.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import threads

Array = NDArray[np.float64]

RARITY = 0.5
"""Power of the share of the area that faces a point's way, by which the point counts for less."""

WIDTH = math.radians(10.0)
"""Normals within about this angle face the same way when that share is asked for."""

PERIOD = 0.7
"""Edge of the grid, as a share of where the clouds could be without any overlap."""

OUTER = 98.0
"""Percentile of the distances from the centre that is a cloud's radius: outliers have no say."""

SHORT = 0.7
"""Cells that a ray ends before its point; the cells round all points are not empty either."""

MOST_CELLS = 1e7
"""Cells of the box in which empty ones are looked for: memory and time grow with them."""

FLOOR = 0.01
"""Share of all points that is added to those that agree and to those that violate."""


@dataclass(frozen=True, eq=False)
class Sampled:
    """A cloud as it is correlated.

    Attributes
    ----------
    points, normals
        (M, 3) metres, each for the same area, and unit vectors.
    signed
        Whether the normals have a sign.
    seen
        (K, 3) more of the points, metres: where rays ended.
    viewpoint
        (3,) where they began, metres; None where that is not known.
    """

    points: Array
    normals: Array
    signed: bool
    seen: Array
    viewpoint: Array | None

    def radius(self, centre: Array) -> float:
        """Distance from the centre (3,) within which nearly all points are, metres."""
        return float(np.percentile(np.linalg.norm(self.points - centre, axis=1), OUTER))


class Correlator:
    """Two clouds laid into grids, the source anew for every rotation.

    Parameters
    ----------
    source, target
        The clouds.
    cells
        Cells along each edge of the grids: powers of 2, 3 and 5 are quick.
    """

    def __init__(self, source: Sampled, target: Sampled, cells: int) -> None:
        from scipy.ndimage import gaussian_filter

        self._middle = source.points.mean(axis=0)
        self._onto = target.points.mean(axis=0)
        apart = source.radius(self._middle) + target.radius(self._onto)
        self._edge = 2.0 * PERIOD * apart / cells
        self._signed = source.signed and target.signed
        self._moving = self._prepared(source, self._middle)
        self._count = len(source.points)

        self._grid = np.zeros((8, cells, cells, cells), dtype=np.float32)
        self._lay(np.eye(3), self._prepared(target, self._onto))
        sharp = self._grid[0].copy()
        # A surface as wide as the cells, wherever between their centres it stands.
        for channel in self._grid[:7]:
            gaussian_filter(channel, 1.0, mode="wrap", output=channel)
        dense = self._grid[0]
        typical = float(np.median(dense[dense > 0.3 * dense.max()]))
        self._grid[1:7] *= np.minimum(1.0 / typical, 1.0 / np.maximum(dense, 0.5 * typical))
        # What stands in empty space is told by the points as they are: a wide surface would
        # reach into the space before it, and be pushed back.
        np.minimum(sharp, np.median(sharp[sharp > 0.3 * sharp.max()]), out=dense)
        surface = float(dense.sum())
        # Points of the source count as shares of all; and so do cells of the target's surface.
        self._fixed = self._spectrum()
        self._fixed[1:] /= self._count
        self._fixed[0] /= surface
        if not self._signed:
            self._fixed[1:7] *= 1.5
        self._both = np.empty((2, *self._fixed.shape[1:]), dtype=np.complex64)
        self._ratio = np.empty((cells, cells, cells), dtype=np.float32)

    @property
    def cell(self) -> float:
        """Edge of a cell, metres."""
        return self._edge

    def peaks_of_each(self, rotations: Array, most: int) -> list[tuple[Array, Array]]:
        """Find the peaks of every one of the rotations (K, 3, 3); see :meth:`peaks`."""

        def some(piece: Array) -> list[tuple[Array, Array]]:
            own = self._with_grids_of_its_own()
            return [own.peaks(rotation, most) for rotation in piece]

        return [each for piece in threads.current().over(some, rotations, 8) for each in piece]

    def _with_grids_of_its_own(self) -> Correlator:
        other = copy.copy(self)
        for name in ("_grid", "_both", "_ratio"):
            setattr(other, name, np.empty_like(getattr(self, name)))
        return other

    def peaks(self, rotation: Array, most: int) -> tuple[Array, Array]:
        """Find where the source agrees best with the target under one rotation (3, 3).

        Returns
        -------
        (K, 3) translations that go with the rotation, metres, source to target, at most
        ``most``, the best first; and the logarithm of agreement to violation, (K,).
        """
        from scipy import fft

        from hmrf_icp.kernels.correlation import multiply, peaks

        self._lay(rotation, self._moving)
        moving = self._spectrum()
        flat = (len(moving), -1)
        multiply(moving.reshape(flat), self._fixed.reshape(flat), self._both.reshape(2, -1))
        agree, violated = fft.irfftn(self._both, self._ratio.shape, axes=(1, 2, 3), workers=1)
        cell, value = np.empty((most, 3)), np.empty(most)
        count = peaks(agree, violated, FLOOR, most, self._ratio, cell, value)
        shift = cell[:count]
        cells = len(self._ratio)
        shift = np.where(shift > 0.5 * cells, shift - cells, shift) * self._edge
        return self._onto + shift - rotation @ self._middle, np.log(value[:count])

    def _prepared(self, cloud: Sampled, centre: Array) -> tuple[Array, Array, Array, Array]:
        """Points, normals, weights and empty cells of a cloud about its centre, in cells."""
        weight = rarity(cloud.normals, self._signed) ** RARITY
        empty = empty_cells(cloud, self._edge)
        return (
            (cloud.points - centre) / self._edge,
            cloud.normals,
            weight / weight.mean(),
            (empty - centre) / self._edge,
        )

    def _lay(self, rotation: Array, cloud: tuple[Array, Array, Array, Array]) -> None:
        from hmrf_icp.kernels.correlation import lay

        lay(np.ascontiguousarray(rotation), *cloud, self._signed, self._grid)

    def _spectrum(self) -> NDArray[np.complex64]:
        from scipy import fft

        return np.asarray(fft.rfftn(self._grid, axes=(1, 2, 3), workers=1))


def rarity(normals: Array, signed: bool) -> Array:
    """How few of the normals (M, 3) face like each: one over their share, (M,)."""
    from hmrf_icp.search.orientations import DIRECTIONS, sphere

    cosine = normals @ sphere(DIRECTIONS).T
    if not signed:
        cosine = np.abs(cosine)
    nearest = cosine.argmax(axis=1)
    count = np.bincount(nearest, minlength=DIRECTIONS) / len(normals)
    between = sphere(DIRECTIONS) @ sphere(DIRECTIONS).T
    if not signed:
        between = np.abs(between)
    return np.asarray(1.0 / (np.exp((between - 1.0) / WIDTH**2) @ count)[nearest])


def within_reach(points: Array, edge: float) -> Array:
    """Leave out the farthest points (M, 3) where the box round all has too many cells of ``edge``.

    The edge is a share of the radius of nearly all points: one of them may be anywhere.
    """
    while np.prod(np.ptp(points, axis=0) / edge + 4.0) > MOST_CELLS:
        reach = np.linalg.norm(points - np.median(points, axis=0), axis=1)
        points = points[reach <= 0.5 * reach.max()]
    return points


def empty_cells(cloud: Sampled, edge: float) -> Array:
    """Centres (K, 3) of the cells of ``edge`` metres that were seen to be empty; none if unknown.

    They are those that a ray passed on its way to a point, but for those with a point
    in them or in one of the 26 around.
    """
    from scipy.ndimage import binary_dilation

    from hmrf_icp.kernels.correlation import carve

    if cloud.viewpoint is None:
        return np.empty((0, 3))
    points = within_reach(cloud.seen, edge)
    corner = points.min(axis=0) - 2.0 * edge
    shape = np.ceil((points.max(axis=0) - corner) / edge).astype(np.int64) + 2
    seen = np.zeros(shape, dtype=np.bool_)
    carve(points, cloud.viewpoint, corner, edge, SHORT * edge, seen)
    surface = np.zeros(shape, dtype=np.bool_)
    surface[tuple(((points - corner) / edge).astype(np.int64).T)] = True
    seen &= ~binary_dilation(surface, np.ones((3, 3, 3), dtype=np.bool_))
    return np.asarray(corner + (np.argwhere(seen) + 0.5) * edge)
