"""The surface that a cloud samples: normals, noise, and the area a point stands for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.downsample import thinned
from hmrf_icp.clouds.tree import Tree
from hmrf_icp.errors import InputError

Array = NDArray[np.float64]

WINDOW = 2
"""Pixels to each side of a pixel whose points its normal is fitted to (a window of 5 x 5)."""

NEIGHBOURS = 16
"""Points that a normal is fitted to where there is no grid."""

THINNING = 3.0
"""Edge of the cells that keep one neighbour each, in median distances to the nearest neighbour.

The points of a spinning LiDAR stand close along a ring and far from the next:
their nearest neighbours are a line, to which any plane fits. Thinned, they reach across.
"""

FEW_PLANES = 0.1
"""Share of the points with a normal from their window below which the window is too small.

An image with few pixels left has neighbours farther away than its windows reach.
"""

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
    oriented
        Whether the normals have a sign.
    support
        Points that a normal was fitted to.
    """

    points: Array
    normals: Array
    noise: Array
    area: Array
    oriented: bool
    support: int

    @cached_property
    def spacing(self) -> float:
        """Typical distance between neighbouring points, metres."""
        return float(np.sqrt(np.median(self.area)))

    @cached_property
    def tilt(self) -> Array:
        """Standard deviation of the normals about each tangent, (M,) radians.

        What the noise does to a plane fitted to ``support`` points that cover
        as many times their area: to first order noise over the root of their
        summed squares, and more where the noise is not small against the patch.
        """
        relative = self.noise**2 / np.maximum(self.area, 1e-300)
        patch = self.support / 12.0
        return np.asarray(np.sqrt(relative / (self.support * patch) * (1.0 + relative / patch)))

    @cached_property
    def size(self) -> float:
        """Root mean square distance of the points from their centre, each by its area, metres."""
        weight = self.area / self.area.sum()
        centre = weight @ self.points
        return float(np.sqrt(weight @ ((self.points - centre) ** 2).sum(axis=1)))


def surface(cloud: PointCloud, tree: Callable[[], Tree]) -> Surface:
    """Fit a plane to the neighbours of every point.

    An organised cloud has its neighbours in a window of the image, those left
    out that stand behind a jump in depth; any other has them from a k-d tree,
    and so has an image with so many holes that hardly a window holds a plane.
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
    found = _organised(cloud)
    planes = np.count_nonzero((found.normals != 0.0).any(axis=1))
    return found if planes > FEW_PLANES * len(cloud) else _unorganised(cloud, tree())


def _organised(cloud: PointCloud) -> Surface:
    from hmrf_icp.kernels.surface import fit_window

    viewpoint = np.zeros(3) if cloud.viewpoint is None else cloud.viewpoint
    reach = np.linalg.norm(cloud.points - viewpoint, axis=-1)
    angle = _angular_step(cloud.points, reach)
    normals, residual, area = fit_window(cloud.points, viewpoint, angle, WINDOW)
    seen = cloud.observed
    areas = _positive(area[seen])
    return Surface(
        points=cloud.observed_points,
        normals=normals[seen],
        noise=_noise(reach[seen], residual[seen], np.sqrt(areas)),
        area=areas,
        oriented=cloud.viewpoint is not None,
        support=(2 * WINDOW + 1) ** 2,
    )


def _angular_step(points: Array, reach: Array) -> float:
    """Median angle between neighbours of the grid, radians, seen from the viewpoint.

    Neighbours that coincide are no step, and a point at the viewpoint is at no angle.
    """
    reach = np.where(reach > 0.0, reach, np.nan)
    steps = [
        np.linalg.norm(np.diff(points, axis=axis), axis=-1)
        / (reach[1:] if axis == 0 else reach[:, 1:])
        for axis in (0, 1)
    ]
    both = np.concatenate([step[np.isfinite(step) & (step > 0.0)] for step in steps])
    return float(np.median(both)) if both.size else 1.0


def _positive(area: Array) -> Array:
    """Give points without an area that of the smallest that has one: each stands for some."""
    some = area[area > 0.0]
    return np.maximum(area, some.min() if some.size else 1.0)


def _unorganised(cloud: PointCloud, tree: Tree) -> Surface:
    from hmrf_icp.kernels.surface import fit_neighbours

    points = cloud.observed_points
    thin, near = _spread_out(points, tree)
    count = min(NEIGHBOURS, len(thin))
    distance, index = near.query(points, k=count)
    distance, index = distance.reshape(len(points), count), index.reshape(len(points), count)
    known = cloud.viewpoint is not None
    viewpoint = points.mean(axis=0) if cloud.viewpoint is None else cloud.viewpoint
    normals, residual = fit_neighbours(points, thin[index], viewpoint)
    # A disc that holds all the neighbours before they were thinned: its area shared among them.
    area = _positive(np.pi * distance[:, -1] ** 2 / count * (len(thin) / len(points)))
    reach = np.linalg.norm(points - viewpoint, axis=1) if known else np.ones(len(points))
    return Surface(
        points=points,
        normals=normals,
        noise=_noise(reach, residual, np.sqrt(area)),
        area=area,
        oriented=known,
        support=count,
    )


def _spread_out(points: Array, tree: Tree) -> tuple[NDArray[np.int64], Tree]:
    """Rows of the points among which neighbours are looked for, and the tree of those.

    None where another is nearer than :data:`THINNING` says, unless too few were left to fit a
    plane to; and never two at the same place, which are one place to a plane.
    """
    rows = np.arange(len(points))
    nearest, _ = tree.query(points, k=min(2, len(points)))
    nearest = nearest.reshape(len(points), -1)[:, -1]
    if not nearest.min() > 0.0:
        rows = thinned(points, 0.0)
        if len(rows) < len(points):
            tree = Tree(points[rows])
            nearest, _ = tree.query(points[rows], k=min(2, len(rows)))
            nearest = nearest.reshape(len(rows), -1)[:, -1]
    apart = thinned(points[rows], THINNING * float(np.median(nearest)))
    if len(apart) < NEIGHBOURS:
        return rows, tree
    return rows[apart], Tree(points[rows[apart]])


def _noise(reach: Array, residual: Array, spacing: Array) -> Array:
    """Noise of each point, metres: a power of its distance from the sensor, robustly fitted.

    Medians over eight groups of equal count, so that edges and curvature, which
    are few, do not count as noise; the power is kept within 0 and 2.5.
    """
    floor = NOISE_FLOOR * float(np.median(spacing))
    good = np.isfinite(residual) & (reach > 0)
    if np.count_nonzero(good) < 64:
        return np.full(len(reach), floor)
    order = np.argsort(reach[good], kind="stable")
    groups = np.array_split(order, 8)
    at = np.log([np.median(reach[good][group]) for group in groups])
    left = np.log(np.maximum([np.median(residual[good][group]) for group in groups], floor))
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
    rows = np.flatnonzero((surface.normals != 0.0).any(axis=1))
    if len(rows) <= count:
        return rows
    # A few points that stand for far more than their share would be taken once only.
    area = np.minimum(surface.area[rows], 20.0 * np.median(surface.area[rows]))
    passed = np.floor(np.cumsum(area) * (count / area.sum()) + 0.5)
    return np.asarray(rows[np.diff(passed, prepend=0.0) > 0])
