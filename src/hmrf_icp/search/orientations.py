"""Rotations under which two clouds face alike, from nothing but how their surfaces face.

The directions of a cloud's normals, each by its area, say how it may be turned, wherever it
stands (the extended Gaussian image; Horn, 1984). A room has a few sharp ones, a table one
and what stands on it. Rotations that cover all of them evenly are rated by how much
of both images they lay on each other, the best are improved, and those that are far
apart are kept. Two planes that face alike are enough; with one, its turns about the
normal stay apart, and rank by what else there is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3, threads

Array = NDArray[np.float64]

DIRECTIONS = 400
"""Directions that an image is sampled at: about ten degrees apart."""

SIDE = 48
"""Edge of the table that directions are looked up in: cells of four degrees."""

WIDTH = math.radians(6.0)
"""Spread that every normal is given: what noise and the sampling of rotations leave open."""

POWER = 0.5
"""The image counts by its square root: a large plane is no more certain than a small one."""

FAINT = 5e-3
"""Directions in which less of the area faces are left out of the sum."""

COVERING = 5000
"""Rotations that are rated: the nearest to any is about eight degrees away."""

CLIMBERS = 1000
"""The best of them are improved ..."""

STEPS = (math.radians(4.0), math.radians(2.0))
"""... by turns about each axis, twice by each of these."""

APART = math.radians(10.0)
"""Angle within which only the best rotation is kept."""


@dataclass(frozen=True, eq=False)
class Orientations:
    """How the surface of a cloud faces.

    Attributes
    ----------
    directions, weight
        (N, 3) unit vectors, and how much faces there, (N,), to :data:`POWER`.
    table
        (S, S) the same for any direction, as :func:`hmrf_icp.kernels.orientations.alike`
        looks it up.
    """

    directions: Array
    weight: Array
    table: Array

    @classmethod
    def of(cls, normals: Array, signed: bool) -> Orientations:
        """Take the image of unit normals (M, 3), each of the same area.

        Without ``signed`` a normal and its opposite are the same.
        """
        where = sphere(DIRECTIONS)
        cosine = normals @ where.T
        if not signed:
            cosine = np.abs(cosine)
        nearest = cosine.argmax(axis=1)
        facing = (normals * where[nearest]).sum(axis=1)
        turned = normals if signed else normals * np.where(facing < 0.0, -1.0, 1.0)[:, None]
        # Where the normals of a bin really point, so that the bins do not blur a plane.
        sums = np.stack(
            [np.bincount(nearest, turned[:, axis], DIRECTIONS) for axis in range(3)], axis=1
        )
        count = np.bincount(nearest, minlength=DIRECTIONS)
        filled = count > 0
        means = sums[filled] / np.linalg.norm(sums[filled], axis=1, keepdims=True)
        share = count[filled] / len(normals)

        density = _density(where, means, share, signed)
        clear = density > FAINT
        table = _density(unfolded(SIDE), means, share, signed) ** POWER
        weight = density[clear] ** POWER
        return cls(
            where[clear],
            weight / weight.sum(),
            (table / np.sqrt(np.mean(table**2))).reshape(SIDE, SIDE),
        )


def _density(at: Array, means: Array, share: Array, signed: bool) -> Array:
    cosine = at @ means.T
    if not signed:
        cosine = np.abs(cosine)
    return np.asarray(np.exp((cosine - 1.0) / WIDTH**2) @ share)


def likely_rotations(source: Orientations, target: Orientations, most: int) -> tuple[Array, Array]:
    """Find rotations under which the source faces like the target.

    Returns
    -------
    (K, 3, 3) rotations, source to target, the likeliest first, at most ``most`` and
    at least :data:`APART` from each other, and how alike they are, (K,).
    """
    from hmrf_icp.kernels.orientations import climb, rate

    lookup = source.directions, source.weight, target.table
    cover = covering(COVERING)
    workers = threads.current()
    score = np.concatenate(workers.over(lambda some: rate(some, *lookup), cover, 100))
    best = np.argsort(-score, kind="stable")[:CLIMBERS]
    rotations, score = cover[best], score[best]
    turns = [
        se3.rotation_exp(sign * step * axis)
        for step in STEPS
        for _ in range(2)
        for axis in np.eye(3)
        for sign in (1.0, -1.0)
    ]
    turned = np.array(turns)

    def climbed(some: range) -> None:
        rows = slice(some.start, some.stop)
        climb(rotations[rows], score[rows], turned, *lookup)

    workers.over(climbed, range(len(rotations)), 10)
    kept = _apart(rotations, score, most)
    return rotations[kept], score[kept]


def _apart(rotations: Array, score: Array, most: int) -> NDArray[np.intp]:
    """Rows of the best rotations, none within :data:`APART` of a better one."""
    flat = rotations.reshape(-1, 9)
    close = 1.0 + 2.0 * math.cos(APART)
    open_still = np.ones(len(flat), dtype=np.bool_)
    kept: list[int] = []
    for i in np.argsort(-score, kind="stable"):
        if open_still[i]:
            kept.append(int(i))
            if len(kept) == most:
                break
            open_still &= flat @ flat[i] <= close
    return np.array(kept, dtype=np.intp)


@lru_cache(maxsize=4)
def sphere(count: int) -> Array:
    """Spread ``count`` unit vectors (N, 3) evenly, along a spiral of the golden angle."""
    step = np.arange(count) + 0.5
    z = 1.0 - 2.0 * step / count
    angle = np.pi * (1.0 + math.sqrt(5.0)) * step
    across = np.sqrt(1.0 - z * z)
    return _frozen(np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1))


@lru_cache(maxsize=4)
def covering(count: int) -> Array:
    """Spread ``count`` rotations (N, 3, 3) evenly (super-Fibonacci spirals; Alexa, 2022)."""
    step = np.arange(count) + 0.5
    one = 2.0 * np.pi * step / math.sqrt(2.0)
    other = 2.0 * np.pi * step / 1.533751168755204288118041
    low, high = np.sqrt(step / count), np.sqrt(1.0 - step / count)
    x, y = low * np.sin(one), low * np.cos(one)
    z, w = high * np.sin(other), high * np.cos(other)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return _frozen(np.ascontiguousarray(np.moveaxis(np.array(rows), 2, 0)))


@lru_cache(maxsize=2)
def unfolded(side: int) -> Array:
    """Directions (S * S, 3) of the cells of an unfolded octahedron, row by row."""
    line = (np.arange(side) + 0.5) / side * 2.0 - 1.0
    u, v = np.meshgrid(line, line, indexing="ij")
    z = 1.0 - np.abs(u) - np.abs(v)
    below = z < 0.0
    x = np.where(below, (1.0 - np.abs(v)) * np.sign(u), u)
    y = np.where(below, (1.0 - np.abs(u)) * np.sign(v), v)
    cells = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    return _frozen(cells / np.linalg.norm(cells, axis=1, keepdims=True))


def _frozen(values: Array) -> Array:
    values.flags.writeable = False
    return values
