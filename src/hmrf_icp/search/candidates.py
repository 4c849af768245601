"""Candidates: many starts, each registered quickly on a few points of both clouds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import kept, se3
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.surface import Surface, surface_of
from hmrf_icp.search.visibility import evenly

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Level:
    """How finely the candidates of one level are registered.

    Parameters
    ----------
    source_points, target_points
        Points of each cloud that take part.
    cells
        Cells of the table along the target's longest side.
    margin
        Cells of the table beyond the target on every side.
    scales
        Distances at which a match counts for less, falling, as shares of the
        target's size (root mean square distance from its centre).
    steps
        Iterations at each scale.
    """

    source_points: int
    target_points: int
    cells: int
    margin: int
    scales: tuple[float, ...]
    steps: int


@dataclass(frozen=True, eq=False)
class Onto:
    """A few points of a target, with a table of space that knows the closest of them.

    Attributes
    ----------
    points, normals
        (N, 3) metres, and unit vectors.
    table, corner, edge
        As :mod:`hmrf_icp.kernels.table` has them: a row of ``points`` for every
        cell (A, B, C), the corner (3,) of the first and the edge of all, metres.
    """

    points: Array
    normals: Array
    table: NDArray[np.int32]
    corner: Array
    edge: float

    @classmethod
    def of(cls, surface: Surface, level: Level) -> Onto:
        """Choose points evenly by area, and lay the table round them."""
        from hmrf_icp.kernels import table

        rows = evenly(surface, level.target_points)
        points = surface.points[rows]
        low, high = points.min(axis=0), points.max(axis=0)
        edge = float((high - low).max()) / level.cells
        # The outermost points stand in the middle of their cells: on an edge between two,
        # rounding would say which is theirs, and in other units another one.
        corner = low - (level.margin + 0.5) * edge
        shape = np.floor((high - low) / edge + 2 * level.margin + 1.5).astype(np.int64)
        cells = table.build(points, corner, edge, tuple(int(n) for n in shape))
        return cls(points, surface.normals[rows], cells, corner, edge)


class Annealer:
    """Register one pair of clouds on one level, from any number of starts."""

    def __init__(self, source: PointCloud, target: PointCloud, level: Level) -> None:
        mine, theirs = surface_of(source), surface_of(target)
        rows = evenly(mine, level.source_points)
        self._points, self._normals = mine.points[rows], mine.normals[rows]
        self._signed = mine.oriented and theirs.oriented
        grid = (level.target_points, level.cells, level.margin)
        self._onto = kept.once(target, grid, lambda: Onto.of(theirs, level))
        self._scales = np.array(level.scales) * theirs.size
        self._steps = level.steps

    def from_each_scale(self, pose: Array) -> Array:
        """Return where one start (4, 4) ends from each of the scales down, all of them first."""
        return np.concatenate([self(pose[None], first) for first in range(len(self._scales))])

    def __call__(self, poses: Array, first: int = 0) -> Array:
        """Return where the starts (K, 4, 4) end, from the scale number ``first`` down."""
        from hmrf_icp.kernels.candidates import anneal

        ends = np.array(poses, dtype=np.float64)
        onto = self._onto
        anneal(
            self._points,
            self._normals,
            onto.points,
            onto.normals,
            self._signed,
            onto.table,
            onto.corner,
            onto.edge,
            self._scales[first:],
            self._steps,
            0.02,
            ends,
        )
        return ends


def turned(start: Array, centre: Array, most: float, apart: float) -> Array:
    """Return ``start`` turned every way about ``centre``, itself first: (K, 4, 4).

    Parameters
    ----------
    start
        (4, 4).
    centre
        (3,) point of the source, in the target's frame, that stays where it is.
    most
        Largest turn, radians.
    apart
        Edge of the cubes of the body-centred lattice of rotation vectors, radians.
    """
    steps = int(np.ceil(most / apart))
    line = np.arange(-steps, steps + 1) * apart
    corners = np.stack(np.meshgrid(line, line, line), axis=-1).reshape(-1, 3)
    vectors = np.concatenate([corners, corners + 0.5 * apart])
    length = np.linalg.norm(vectors, axis=1)
    vectors = vectors[length <= most + 1e-9]
    vectors = vectors[np.argsort(np.linalg.norm(vectors, axis=1), kind="stable")]
    motions = []
    for vector in vectors:
        rotation = se3.rotation_exp(vector)
        motions.append(se3.rigid(rotation, centre - rotation @ centre) @ start)
    return np.array(motions)


def shifted(poses: Array, by: float) -> Array:
    """Return poses (K, 4, 4) shifted by ``by`` metres each way along each axis: (6 K, 4, 4)."""
    six = np.repeat(poses[None], 6, axis=0)
    six[:, :, :3, 3] += by * np.concatenate([np.eye(3), -np.eye(3)])[:, None]
    return six.reshape(-1, 4, 4)


def distinct(
    poses: Array, worth: Array, others: Sequence[Array], angle: float, shift: float
) -> Iterator[int]:
    """Go through poses (K, 4, 4), the worthiest first, and leave out those that were there.

    A pose was there if another, or one of ``others``, is within ``angle`` (rad) and ``shift`` (m).
    """
    there = list(others)
    for i in np.argsort(-worth, kind="stable"):
        pose = poses[i]
        if not any(near(pose, other, angle, shift) for other in there):
            there.append(pose)
            yield int(i)


def near(one: Array, other: Array, angle: float, shift: float) -> bool:
    """Tell whether two poses (4, 4) are within ``angle`` (rad) and ``shift`` (m)."""
    if float(np.linalg.norm(one[:3, 3] - other[:3, 3])) >= shift:
        return False
    return se3.rotation_angle(se3.inverse(other) @ one) < angle
