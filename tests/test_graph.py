"""Neighbour graphs: the edges, weights and colours they should have."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from hmrf_icp.errors import InputError
from hmrf_icp.field.graph import (
    FULL_ROW,
    NeighbourGraph,
    PixelGrid,
    grid_graph,
    nearest_graph,
    ring_graph,
)

SEED = st.integers(0, 1000)


def matrix(graph):
    return sparse.csr_array((graph.weights, graph.indices, graph.indptr), (graph.size,) * 2)


def edges(graph):
    return {(i, j) for i, j in zip(*matrix(graph).nonzero(), strict=True) if i < j}


def test_a_grid_by_hand():
    # 0 1 .
    # 2 . 3
    graph = grid_graph(np.array([[1, 1, 0], [1, 0, 1]], bool))
    assert edges(graph) == {(0, 1), (0, 2)}
    np.testing.assert_array_equal(graph.sums(np.array([1.0, 10.0, 100.0, 1000.0])), [110, 1, 1, 0])


def test_a_ring_goes_round():
    graph = ring_graph(np.array([[1, 1, 1, 1], [1, 0, 0, 1]], bool))
    assert edges(graph) == {(0, 1), (1, 2), (2, 3), (0, 3), (0, 4), (3, 5), (4, 5)}
    # Two azimuths are neighbours once, not twice.
    assert edges(ring_graph(np.ones((1, 2), bool))) == {(0, 1)}


def test_nearest_points_by_hand():
    # On a line at 0, 1, 3, 7: each names the one before it, and the first the second.
    graph = nearest_graph(np.array([[0, 0, 0], [1, 0, 0], [3, 0, 0], [7, 0, 0.0]]), k=1)
    assert edges(graph) == {(0, 1), (1, 2), (2, 3)}


def test_on_a_lattice_the_four_nearest_are_the_grid_inside():
    x, y = np.meshgrid(np.arange(6.0), np.arange(5.0))
    points = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    inside = ((x > 0) & (x < 5) & (y > 0) & (y < 4)).ravel()
    grid, nearest = edges(grid_graph(np.ones((5, 6), bool))), edges(nearest_graph(points, k=4))
    assert {e for e in nearest if inside[list(e)].all()} == {
        e for e in grid if inside[list(e)].all()
    }


@given(SEED, st.integers(2, 200), st.integers(1, 9))
@settings(max_examples=30, deadline=None)
def test_weights_are_symmetric_and_rows_sum_to_no_more_than_the_grids(seed, number, k):
    points = np.random.default_rng(seed).normal(size=(number, 3))
    graph = nearest_graph(points, k)
    weights = matrix(graph)
    assert abs(weights - weights.T).max() < 1e-15
    assert (weights.diagonal() == 0).all()
    assert (np.diff(graph.indptr) >= min(k, number - 1)).all()
    rows = graph.sums(np.ones(number))
    assert (rows > 0).all()
    assert (rows <= FULL_ROW * (1 + 1e-12)).all()


def test_nearly_every_row_of_a_scan_is_full():
    points = np.random.default_rng(0).normal(size=(5000, 3)) * [30, 30, 1]
    rows = nearest_graph(points).sums(np.ones(5000))
    assert np.mean(rows > 0.99 * FULL_ROW) > 0.99


@given(SEED)
@settings(max_examples=10, deadline=None)
def test_units_and_order_of_the_points_do_not_matter(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(60, 3))
    order = rng.permutation(60)
    weights = matrix(nearest_graph(points)).toarray()
    np.testing.assert_allclose(matrix(nearest_graph(1000 * points)).toarray(), weights)
    shuffled = matrix(nearest_graph(points[order])).toarray()
    np.testing.assert_allclose(shuffled, weights[np.ix_(order, order)], atol=1e-12)


def test_points_that_coincide_are_neighbours_and_not_of_themselves():
    graph = nearest_graph(np.zeros((30, 3)), k=3)
    assert (matrix(graph).diagonal() == 0).all()
    assert np.isfinite(graph.weights).all()


def test_one_point_has_no_neighbours():
    graph = nearest_graph(np.zeros((1, 3)))
    np.testing.assert_array_equal(graph.sums(np.ones(1)), [0.0])


@given(SEED, st.integers(1, 12), st.integers(1, 12))
@settings(max_examples=30, deadline=None)
def test_neighbours_never_share_a_colour(seed, height, width):
    rng = np.random.default_rng(seed)
    observed = rng.random((height, width)) < 0.8
    points = rng.normal(size=(50, 3))
    for graph in (grid_graph(observed), ring_graph(observed), nearest_graph(points)):
        order, starts = graph._colours
        np.testing.assert_array_equal(np.sort(order), np.arange(graph.size))
        colour = np.empty(graph.size, int)
        for c in range(len(starts) - 1):
            colour[order[starts[c] : starts[c + 1]]] = c
        assert all(colour[i] != colour[j] for i, j in edges(graph))


@given(SEED, st.integers(1, 9), st.integers(1, 9))
@settings(max_examples=30, deadline=None)
def test_the_grid_and_its_graph_have_the_same_sums(seed, height, width):
    rng = np.random.default_rng(seed)
    observed = rng.random((height, width)) < 0.7
    grid = PixelGrid(observed)
    z = rng.uniform(-1, 1, grid.size)
    np.testing.assert_allclose(grid.sums(z), grid_graph(observed).sums(z), atol=1e-14)


def test_what_is_no_graph_is_refused():
    one = np.ones(1)
    for indptr, indices, weights in (
        ([0, 2], [0], one),
        ([1, 1], [0], one),
        ([0, 1], [1], one),
        ([0, 1], [-1], one),
        ([0, 1], [0], np.array([np.nan])),
        ([0, 1], [0], -one),
        ([0, 1], [0], np.ones(2)),
    ):
        with pytest.raises(InputError, match="graph"):
            NeighbourGraph(np.array(indptr), np.array(indices), weights)
    with pytest.raises(InputError, match="points"):
        nearest_graph(np.array([[0.0, 0.0, np.nan]]))
    with pytest.raises(InputError, match="k:"):
        nearest_graph(np.zeros((3, 3)), k=0)
