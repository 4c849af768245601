"""Visibility test of a pose: what each sensor saw, held against the other's points."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.clouds.range_image import BAND
from hmrf_icp.clouds.surface import Surface, evenly
from hmrf_icp.stages import stage

AGREE, FRONT = 0, 1
"""As in :mod:`hmrf_icp.kernels.range_image`."""

FEW = 0.001
"""Share of the points asked that is added to counts whose ratio is taken."""

Array = NDArray[np.float64]

OFF = 4.0
"""Times what a point on a surface may be off it: farther away, a point is no evidence."""


@dataclass(frozen=True, eq=False)
class Sample:
    """Some points of a cloud, evenly over its surface, to be held against the other's view."""

    points: Array
    normals: Array

    @classmethod
    def of(cls, surface: Surface, count: int) -> Sample:
        """Choose about ``count`` points that each stand for the same area."""
        rows = evenly(surface, count)
        return cls(surface.points[rows], surface.normals[rows])


@dataclass(frozen=True)
class Visibility:
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
    views
        Whether a sensor's view was asked. Where no viewpoint is known, points
        agree with the surface they are on, are in ``front`` where they are a little off it and
        it goes on all round, and ``outside`` elsewhere.
    facing
        How many ways the points that agree face: the smallest eigenvalue of the mean of
        n n', 0 for a plane, at most 1/3.
    extent
        How far they extend along the direction in which they do least, root mean square, as
        a share of the target's size. Both are measured where no viewpoint is known: a plane
        laid on a plane agrees wherever it lies.
    clear
        Logarithm of agreement to free space violated from the origins of both frames, where
        those were assumed as viewpoints; None where they were not.

    Examples
    --------
    >>> from hmrf_icp import Visibility
    >>> Visibility(agree=900, front=10, behind=60, outside=30, other=0).asked
    1000
    """

    agree: int
    front: int
    behind: int
    outside: int
    other: int
    views: bool = True
    facing: float = 1.0 / 3.0
    extent: float = 1.0
    clear: float | None = None

    @property
    def asked(self) -> int:
        """Number of points that were held against a view."""
        return self.agree + self.front + self.behind + self.outside + self.other


class Asked(Protocol):
    """Anything that can be asked what it knows of points moved into its frame."""

    def ask(self, points: Array, normals: Array, pose: Array) -> NDArray[np.uint8]:
        """Return a code (M,) of :mod:`hmrf_icp.kernels.range_image` for each point (M, 3)."""


class NearSurface:
    """A surface seen from nowhere in particular: points are on it, off it, or beyond it.

    Nobody knows what was seen to be empty. But a surface that goes on all round a point was
    sampled there, and what lies a little off it contradicts it as free space does: of two poses
    the right one lays surface on surface, and the wrong one through it. What is near the border
    of a surface, or far from any, is no evidence.

    Parameters
    ----------
    cloud
        The cloud.
    band
        Deviations of the noise by which a point on the surface may be off it, beside the spacing.
    sides
        Whether it is known which side of the surface was seen, and of the points that are asked:
        what lies on it and faces the opposite way is no part of it, and a little off it may be
        the other side of a thin thing.
    """

    def __init__(self, cloud: PreparedCloud, band: float = BAND, sides: bool = False) -> None:
        self._sides = sides
        self._surface = surface = cloud.surface
        self._tree = cloud.tree
        self._band = band * surface.noise + np.sqrt(surface.patch)
        self._border = cloud.border
        self._reach = OFF * float(self._band.max())

    def ask(self, points: Array, normals: Array, pose: Array) -> NDArray[np.uint8]:
        """Ask who is on the surface, facing its way, and who is off it where it goes on."""
        distance, row = self._tree.query(se3.transform(pose, points), within=self._reach)
        return self.tell(distance, row, normals @ pose[:3, :3].T)

    def tell(self, distance: Array, row: NDArray[np.integer], normals: Array) -> NDArray[np.uint8]:
        """Tell the same of points with normals (M, 3) at a distance (M,) from the closest row."""
        from hmrf_icp.kernels.range_image import FACING, OTHER, OUTSIDE

        cosine = (normals * self._surface.normals[row]).sum(axis=1)
        cosine = cosine if self._sides else np.abs(cosine)
        on = np.where(cosine > FACING, AGREE, OTHER)
        off = (distance < OFF * self._band[row]) & ~self._border[row] & (cosine > -FACING)
        seen = np.where(distance < self._band[row], on, np.where(off, FRONT, OUTSIDE))
        return seen.astype(np.uint8)


class VisibilityTest:
    """Hold poses of one pair of clouds against what both sensors saw.

    Parameters
    ----------
    source, target
        The clouds.
    count
        Points of each that are asked.

    Attributes
    ----------
    views
        Whether it is known where both were seen from; otherwise surfaces take the place of free
        space, as :class:`NearSurface` has it.
    """

    def __init__(self, source: PreparedCloud, target: PreparedCloud, count: int) -> None:
        self._of_source = Sample.of(source.surface, count)
        self._of_target = Sample.of(target.surface, count)
        self._by_source, self._by_target, self.views = knowing(source, target)
        self._size = target.surface.size
        self._from_origins = source.image_from_origin, target.image_from_origin

    @stage("visibility")
    def __call__(self, pose: Array) -> Visibility:
        """Ask about one pose (4, 4), source to target."""
        mine, theirs = self._of_source, self._of_target
        of_source = self._by_target.ask(mine.points, mine.normals, pose)
        of_target = self._by_source.ask(theirs.points, theirs.normals, se3.inverse(pose))
        counts = np.bincount(of_source, minlength=5) + np.bincount(of_target, minlength=5)
        agree, front, behind, outside, other = (int(n) for n in counts)
        if self.views:
            return Visibility(agree, front, behind, outside, other)
        clear = self._clear(pose)
        one, two = of_source == AGREE, of_target == AGREE
        points = np.concatenate([se3.transform(pose, mine.points[one]), theirs.points[two]])
        normals = np.concatenate([mine.normals[one] @ pose[:3, :3].T, theirs.normals[two]])
        return Visibility(
            agree,
            front,
            behind,
            outside,
            other,
            False,
            least_spread(normals),
            math.sqrt(least_spread(points - points.mean(axis=0))) / self._size if agree else 0.0,
            clear,
        )

    def _clear(self, pose: Array) -> float | None:
        """Hold a pose against free space as it would be if both origins were viewpoints."""
        from_source, from_target = self._from_origins
        if from_source is None or from_target is None:
            return None
        mine, theirs = self._of_source, self._of_target
        seen = np.concatenate(
            [
                from_target.ask(mine.points, mine.normals, pose),
                from_source.ask(theirs.points, theirs.normals, se3.inverse(pose)),
            ]
        )
        few = FEW * len(seen)
        agree, front = np.count_nonzero(seen == AGREE), np.count_nonzero(seen == FRONT)
        return math.log((agree + few) / (front + few))


def knowing(source: PreparedCloud, target: PreparedCloud) -> tuple[Asked, Asked, bool]:
    """Say who can be asked of each cloud, and whether both are what a sensor saw."""
    by_source, by_target = source.range_image, target.range_image
    if by_source is not None and by_target is not None:
        return by_source, by_target, True
    sides = source.surface.oriented and target.surface.oriented
    return NearSurface(source, sides=sides), NearSurface(target, sides=sides), False


def least_spread(vectors: Array) -> float:
    """Return the smallest eigenvalue of the mean of v v' over vectors (M, 3); 0 of none."""
    if len(vectors) == 0:
        return 0.0
    return max(float(np.linalg.eigvalsh(vectors.T @ vectors / len(vectors))[0]), 0.0)
