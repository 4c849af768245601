"""A search tree that answers any finite question with rows that exist."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import threads
from hmrf_icp.errors import InputError
from hmrf_icp.stages import stage

Array = NDArray[np.float64]

PIECE = 2048
"""Points that one thread looks for at a time."""


class Tree:
    """k-d tree of points (N, 3).

    Parameters
    ----------
    points
        (N, 3) finite, at least one; metres.

    Raises
    ------
    InputError
        There is no point, or the array has another shape.
    """

    @stage("search tree")
    def __init__(self, points: Array) -> None:
        from pykdtree.kdtree import KDTree

        points = np.ascontiguousarray(points, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
            raise InputError(
                f"points: expected shape (N, 3) with N of 1 or more, got {points.shape}"
            )
        if not np.isfinite(points).all():
            raise InputError("points: expected finite coordinates; leave out unobserved points")
        self._count = len(points)
        self._tree = KDTree(points)

    def __len__(self) -> int:
        return self._count

    @stage("closest points")
    def query(
        self, points: Array, k: int = 1, eps: float = 0.0, within: float | None = None
    ) -> tuple[Array, NDArray[np.intp]]:
        """Find the nearest points.

        Parameters
        ----------
        points
            (M, 3) finite, metres.
        k
            How many, the nearest first; N at most.
        eps
            Share of its distance by which an answer may be farther than the nearest.
        within
            Distance beyond which nobody asks who is nearest, metres: the search ends sooner.

        Returns
        -------
        distance, row
            (M,) each, or (M, k) where ``k`` is more than 1. Where none is ``within``, the
            distance is infinite, and the row that of the first point.

        Raises
        ------
        InputError
            A point is not finite, or there are fewer than ``k``.
        """
        points = np.ascontiguousarray(points, dtype=np.float64)
        if not 1 <= k <= self._count:
            raise InputError(f"k: expected 1 to {self._count} nearest points, got {k}")
        workers = threads.current()
        pieces = [points]
        if workers.count > 1 and len(points) >= 2 * PIECE:
            pieces = np.array_split(points, -(-len(points) // PIECE))

        def ask(piece: Array) -> tuple[Array, NDArray[np.uint32]]:
            with threads.one_openmp_thread():
                distance, row = self._tree.query(piece, k=k, eps=eps, distance_upper_bound=within)
            return distance, row

        answers = workers.map(ask, pieces)
        if len(answers) == 1:
            distance, row = answers[0]
        else:
            distance, row = (np.concatenate(parts) for parts in zip(*answers, strict=True))
        if within is not None:
            row[np.isinf(distance)] = 0
        # No row is a point's answer that is nowhere: the compiled loops would follow it.
        if row.size and int(row.max()) >= self._count:
            raise InputError("points: expected finite coordinates to look for")
        shape = (len(points),) if k == 1 else (len(points), k)
        return distance.reshape(shape), row.astype(np.intp).reshape(shape)
