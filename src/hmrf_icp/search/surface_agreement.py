"""How well a pose lays one surface on the other, from a few points: cheap enough for hundreds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3, threads
from hmrf_icp.search.candidates import STARTS_A_THREAD
from hmrf_icp.search.features import Features

Array = NDArray[np.float64]

POINTS = 400
"""Points of each cloud that are held against the other."""

NEAR = 2.0
"""Edges within which a point lies on a surface."""

MARGIN = 4
"""Cells of the table beyond the cloud on every side."""

CELLS = 256
"""Cells of the table along the cloud's longest side, at most."""

SCALES, STEPS = (3.0, 2.0, 1.0), 3
"""Distances at which a match counts for less while a pose settles, in edges; steps at each."""


class Agreement:
    """The places of two clouds, ready to be held against each other at any pose."""

    def __init__(self, source: Features, target: Features, oriented: bool) -> None:
        self._edge = source.edge
        self._oriented = oriented
        self._source, self._target = threads.current().map(Onto, (source, target))

    def settled(self, poses: Array) -> Array:
        """Return poses (K, 4, 4) after a few steps of registration on few points."""
        from hmrf_icp.kernels.candidates import anneal

        ends = np.array(poses)

        def settle(some: Array) -> None:
            anneal(
                *self._source.few,
                *self._target.all,
                self._oriented,
                *self._target.table,
                self._edge * np.array(SCALES),
                STEPS,
                0.02,
                some,
            )

        threads.current().over(settle, ends, STARTS_A_THREAD)
        lost = ~np.isfinite(ends).all(axis=(1, 2))
        ends[lost] = poses[lost]
        return ends

    def shares(self, poses: Array) -> Array:
        """Shares (K, 4) of the points that agree, and that face the wrong way, each direction."""
        from hmrf_icp.kernels.poses import agreement

        back = np.array([se3.inverse(pose) for pose in poses]).reshape(-1, 4, 4)
        near = NEAR * self._edge
        return np.concatenate(
            [
                agreement(*one.few, *other.all, *other.table, near, True, motion)
                / max(len(one.few[0]), 1)
                for one, other, motion in (
                    (self._source, self._target, poses),
                    (self._target, self._source, back),
                )
            ],
            axis=1,
        )

    def score(self, poses: Array, explained: Array) -> Array:
        """Order poses (K, 4, 4) that explain so many matches (K,): larger is likelier."""
        shares = self.shares(poses)
        agree = shares[:, 0] + shares[:, 2]
        return np.asarray(np.log(explained + 1.0) + np.log(agree + 0.01))


class Onto:
    """Places of one cloud with a table of space that knows the closest of them."""

    def __init__(self, side: Features) -> None:
        from hmrf_icp.kernels import table

        step = max(1, len(side.points) // POINTS)
        self.all = side.points, side.normals
        self.few = side.points[::step].copy(), side.normals[::step].copy()
        low, high = side.points.min(axis=0), side.points.max(axis=0)
        # A point far off must not make the table larger than memory.
        edge = max(side.edge, float((high - low).max()) / CELLS)
        corner = low - (MARGIN + 0.5) * edge
        shape = np.floor((high - low) / edge + 2 * MARGIN + 1.5).astype(np.int64)
        cells = table.build(side.points, corner, edge, tuple(int(n) for n in shape))
        self.table = cells, corner, edge
