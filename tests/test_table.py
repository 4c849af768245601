"""A table of space hands out points that are as good as the closest, to a fraction of a cell."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from hmrf_icp.kernels import table


def laid(points: np.ndarray, cells: int, margin: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Lay a table round points; return it with the corner and the edge of its cells."""
    low, high = points.min(axis=0), points.max(axis=0)
    edge = float((high - low).max()) / cells
    corner = low - margin * edge
    shape = tuple(int(n) for n in np.ceil((high - low) / edge + 2 * margin))
    return table.build(points, corner, edge, shape), corner, edge


@given(seed=st.integers(0, 10_000), count=st.integers(2, 300), cells=st.integers(4, 24))
@settings(max_examples=40, deadline=None)
def test_every_cell_of_a_table_knows_a_point_about_as_close_as_the_closest(
    seed: int, count: int, cells: int
) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3)) * rng.uniform(0.5, 2.0, 3)
    cell, corner, edge = laid(points, cells, 3)
    centres = corner + (np.stack(np.indices(cell.shape), axis=-1) + 0.5) * edge
    closest = cKDTree(points).query(centres)[0]
    handed = np.linalg.norm(points[cell] - centres, axis=-1)
    # A point is anywhere in the closest cell that has one: two half diagonals at the most.
    assert (handed - closest).max() <= np.sqrt(3.0) * edge
    assert np.median(handed - closest) <= 0.5 * edge


@pytest.mark.parametrize(("places", "closest"), [((0.05, 2.05), 1), ((0.95, 2.95), 0)])
def test_of_two_cells_as_near_the_one_whose_point_is_nearer_is_taken(
    places: tuple[float, float], closest: int
) -> None:
    """Three cells in a row, and a point at the same side of the first and of the last."""
    points = np.array([[place, 0.5, 0.5] for place in places])
    cell = table.build(points, np.zeros(3), 1.0, (3, 1, 1))
    assert cell[1, 0, 0] == closest


def test_a_question_outside_the_table_has_no_answer() -> None:
    points = np.random.default_rng(0).normal(size=(50, 3))
    cell, corner, edge = laid(points, 8, 2)
    outside = corner - 0.1 * edge
    assert table.look_up(points, cell, corner, edge, *outside) == -1


def test_a_question_at_a_point_is_answered_with_a_point_of_the_same_cell_or_closer() -> None:
    points = np.random.default_rng(1).normal(size=(400, 3))
    cell, corner, edge = laid(points, 12, 2)
    found = [table.look_up(points, cell, corner, edge, *point) for point in points]
    assert np.linalg.norm(points[found] - points, axis=1).max() <= np.sqrt(3.0) * edge
