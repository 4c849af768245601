"""The search's table of space: asked at a place, it gives about the closest point."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from hmrf_icp import PreparedCloud
from hmrf_icp.kernels.table import look_up
from views import frame

MARGIN, CELLS = 8, 40


@pytest.fixture(scope="module")
def table():
    return PreparedCloud(frame(0)).closest_table(2500, CELLS, MARGIN)


def asked(table, places):
    rows = [look_up(table.points, table.table, table.corner, table.edge, *p) for p in places]
    return np.array(rows)


def test_a_place_near_the_surface_gets_a_point_hardly_farther_than_the_closest(table):
    rng = np.random.default_rng(0)
    places = table.points[::5] + 0.5 * table.edge * rng.standard_normal((len(table.points[::5]), 3))
    rows = asked(table, places)
    got = np.linalg.norm(table.points[rows] - places, axis=1)
    excess = (got - cKDTree(table.points).query(places)[0]) / table.edge
    assert excess.mean() < 0.12
    assert np.quantile(excess, 0.99) < 0.8


def test_a_place_beyond_the_cloud_gets_a_point_as_far_as_the_margin(table):
    high = table.points.max(axis=0)
    for axis in range(3):
        beyond = table.points[table.points[:, axis].argmax()].copy()
        beyond[axis] = high[axis] + (MARGIN - 1) * table.edge
        assert asked(table, [beyond])[0] >= 0
        beyond[axis] = high[axis] + (MARGIN + 2) * table.edge
        assert asked(table, [beyond])[0] == -1
