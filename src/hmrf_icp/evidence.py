"""Evidence for or against a whole pose: what each sensor saw, held against the other's points."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import kept, se3
from hmrf_icp.cloud import PointCloud
from hmrf_icp.match import tree_of
from hmrf_icp.surface import Surface, surface_of
from hmrf_icp.view import BAND, view_of

Array = NDArray[np.float64]

OFF = 4.0
"""Times what a point on a surface may be off it: farther away, a point is no evidence."""

AROUND, GAP = 20, math.radians(110.0)
"""Neighbours of a point, and the angle that they leave free from which it is at a border."""


@dataclass(frozen=True, eq=False)
class Witness:
    """Some points of a cloud, evenly over its surface, to be held against the other's view."""

    points: Array
    normals: Array

    @classmethod
    def of(cls, surface: Surface, count: int) -> Witness:
        """Choose about ``count`` points that each stand for the same area."""
        rows = evenly(surface, count)
        return cls(surface.points[rows], surface.normals[rows])


@dataclass(frozen=True)
class Verdict:
    """How many points of both clouds agree with, contradict, or escape the other's view.

    Attributes
    ----------
    agree
        On a surface that was seen there, facing the same way.
    front
        In space that was seen to be empty.
    behind
        Hidden behind what was seen: no evidence.
    outside
        Where the sensor did not look, or saw nothing: no evidence.
    other
        At the depth of a surface that faces another way.
    seen
        Whether a sensor's view was asked. Where no viewpoint is known, points
        agree with the surface they are on, are in ``front`` where they are a little off it and
        it goes on all round, and ``outside`` elsewhere.
    """

    agree: int
    front: int
    behind: int
    outside: int
    other: int
    seen: bool = True

    @property
    def asked(self) -> int:
        """Number of points that were held against a view."""
        return self.agree + self.front + self.behind + self.outside + self.other


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


class Asked(Protocol):
    """Anything that can be asked what it knows of points moved into its frame."""

    def ask(self, points: Array, normals: Array, pose: Array) -> NDArray[np.uint8]:
        """Return a verdict (M,) of :mod:`hmrf_icp.kernels.view` for each point (M, 3)."""


class Near:
    """A surface seen from nowhere in particular: points are on it, off it, or beyond it.

    Nobody knows what was seen to be empty. But a surface that goes on all round a point was
    sampled there, and what lies a little off it contradicts it as free space does: of two poses
    the right one lays surface on surface, and the wrong one through it. What is near the border of
    a surface, or far from any, is no evidence.

    Parameters
    ----------
    cloud
        The cloud.
    band
        Deviations of the noise by which a point on the surface may be off it, beside the spacing.
    """

    def __init__(self, cloud: PointCloud, band: float = BAND) -> None:
        self._surface = surface = surface_of(cloud)
        self._tree = tree_of(cloud)
        self._band = band * surface.noise + np.sqrt(surface.area)
        self._border = border_of(cloud)

    def ask(self, points: Array, normals: Array, pose: Array) -> NDArray[np.uint8]:
        """Ask who is on the surface, facing its way, and who is off it where it goes on."""
        distance, row = self._tree.query(se3.transform(pose, points))
        return self.tell(distance, row, normals @ pose[:3, :3].T)

    def tell(self, distance: Array, row: NDArray[np.integer], normals: Array) -> NDArray[np.uint8]:
        """Tell the same of points with normals (M, 3) at a distance (M,) from the closest row."""
        from hmrf_icp.kernels.view import AGREE, FACING, FRONT, OTHER, OUTSIDE

        cosine = np.abs((normals * self._surface.normals[row]).sum(axis=1))
        on = np.where(cosine > FACING, AGREE, OTHER)
        off = (distance < OFF * self._band[row]) & ~self._border[row]
        verdict = np.where(distance < self._band[row], on, np.where(off, FRONT, OUTSIDE))
        return verdict.astype(np.uint8)


def border_of(cloud: PointCloud) -> NDArray[np.bool_]:
    """Tell which observed points (M,) are at the border of their surface; done once a cloud."""

    def find() -> NDArray[np.bool_]:
        from hmrf_icp.kernels.border import find_border

        surface = surface_of(cloud)
        count = min(AROUND + 1, len(surface.points))
        _, index = tree_of(cloud).query(surface.points, k=count)
        border = np.empty(len(surface.points), dtype=np.bool_)
        neighbours = np.ascontiguousarray(index[:, 1:], dtype=np.int64)
        find_border(surface.points, surface.normals, neighbours, GAP, border)
        return border

    return kept.once(cloud, "border", find)


class Judge:
    """Hold poses of one pair of clouds against what both sensors saw.

    Parameters
    ----------
    source, target
        The clouds.
    count
        Points of each that are asked.

    Attributes
    ----------
    seen
        Whether a sensor's view is known; otherwise surfaces that are near agree.
    """

    def __init__(self, source: PointCloud, target: PointCloud, count: int) -> None:
        self._of_source = Witness.of(surface_of(source), count)
        self._of_target = Witness.of(surface_of(target), count)
        self._by_source: Asked | None = view_of(source)
        self._by_target: Asked | None = view_of(target)
        self.seen = self._by_source is not None or self._by_target is not None
        if not self.seen:
            self._by_source, self._by_target = Near(source), Near(target)

    def __call__(self, pose: Array) -> Verdict:
        """Ask about one pose (4, 4), source to target."""
        counts = np.zeros(5, dtype=np.int64)
        for witness, view, motion in (
            (self._of_source, self._by_target, pose),
            (self._of_target, self._by_source, se3.inverse(pose)),
        ):
            if view is not None:
                verdict = view.ask(witness.points, witness.normals, motion)
                counts += np.bincount(verdict, minlength=5)
        agree, front, behind, outside, other = (int(n) for n in counts)
        return Verdict(agree, front, behind, outside, other, self.seen)
