"""The mean field: one answer on grid and graph, at one fixed point whichever way it gets there."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmrf_icp.errors import InputError
from hmrf_icp.field.graph import NeighbourGraph, PixelGrid, grid_graph, nearest_graph
from hmrf_icp.field.mean_field import mean_field

SEED = st.integers(0, 1000)
SIZE = st.integers(1, 14)
UPDATE = st.sampled_from(["simultaneous", "sequential"])


def field(seed, height, width):
    rng = np.random.default_rng(seed)
    observed = rng.random((height, width)) < 0.85
    count = np.count_nonzero(observed)
    return observed, rng.normal(0, 3, count), rng.uniform(-1, 1, count)


def free_energy(log_odds, z, neighbours, beta):
    """Mean-field free energy: what every coordinate update lowers or leaves."""
    p = np.stack([0.5 * (1 + z), 0.5 * (1 - z)])
    entropy = -np.sum(p * np.log(np.maximum(p, 1e-300)))
    return -0.5 * beta * z @ neighbours.sums(z) - 0.5 * log_odds @ z - entropy


@given(SEED, SIZE, SIZE, UPDATE, st.floats(0, 2))
@settings(max_examples=60, deadline=None)
def test_the_grid_and_the_graph_with_its_edges_agree(seed, height, width, update, beta):
    observed, log_odds, z = field(seed, height, width)
    on_grid = mean_field(log_odds, z, PixelGrid(observed), beta, 4, update=update)
    on_graph = mean_field(log_odds, z, grid_graph(observed), beta, 4, update=update)
    np.testing.assert_allclose(on_grid, on_graph, atol=1e-9)


def test_two_points_by_hand():
    pair = NeighbourGraph(np.array([0, 1, 2]), np.array([1, 0]), np.array([0.5, 0.5]))
    log_odds, z = np.array([1.0, -3.0]), np.array([0.2, -0.4])
    first = np.tanh(2 * 0.5 * -0.4 + 0.5)
    np.testing.assert_allclose(
        mean_field(log_odds, z, pair, 2.0, 1), [first, np.tanh(2 * 0.5 * 0.2 - 1.5)], atol=1e-12
    )
    np.testing.assert_allclose(
        mean_field(log_odds, z, pair, 2.0, 1, update="sequential"),
        [first, np.tanh(2 * 0.5 * first - 1.5)],
        atol=1e-12,
    )


@given(SEED, UPDATE)
@settings(max_examples=20, deadline=None)
def test_without_a_field_each_point_answers_for_itself(seed, update):
    observed, log_odds, z = field(seed, 9, 9)
    found = mean_field(log_odds, z, PixelGrid(observed), 0.0, 1, update=update)
    np.testing.assert_allclose(found, np.tanh(0.5 * log_odds), atol=1e-12)


@given(SEED)
@settings(max_examples=20, deadline=None)
def test_both_updates_have_the_same_fixed_point(seed):
    # Below 4 beta = 1 the step is a contraction: there is one fixed point, and both go there.
    observed, log_odds, z = field(seed, 10, 12)
    points = np.random.default_rng(seed).normal(size=(log_odds.size, 3))
    for neighbours in (PixelGrid(observed), nearest_graph(points)):
        ends = [
            mean_field(log_odds, z, neighbours, 0.22, 300, update=update)
            for update in ("simultaneous", "sequential")
        ]
        np.testing.assert_allclose(ends[0], ends[1], atol=1e-9)


@given(SEED, st.floats(0, 3))
@settings(max_examples=30, deadline=None)
def test_sequential_updates_never_climb_in_free_energy(seed, beta):
    observed, log_odds, z = field(seed, 10, 12)
    points = np.random.default_rng(seed).normal(size=(log_odds.size, 3))
    for neighbours in (PixelGrid(observed), nearest_graph(points)):
        energy = free_energy(log_odds, z, neighbours, beta)
        for _ in range(6):
            z = mean_field(log_odds, z, neighbours, beta, 1, update="sequential")
            before, energy = energy, free_energy(log_odds, z, neighbours, beta)
            assert energy <= before + 1e-8 * abs(before)


def test_simultaneous_updates_can_oscillate_for_ever_where_sequential_ones_settle():
    checkerboard = np.where(np.indices((6, 6)).sum(axis=0) % 2, 0.9, -0.9).ravel()
    grid, nothing = PixelGrid(np.ones((6, 6), bool)), np.zeros(36)
    even = mean_field(nothing, checkerboard, grid, 1.0, 200)
    odd = mean_field(nothing, checkerboard, grid, 1.0, 201)
    assert (np.sign(even) == -np.sign(odd)).all()
    settled = mean_field(nothing, checkerboard, grid, 1.0, 200, update="sequential")
    again = mean_field(nothing, settled, grid, 1.0, 1, update="sequential")
    np.testing.assert_allclose(again, settled, atol=1e-9)


def test_a_beta_a_step_is_that_many_steps():
    observed, log_odds, z = field(0, 8, 8)
    grid = PixelGrid(observed)
    twice = mean_field(log_odds, mean_field(log_odds, z, grid, 0.3, 1), grid, 0.9, 1)
    np.testing.assert_array_equal(mean_field(log_odds, z, grid, np.array([0.3, 0.9])), twice)


@given(SEED, UPDATE)
@settings(max_examples=10, deadline=None)
def test_it_stops_when_it_has_settled(seed, update):
    observed, log_odds, z = field(seed, 8, 8)
    grid = PixelGrid(observed)
    early = mean_field(log_odds, z, grid, 0.2, 1000, update=update, tolerance=1e-12)
    np.testing.assert_allclose(
        early, mean_field(log_odds, z, grid, 0.2, 1000, update=update), atol=1e-10
    )


@pytest.mark.parametrize("update", ["simultaneous", "sequential"])
def test_certain_evidence_is_obeyed_and_nan_is_refused(update):
    grid = PixelGrid(np.ones((3, 3), bool))
    log_odds = np.zeros(9)
    log_odds[[0, 8]] = np.inf, -np.inf
    z = mean_field(log_odds, np.zeros(9), grid, 0.5, 20, update=update)
    assert (z[0], z[8]) == (1.0, -1.0)
    assert np.isfinite(z).all()
    log_odds[4] = np.nan
    with pytest.raises(InputError, match="NaN"):
        mean_field(log_odds, np.zeros(9), grid, 0.5, 1)
    with pytest.raises(InputError, match="shape"):
        mean_field(np.zeros(8), np.zeros(9), grid, 0.5, 1)
