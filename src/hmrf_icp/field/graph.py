"""Who neighbours whom: the pixel grid of the paper, and a graph for points without one.

Both say the same three things of a field: the sum over the neighbours of every
point, and mean-field steps that are simultaneous or one colour after the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.tree import Tree
from hmrf_icp.errors import InputError
from hmrf_icp.lazy import cached_property

Array = NDArray[np.float64]
Update = Literal["simultaneous", "sequential"]

FULL_ROW = 4.0
"""What the weights of a point with all its neighbours sum to: four pixels, one each."""

BALANCING_ROUNDS = 20
"""Rounds of symmetric scaling; rows of a 70,000-point scan are then within 1 % of 4."""


class Neighbours(Protocol):
    """The neighbourhoods of M points."""

    @property
    def size(self) -> int:
        """M."""

    def sums(self, z: Array) -> Array:
        """sum_i' w_ii' z_i' of every point, (M,)."""

    def steps(
        self, log_odds: Array, z: Array, beta: Array, update: Update, least: float
    ) -> tuple[Array, int]:
        """Take a step of :func:`hmrf_icp.field.mean_field.mean_field` for every entry of beta.

        It stops early when the labels move by ``least`` or less in a step, all
        of them added up. Returns the labels (M,) and how many steps were taken.
        """


@dataclass(frozen=True, eq=False)
class PixelGrid:
    """The four neighbours of every observed pixel, each with weight 1 (the paper's grid).

    Parameters
    ----------
    observed
        (H, W), where there is a point. Points are counted in the order of the grid.
    """

    observed: NDArray[np.bool_]

    def __post_init__(self) -> None:
        """Refuse what is no image."""
        observed = np.array(self.observed, dtype=np.bool_)
        if observed.ndim != 2:
            raise InputError(f"observed: expected shape (H, W), got {observed.shape}")
        object.__setattr__(self, "observed", observed)

    @cached_property
    def _place(self) -> NDArray[np.intp]:
        """Where the pixels are in a flat grid with a margin of one pixel."""
        return np.flatnonzero(np.pad(self.observed, 1))

    @property
    def size(self) -> int:
        """How many pixels are observed."""
        return self._place.size

    def sums(self, z: Array) -> Array:
        """sum_i' z_i' over the four neighbours of every point, (M,)."""
        z = one_a_point("z", z, self.size)
        height, width = self.observed.shape
        field = np.zeros((height + 2, width + 2))
        inner = field[1:-1, 1:-1]
        inner[self.observed] = z
        around = field[:-2, 1:-1] + field[2:, 1:-1] + field[1:-1, :-2] + field[1:-1, 2:]
        return np.asarray(around[self.observed])

    def steps(
        self, log_odds: Array, z: Array, beta: Array, update: Update, least: float
    ) -> tuple[Array, int]:
        """Mean-field steps; sequential means the two colours of a checkerboard in turn."""
        from hmrf_icp.kernels import mean_field as kernel

        log_odds, z, beta = of_steps(log_odds, z, beta, self.size)
        run = kernel.grid_sequential if update == "sequential" else kernel.grid_simultaneous
        new, taken = run(self._place, self.observed.shape, log_odds, z, beta, least)
        return new, int(taken)


@dataclass(frozen=True, eq=False)
class NeighbourGraph:
    """Neighbours by compressed sparse rows, as in ``scipy.sparse.csr_array``.

    Parameters
    ----------
    indptr
        (M + 1,) where each point's neighbours begin.
    indices
        (E,) the neighbours. Every edge stands in both rows.
    weights
        (E,) w_ii', 0 or more and the same in both rows: only then is there an
        energy, H(z) = -beta sum_{i~i'} w_ii' z_i z_i', for the field to go down.
    colour
        (M,) a number from 0 that no two neighbours share, which sequential
        updates go by; None leaves it to a greedy colouring.

    Raises
    ------
    InputError
        The arrays do not describe a graph.
    """

    indptr: NDArray[np.int64]
    indices: NDArray[np.int32]
    weights: Array
    colour: NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        """Check what would make a compiled loop read outside its arrays."""
        indptr = np.ascontiguousarray(self.indptr, dtype=np.int64)
        indices = np.ascontiguousarray(self.indices, dtype=np.int32)
        weights = np.ascontiguousarray(self.weights, dtype=np.float64)
        if indptr.ndim != 1 or indptr.size == 0 or indices.ndim != 1:
            raise InputError("graph: expected one-dimensional indptr (M + 1,) and indices (E,)")
        if indptr[0] != 0 or indptr[-1] != indices.size or (np.diff(indptr) < 0).any():
            raise InputError(
                f"graph: expected indptr to rise from 0 to {indices.size}, "
                f"got {indptr[0]} to {indptr[-1]}"
            )
        if indices.size and not (indices.min() >= 0 and indices.max() < indptr.size - 1):
            raise InputError(
                f"graph: expected neighbours from 0 to {indptr.size - 2}, "
                f"got {indices.min()} to {indices.max()}"
            )
        if weights.shape != indices.shape or not (np.isfinite(weights) & (weights >= 0)).all():
            raise InputError("graph: expected one finite weight of 0 or more for every neighbour")
        if self.colour is not None:
            colour = np.ascontiguousarray(self.colour, dtype=np.int64)
            if colour.shape != (indptr.size - 1,) or colour.min(initial=0) < 0:
                raise InputError("graph: expected one colour of 0 or more for every point")
            object.__setattr__(self, "colour", colour)
        for name, array in (("indptr", indptr), ("indices", indices), ("weights", weights)):
            object.__setattr__(self, name, array)

    @property
    def size(self) -> int:
        """How many points there are."""
        return self.indptr.size - 1

    @cached_property
    def _colours(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Points in the order of their colours, and where each colour begins."""
        from hmrf_icp.kernels import graph as kernel

        colour = self.colour
        if colour is None:
            colour = kernel.greedy_colours(self.indptr, self.indices)
        order = np.argsort(colour, kind="stable")
        starts = np.searchsorted(colour[order], np.arange(colour.max(initial=-1) + 2))
        return order, starts.astype(np.int64)

    def sums(self, z: Array) -> Array:
        """sum_i' w_ii' z_i' of every point, (M,)."""
        from hmrf_icp.kernels import mean_field as kernel

        z = one_a_point("z", z, self.size)
        return np.asarray(kernel.graph_sums(self.indptr, self.indices, self.weights, z))

    def steps(
        self, log_odds: Array, z: Array, beta: Array, update: Update, least: float
    ) -> tuple[Array, int]:
        """Mean-field steps; sequential means one colour after the other."""
        from hmrf_icp.kernels import mean_field as kernel

        log_odds, z, beta = of_steps(log_odds, z, beta, self.size)
        graph = (self.indptr, self.indices, self.weights)
        if update == "sequential":
            new, taken = kernel.graph_sequential(*graph, *self._colours, log_odds, z, beta, least)
        else:
            new, taken = kernel.graph_simultaneous(*graph, log_odds, z, beta, least)
        return new, int(taken)


def of_steps(log_odds: Array, z: Array, beta: Array, size: int) -> tuple[Array, Array, Array]:
    """Return log-odds (M,), labels (M,) and strengths (steps,) as the compiled loops take them.

    Raises
    ------
    InputError
        One of them has another shape.
    """
    strength = np.ascontiguousarray(beta, dtype=np.float64)
    if strength.ndim != 1:
        raise InputError(f"beta: expected one number a step, got shape {strength.shape}")
    return one_a_point("log_odds", log_odds, size), one_a_point("z", z, size), strength


def one_a_point(name: str, values: Array, size: int) -> Array:
    """Return values (M,) as the compiled loops take them.

    Raises
    ------
    InputError
        There are more or fewer.
    """
    array = np.ascontiguousarray(values, dtype=np.float64)
    if array.shape != (size,):
        raise InputError(f"{name}: expected shape ({size},), one a point, got {array.shape}")
    return array


def grid_graph(observed: NDArray[np.bool_]) -> NeighbourGraph:
    """Graph with the edges of :class:`PixelGrid`: up, down, left and right, weight 1."""
    return _lattice(np.asarray(observed, dtype=np.bool_), wrapped=False)


def ring_graph(observed: NDArray[np.bool_]) -> NeighbourGraph:
    """Graph of a spinning LiDAR: beams above one another, azimuths around a circle.

    Parameters
    ----------
    observed
        (beams, azimuths), where there was a return; the last azimuth neighbours the first.
    """
    return _lattice(np.asarray(observed, dtype=np.bool_), wrapped=True)


def _lattice(observed: NDArray[np.bool_], wrapped: bool) -> NeighbourGraph:
    if observed.ndim != 2:
        raise InputError(f"observed: expected shape (H, W), got {observed.shape}")
    number = np.full((observed.shape[0] + 2, observed.shape[1] + 2), -1, np.int32)
    inner = number[1:-1, 1:-1]
    inner[observed] = np.arange(np.count_nonzero(observed), dtype=np.int32)
    if wrapped and observed.shape[1] > 2:
        number[:, 0], number[:, -1] = number[:, -2], number[:, 1]
    around = np.stack(
        [number[:-2, 1:-1], number[1:-1, :-2], number[1:-1, 2:], number[2:, 1:-1]], axis=-1
    )[observed]
    there = around >= 0
    indptr = np.concatenate([[0], np.cumsum(there.sum(axis=1))])
    row, column = np.nonzero(observed)
    # A circle of an odd number of azimuths is no checkerboard.
    checkerboard = None if wrapped and observed.shape[1] % 2 else (row + column) % 2
    return NeighbourGraph(indptr, around[there], np.ones(np.count_nonzero(there)), checkerboard)


def nearest_graph(points: Array, k: int = 6) -> NeighbourGraph:
    """Graph of the nearest points, for clouds without a grid.

    Two points are neighbours if either is among the ``k`` nearest of the other.
    The weights are symmetric, since otherwise there is no energy, and every
    row sums to 4, as the grid's do, so that one beta means the same on both; both at
    once by symmetric scaling. Where a graph does not allow that (a point that
    many others name and no one else does), rows sum to less, like a
    grid's at its border.

    Parameters
    ----------
    points
        (M, 3), metres. Only who is nearest counts, so units do not.
    k
        Neighbours that each point names.

    Raises
    ------
    InputError
        There are no points, or ``k`` is less than 1.
    """
    from hmrf_icp.kernels import graph as kernel

    points = np.ascontiguousarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
        raise InputError(f"points: expected shape (M, 3) with M of 1 or more, got {points.shape}")
    if not np.isfinite(points).all():
        raise InputError("points: expected finite coordinates; leave out unobserved points")
    if k < 1:
        raise InputError(f"k: expected a number of neighbours of 1 or more, got {k}")
    _, index = Tree(points).query(points, k=min(k + 1, len(points)))
    nearest = _without_itself(index.reshape(len(points), -1))
    indptr, indices = kernel.mutual_or_either(nearest)
    weights = kernel.balanced_weights(indptr, indices, FULL_ROW, BALANCING_ROUNDS)
    return NeighbourGraph(indptr, indices, weights)


def _without_itself(index: NDArray[np.int64]) -> NDArray[np.int64]:
    """Drop each point from its own neighbours; among points that coincide it need not be first."""
    own = index == np.arange(len(index))[:, None]
    own[~own.any(axis=1), -1] = True
    others: NDArray[np.int64] = index[~own].reshape(len(index), -1)
    return others
