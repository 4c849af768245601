"""The solids and surfaces that a rendered scene is built from, and where a ray meets them.

A primitive stands in its own frame (stated with each) and is placed in the
world by a (4, 4) pose, primitive to world. Lengths are metres. Rays are
``origin + t * direction``; a direction need not have length 1, and ``t`` is in
its units: a camera whose rays have z = 1 reads ``t`` as depth.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.se3 import Array, inverse, transform

_TINY = 1e-300
"""Stands in for a direction's zero component, so that 0 / 0 never arises."""

_BLOCK = 8192
"""Rays handled at once: they stay in the cache, and BLAS starts no threads to turn them."""


@dataclass(frozen=True, eq=False)
class Primitive(ABC):
    """A shape placed in the world.

    Parameters
    ----------
    pose
        (4, 4), the shape's own frame to the world.
    """

    pose: Array

    @property
    @abstractmethod
    def bounds(self) -> tuple[Array, Array]:
        """Least and greatest corner (3,) of the box around the shape, in its own frame."""

    @abstractmethod
    def _hit(self, origin: Array, directions: Array) -> Array:
        """Do what ``intersect`` does, for rays (N, 3) in the shape's own frame."""

    def corners(self) -> Array:
        """(8, 3) corners of the box around the shape, in the world."""
        low, high = self.bounds
        choice = np.array(np.meshgrid(*[[0, 1]] * 3)).reshape(3, 8).T
        return transform(self.pose, np.where(choice, high, low))

    def intersect(self, origin: Array, directions: Array) -> Array:
        """Find where rays first meet the shape.

        Parameters
        ----------
        origin
            (3,), where all rays start, world frame.
        directions
            (N, 3), world frame.

        Returns
        -------
        (N,): the least t > 0, infinity where the shape is missed.
        """
        local = transform(inverse(self.pose), origin)
        distance = np.empty(len(directions))
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for begin in range(0, len(directions), _BLOCK):
                block = slice(begin, begin + _BLOCK)
                distance[block] = self._hit(local, directions[block] @ self.pose[:3, :3])
        return distance


def _no_zero(component: Array) -> Array:
    return np.where(component == 0.0, _TINY, component)


def _towards_centre(origin: Array, directions: Array) -> tuple[Array, Array]:
    """Start each ray where it passes nearest to the shape's origin.

    Curved shapes lose digits in their discriminants when the ray starts far
    away. Returns t (N,) of the new starts, and the starts (N, 3).
    """
    t = -(directions @ origin) / np.einsum("ij,ij->i", directions, directions)
    return t, origin + t[:, None] * directions


def _first(candidates: list[tuple[Array, NDArray[np.bool_]]]) -> Array:
    """Least positive t among candidates, each with where it is valid."""
    best = np.full(len(candidates[0][0]), np.inf)
    for t, valid in candidates:
        np.minimum(best, np.where(valid & (t > 0), t, np.inf), out=best)
    return best


@dataclass(frozen=True, eq=False)
class Rectangle(Primitive):
    """A flat patch in the plane z = 0 of its frame, centred at the origin, seen from both sides.

    Parameters
    ----------
    size
        Along x and y, metres.
    """

    size: tuple[float, float]

    @property
    def bounds(self) -> tuple[Array, Array]:
        """See `Primitive`."""
        half = np.array([self.size[0] / 2, self.size[1] / 2, 0.0])
        return -half, half

    def _hit(self, origin: Array, directions: Array) -> Array:
        t = -origin[2] / directions[:, 2]
        inside = np.abs(origin[0] + t * directions[:, 0]) <= self.size[0] / 2
        inside &= np.abs(origin[1] + t * directions[:, 1]) <= self.size[1] / 2
        return _first([(t, inside)])


@dataclass(frozen=True, eq=False)
class Box(Primitive):
    """A solid box, centred at the origin of its frame, edges along the axes.

    Parameters
    ----------
    size
        Along x, y and z, metres.
    """

    size: tuple[float, float, float]

    @property
    def bounds(self) -> tuple[Array, Array]:
        """See `Primitive`."""
        half = np.array(self.size) / 2
        return -half, half

    def _hit(self, origin: Array, directions: Array) -> Array:
        enter = np.full(len(directions), -np.inf)
        leave = np.full(len(directions), np.inf)
        for axis in range(3):
            half = self.size[axis] / 2
            along = _no_zero(directions[:, axis])
            one, other = (-half - origin[axis]) / along, (half - origin[axis]) / along
            np.maximum(enter, np.minimum(one, other), out=enter)
            np.minimum(leave, np.maximum(one, other), out=leave)
        met = enter <= leave
        return _first([(enter, met), (leave, met)])


@dataclass(frozen=True, eq=False)
class Sphere(Primitive):
    """A sphere around the origin of its frame.

    Parameters
    ----------
    radius
        Metres.
    """

    radius: float

    @property
    def bounds(self) -> tuple[Array, Array]:
        """See `Primitive`."""
        half = np.full(3, self.radius)
        return -half, half

    def _hit(self, origin: Array, directions: Array) -> Array:
        nearest, start = _towards_centre(origin, directions)
        square = self.radius**2 - np.einsum("ij,ij->i", start, start)
        met = square >= 0
        chord = np.sqrt(np.maximum(square, 0.0)) / np.linalg.norm(directions, axis=1)
        return _first([(nearest - chord, met), (nearest + chord, met)])


@dataclass(frozen=True, eq=False)
class Frustum(Primitive):
    """A cylinder or truncated cone around the z axis of its frame, from z = 0 to z = height.

    Parameters
    ----------
    bottom, top
        Radius at z = 0 and at z = height, metres.
    height
        Metres.
    closed_bottom, closed_top
        Whether a disc closes that end. An open end shows the inside of the
        wall, which has no thickness: a mug, a lamp shade, a bin.
    """

    bottom: float
    top: float
    height: float
    closed_bottom: bool = True
    closed_top: bool = True

    @property
    def bounds(self) -> tuple[Array, Array]:
        """See `Primitive`."""
        widest = max(self.bottom, self.top)
        return np.array([-widest, -widest, 0.0]), np.array([widest, widest, self.height])

    def _hit(self, origin: Array, directions: Array) -> Array:
        shift, start = _towards_centre(origin, directions)
        (x, y, z), (dx, dy, dz) = start.T, directions.T
        slope = (self.top - self.bottom) / self.height
        radius = self.bottom + slope * z
        # x^2 + y^2 = (bottom + slope z)^2 along the ray: a t^2 + 2 b t + c = 0.
        a = dx * dx + dy * dy - (slope * dz) ** 2
        b = x * dx + y * dy - slope * dz * radius
        c = x * x + y * y - radius * radius
        square = b * b - a * c
        met = square >= 0
        q = -(b + np.copysign(np.sqrt(np.maximum(square, 0.0)), b))
        candidates = []
        for t in (q / a, c / q):
            height = z + t * dz
            candidates.append((t + shift, met & (height >= 0) & (height <= self.height)))
        for closed, level, size in (
            (self.closed_bottom, 0.0, self.bottom),
            (self.closed_top, self.height, self.top),
        ):
            if closed:
                t = (level - z) / dz
                candidates.append((t + shift, (x + t * dx) ** 2 + (y + t * dy) ** 2 <= size * size))
        return _first(candidates)


@dataclass(frozen=True, eq=False)
class Torus(Primitive):
    """A ring around the z axis of its frame, centred at the origin.

    Parameters
    ----------
    ring
        From the centre to the middle of the tube, metres.
    tube
        Radius of the tube, metres.
    """

    ring: float
    tube: float

    @property
    def bounds(self) -> tuple[Array, Array]:
        """See `Primitive`."""
        half = np.array([self.ring + self.tube, self.ring + self.tube, self.tube])
        return -half, half

    def _hit(self, origin: Array, directions: Array) -> Array:
        length = np.linalg.norm(directions, axis=1)
        unit = directions / length[:, None]
        shift, start = _towards_centre(origin, unit)
        hit = np.full(len(directions), np.inf)
        near = np.flatnonzero(np.linalg.norm(start, axis=1) < self.ring + self.tube)
        if len(near) == 0:
            return hit
        (x, y, z), (dx, dy, _) = start[near].T, unit[near].T
        # (|p|^2 + ring^2 - tube^2)^2 = 4 ring^2 (x^2 + y^2). The start is where the
        # ray passes nearest to the centre, so t^4 + a t^2 + b t + c has no cubic term.
        g = x * x + y * y + z * z + self.ring**2 - self.tube**2
        a = 2 * g - 4 * self.ring**2 * (dx * dx + dy * dy)
        b = -8 * self.ring**2 * (x * dx + y * dy)
        c = g * g - 4 * self.ring**2 * (x * x + y * y)
        companion = np.zeros((len(near), 4, 4))
        companion[:, 1, 0] = companion[:, 2, 1] = companion[:, 3, 2] = 1.0
        companion[:, 0, 3], companion[:, 1, 3], companion[:, 2, 3] = -c, -b, -a
        roots = np.linalg.eigvals(companion)
        t = roots.real
        for _ in range(2):  # Newton's steps: eigenvalues alone are good to about 1e-8
            value = ((t * t + a[:, None]) * t + b[:, None]) * t + c[:, None]
            gradient = (4 * t * t + 2 * a[:, None]) * t + b[:, None]
            step = value / gradient
            t = t - np.where(np.isfinite(step) & (np.abs(step) < self.tube), step, 0.0)
        real = np.abs(roots.imag) < 1e-6 * self.ring
        t = t + shift[near, None]
        hit[near] = np.where(real & (t > 0), t, np.inf).min(axis=1) / length[near]
        return hit
