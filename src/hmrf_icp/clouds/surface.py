"""The surface that a cloud samples: normals, noise, and the area a point stands for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.cloud import PointCloud, at_most
from hmrf_icp.clouds.downsample import thinned
from hmrf_icp.clouds.grid import beside, lengths, median
from hmrf_icp.clouds.tree import Tree
from hmrf_icp.errors import InputError
from hmrf_icp.lazy import cached_property
from hmrf_icp.stages import stage

Array = NDArray[np.float64]

WINDOW = 2
"""Pixels to each side of a pixel whose points its normal is fitted to (a window of 5 x 5)."""

NEIGHBOURS = 16
"""Points that a normal is fitted to where there is no grid."""

MORE_NEIGHBOURS = ((24, 32), (48, 64))
"""The same where so many stand on a line; those that are enough for most are asked for first."""

THINNING = 3.0
"""Edge of the cells that keep one neighbour each, in median distances to the nearest neighbour.

The points of a spinning LiDAR stand close along a ring and far from the next:
their nearest neighbours are a line, to which any plane fits. Thinned, they reach across.
"""

FEW_PLANES = 0.1
"""Share of the points with a normal from their window below which the window is too small.

An image with few pixels left has neighbours farther away than its windows reach.
"""

SPACED = 2500
"""Points whose nearest neighbour is looked for to tell how far apart a cloud's points are."""

UNEVEN = 2
"""Times farther apart rows may be than columns, or these than those, for a window of the grid.

Rings of a LiDAR of 16 beams are seven times as far apart as their points: its windows reach over
metres, and the poses of two such scans were 10 to 40 mm off where neighbours in space give 1.
"""

EXPLAINED = 2.0
"""Deviations of the noise that a fit may leave over before its surface is no plane."""

BENT = 0.05
"""Turn within a patch, radians, at which a normal counts half.

Corridors seen by a spinning LiDAR, whose rings turn from floor to wall within a patch, seem
known along themselves with 0.2 and more. Rooms, tables and streets keep three quarters of what is
known of their weakest direction with anything from 0.05 to 0.2.
"""

FITTED = 5000
"""Points whose residuals are enough to fit the noise to."""

NOISE_FLOOR = 1e-3
"""Smallest noise, as a share of the spacing of the points: exact clouds have none of their own."""


@dataclass(frozen=True, eq=False)
class Surface:
    """What can be told of the surface at each observed point; rows as in ``observed_points``.

    Attributes
    ----------
    points
        (M, 3), metres.
    normals
        (M, 3) unit normals, towards the viewpoint where it is known (otherwise
        their sign means nothing); zero where no plane could be fitted.
    noise
        (M,) standard deviation of the points along their normals, metres.
    area
        (M,) area that the point stands for, square metres.
    patch
        (M,) the same if points stood as densely everywhere as on average. What is chosen and
        weighed by it has more of what is seen closely, such as things on a table, and less of
        far floors and walls: searches go by it.
    oriented
        Whether the normals have a sign.
    support
        (M,) number of points that a normal is fitted to, where all of them are there.
    residual
        (M,) standard deviation of these from the plane, metres; NaN where none was fitted.
    width
        (M,) standard deviation of these along the plane, the way they spread least, metres.
    """

    points: Array
    normals: Array
    noise: Array
    area: Array
    oriented: bool
    support: Array
    residual: Array
    width: Array
    patch: Array

    @cached_property
    def spacing(self) -> float:
        """Typical distance between neighbouring points, metres."""
        return float(np.sqrt(np.median(self.patch)))

    @cached_property
    def tilt(self) -> Array:
        """Standard deviation of the normals about each tangent, (M,) radians.

        What the noise does to a plane fitted to ``support`` points that cover
        as many times their area: to first order noise over the root of their
        summed squares, and more where the noise is not small against the patch.
        """
        relative = self.noise**2 / np.maximum(self.patch, 1e-300)
        patch = self.support / 12.0
        return np.asarray(np.sqrt(relative / (self.support * patch) * (1.0 + relative / patch)))

    @cached_property
    def trust(self) -> Array:
        """How much each normal counts as knowledge of the surface, (M,) from 0 to 1.

        Across an edge or a bend a fit leaves over more than the noise, and its normal is that of no
        surface: where the points stand decides it, and points that stand alike in two
        clouds have it wrong alike. 1 / (1 + (turn / BENT)^2) by how far the surface turns.
        """
        beyond = self.residual**2 - (EXPLAINED * self.noise) ** 2
        turn = np.where(beyond > 0.0, beyond, 0.0) / np.maximum(self.width**2, 1e-100)
        return np.asarray(1.0 / (1.0 + turn / BENT**2))

    @cached_property
    def shares(self) -> tuple[NDArray[np.intp], Array]:
        """Rows (K,) of the points with normals, and the share of their area up to each, (K,)."""
        x, y, z = self.normals.T
        rows = np.flatnonzero((x != 0.0) | (y != 0.0) | (z != 0.0))
        if len(rows) == 0:
            return rows, np.empty(0)
        # A few points that stand for far more than their share would be taken once only.
        area = self.patch[rows]
        area = np.minimum(area, 20.0 * np.median(area))
        return rows, np.cumsum(area) / area.sum()

    @cached_property
    def size(self) -> float:
        """Root mean square distance of the points from their centre, each by its area, metres."""
        offset = self.points - self.centre
        square = np.einsum("i,ij,ij->", self.patch, offset, offset) / self.patch.sum()
        return float(np.sqrt(square))

    @cached_property
    def centre(self) -> Array:
        """(3,) mean of the points, each by its area, metres."""
        # BLAS would start threads for it, which keep a core busy long after.
        return np.asarray(np.einsum("i,ij->j", self.patch, self.points) / self.patch.sum())


@stage("surface")
def surface(cloud: PointCloud, tree: Callable[[], Tree]) -> Surface:
    """Fit a plane to the neighbours of every point.

    An organised cloud has its neighbours in a window of the image, those left
    out that stand behind a jump in depth; any other has them from a k-d tree,
    and so has an image with so many holes that hardly a window holds a plane, and one
    whose rows are much farther apart than its columns.
    The noise is what the fits leave over, as a power of the distance from the
    sensor (a structured-light camera's grows with its square, a LiDAR's
    hardly), by least squares over the whole cloud.

    Parameters
    ----------
    cloud
        The points.
    tree
        Builds the k-d tree of its observed points where it is needed.

    Raises
    ------
    InputError
        The cloud has no observed point.
    """
    if len(cloud) == 0:
        raise InputError("cloud: no point is observed; a surface needs some")
    if not cloud.organised:
        return _unorganised(cloud, tree())
    viewpoint = np.zeros(3) if cloud.viewpoint is None else cloud.viewpoint
    angle, stride = _grid(cloud.points, viewpoint)
    if stride.max() > UNEVEN:
        return _unorganised(cloud, tree())
    found = _organised(cloud, viewpoint, angle, stride)
    return found if len(found.shares[0]) > FEW_PLANES * len(cloud) else _unorganised(cloud, tree())


def _organised(
    cloud: PointCloud, viewpoint: Array, angle: Array, stride: NDArray[np.int64]
) -> Surface:
    from hmrf_icp.kernels.surface import fit_window

    normals, residual, area, width = fit_window(cloud.points, viewpoint, angle, stride, WINDOW)
    seen = np.flatnonzero(cloud.observed)
    residual = residual.take(seen)
    points, areas = cloud.observed_points, _positive(area.take(seen))
    return Surface(
        points=points,
        normals=normals.reshape(-1, 3).take(seen, axis=0),
        noise=_noise(lengths(points - viewpoint), residual, np.sqrt(areas)),
        area=areas,
        oriented=cloud.viewpoint is not None,
        support=np.full(len(seen), (2.0 * WINDOW + 1.0) ** 2),
        residual=residual,
        width=width.take(seen),
        patch=areas,
    )


def _grid(points: Array, viewpoint: Array) -> tuple[Array, NDArray[np.int64]]:
    """Angles between rows and between columns (2,), and how many of each a window steps (2,).

    The rings of a spinning LiDAR are farther apart than the points along them: a window of as many
    points each way would be a line. A camera's pixels are as far apart one way as the other.
    """
    ends = [(near - viewpoint, far - viewpoint) for near, far in beside(points)]
    stride = np.ones(2, dtype=np.int64)
    between = [median(lengths(_unit(far) - _unit(near))) for near, far in ends]
    if min(between) > 0.0:
        stride = np.maximum(1, np.round(max(between) / np.array(between))).astype(np.int64)
    if stride.max() > 1:
        return np.array(between), stride
    with np.errstate(invalid="ignore", divide="ignore"):
        both = np.concatenate([lengths(far - near) / lengths(far) for near, far in ends])
    middle = median(both[both > 0.0])  # neighbours that coincide are no step
    return np.array([middle, middle]) if middle > 0.0 else np.ones(2), stride


def _unit(vectors: Array) -> Array:
    """Make vectors (M, 3) of length 1; NaN for none: a point at the viewpoint is at no angle."""
    length = lengths(vectors)
    return np.asarray(vectors / np.where(length > 0.0, length, np.nan)[:, None])


def _positive(area: Array) -> Array:
    """Give points without an area that of the smallest that has one: each stands for some."""
    some = area[area > 0.0]
    return np.maximum(area, some.min() if some.size else 1.0)


def _unorganised(cloud: PointCloud, tree: Tree) -> Surface:
    from hmrf_icp.kernels.surface import fit_neighbours

    points = cloud.observed_points
    thin, near = _spread_out(points, tree)
    known = cloud.viewpoint is not None
    viewpoint = points.mean(axis=0) if cloud.viewpoint is None else cloud.viewpoint

    def neighbours(of: Array, count: int) -> tuple[Array, NDArray[np.int64]]:
        distance, index = near.query(of, k=count)
        return distance.reshape(len(of), count), index.reshape(len(of), count)

    counts = np.array([min(NEIGHBOURS, len(thin))])
    distance, index = neighbours(points, int(counts[0]))
    everything = np.arange(len(points))
    normals, residual, support, reach, width = fit_neighbours(
        points, thin[index], distance, everything, counts, viewpoint
    )
    # Points before they were thinned, by the one that is left of them.
    stood = np.bincount(index[:, 0], minlength=len(thin)).astype(np.float64)
    held = stood[index].sum(axis=1)
    for more in MORE_NEIGHBOURS:
        lines = np.flatnonzero(np.isnan(residual))
        if not lines.size or len(thin) <= counts[-1]:
            break
        counts = np.unique(np.minimum(more, len(thin)))
        distance, index = neighbours(points[lines], int(counts[-1]))
        normals[lines], residual[lines], support[lines], reach[lines], width[lines] = (
            fit_neighbours(points, thin[index], distance, lines, counts, viewpoint)
        )
        last = support[lines].astype(np.int64)[:, None] - 1
        held[lines] = np.take_along_axis(stood[index].cumsum(axis=1), last, axis=1)[:, 0]
    # A disc that holds all the neighbours before they were thinned: its area shared among them,
    # or among as many as would be there on average.
    disc = np.pi * reach**2
    area = _positive(disc / np.maximum(held, 1.0))
    patch = _positive(disc / np.maximum(support, 1.0) * (len(thin) / len(points)))
    away = np.linalg.norm(points - viewpoint, axis=1) if known else np.ones(len(points))
    return Surface(
        points=points,
        normals=normals,
        noise=_noise(away, residual, np.sqrt(patch)),
        area=area,
        oriented=known,
        support=support,
        residual=residual,
        width=width,
        patch=patch,
    )


def _spread_out(points: Array, tree: Tree) -> tuple[NDArray[np.int64], Tree]:
    """Rows of the points among which neighbours are looked for, and the tree of those.

    None where another is nearer than :data:`THINNING` says, unless too few were left to fit a
    plane to; and never two at the same place, which are one place to a plane.
    """
    rows = thinned(points, 0.0)
    if len(rows) < len(points):
        points, tree = points[rows], Tree(points[rows])
    asked = at_most(points, SPACED)
    nearest, _ = tree.query(np.ascontiguousarray(asked), k=min(2, len(points)))
    usual = float(np.median(nearest.reshape(len(asked), -1)[:, -1]))
    apart = thinned(points, THINNING * usual)
    if len(apart) < NEIGHBOURS:
        return rows, tree
    return rows[apart], Tree(points[apart])


def _noise(reach: Array, residual: Array, spacing: Array) -> Array:
    """Noise of each point, metres: a power of its distance from the sensor, robustly fitted.

    Medians over eight groups of equal count, so that edges and curvature, which
    are few, do not count as noise; the power is kept within 0 and 2.5.
    """
    floor = NOISE_FLOOR * float(np.median(spacing))
    good = np.isfinite(residual) & (reach > 0)
    if np.count_nonzero(good) < 64:
        return np.full(len(reach), floor)
    rows = at_most(np.flatnonzero(good), FITTED)
    near, left_over = reach[rows], residual[rows]
    groups = np.array_split(np.argsort(near, kind="stable"), 8)
    at = np.log([np.median(near[group]) for group in groups])
    left = np.log(np.maximum([np.median(left_over[group]) for group in groups], floor))
    spread = ((at - at.mean()) ** 2).sum()
    power = float((at - at.mean()) @ left / spread) if spread > 1e-12 else 0.0
    power = min(max(power, 0.0), 2.5)
    scale = np.median(left - power * at)
    return np.asarray(np.maximum(np.exp(scale) * np.maximum(reach, 1e-300) ** power, floor))


def evenly(surface: Surface, count: int) -> NDArray[np.intp]:
    """Rows of about ``count`` points with normals that each stand for the same area.

    Every time the area summed along the cloud passes the middle of another share, the
    point is taken: no chance is involved, and near surfaces count no more than far ones.
    """
    rows, share = surface.shares
    if len(rows) <= count:
        return rows
    passed = np.floor(share * count + 0.5)
    return np.asarray(rows[np.diff(passed, prepend=0.0) > 0])
