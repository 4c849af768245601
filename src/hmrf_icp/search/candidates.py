"""Candidates: many starts, each registered quickly on a few points of both clouds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3, threads
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.clouds.surface import evenly
from hmrf_icp.stages import stage

Array = NDArray[np.float64]


STARTS_A_THREAD = 4
"""Starts that are worth a thread's while."""


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


class Annealer:
    """Register one pair of clouds on one level, from any number of starts."""

    def __init__(self, source: PreparedCloud, target: PreparedCloud, level: Level) -> None:
        mine, theirs = source.surface, target.surface
        rows = evenly(mine, level.source_points)
        self._points, self._normals = mine.points[rows], mine.normals[rows]
        self._signed = mine.oriented and theirs.oriented
        self._onto = target.closest_table(level.target_points, level.cells, level.margin)
        self._scales = np.array(level.scales) * theirs.size
        self._steps = level.steps

    def from_each_scale(self, pose: Array) -> Array:
        """Return where one start (4, 4) ends from each of the scales down, all of them first."""
        return np.concatenate([self(pose[None], first) for first in range(len(self._scales))])

    @stage("candidates")
    def __call__(self, poses: Array, first: int = 0) -> Array:
        """Return where the starts (K, 4, 4) end, from the scale number ``first`` down."""
        from hmrf_icp.kernels.candidates import anneal

        ends = np.array(poses, dtype=np.float64)
        onto = self._onto

        def settle(some: Array) -> None:
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
                some,
            )

        threads.current().over(settle, ends, STARTS_A_THREAD)
        # Where a step led nowhere (matches that determine nothing), the start is what there is.
        lost = ~np.isfinite(ends).all(axis=(1, 2))
        ends[lost] = poses[lost]
        return ends


def turned(start: Array, centre: Array, most: float, turn_step: float) -> Array:
    """Return ``start`` turned every way about ``centre``, itself first: (K, 4, 4).

    Parameters
    ----------
    start
        (4, 4).
    centre
        (3,) point of the source, in the target's frame, that stays where it is.
    most
        Largest turn, radians.
    turn_step
        Edge of the cubes of the body-centred lattice of rotation vectors, radians.
    """
    steps = int(np.ceil(most / turn_step))
    line = np.arange(-steps, steps + 1) * turn_step
    corners = np.stack(np.meshgrid(line, line, line), axis=-1).reshape(-1, 3)
    vectors = np.concatenate([corners, corners + 0.5 * turn_step])
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
    poses: Array, score: Array, others: Sequence[Array], angle: float, shift: float
) -> Iterator[int]:
    """Go through poses (K, 4, 4), the highest score first, and leave out those that were there.

    A pose was there if another, or one of ``others``, is within ``angle`` (rad) and ``shift`` (m).
    """
    there = list(others)
    for i in np.argsort(-score, kind="stable"):
        pose = poses[i]
        if not any(near(pose, other, angle, shift) for other in there):
            there.append(pose)
            yield int(i)


def near(one: Array, other: Array, angle: float, shift: float) -> bool:
    """Tell whether two poses (4, 4) are within ``angle`` (rad) and ``shift`` (m)."""
    if float(np.linalg.norm(one[:3, 3] - other[:3, 3])) >= shift:
        return False
    return se3.rotation_angle(se3.inverse(other) @ one) < angle
