"""Without a viewpoint: what lies on a surface, a little off it, beside it, beyond its border."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import PointCloud, PreparedCloud, Visibility
from hmrf_icp.kernels.range_image import AGREE, FRONT, OTHER, OUTSIDE
from hmrf_icp.search.confidence import log_odds
from hmrf_icp.search.visibility import NearSurface, VisibilityTest

STEP = 0.05


def sheet() -> NDArray[np.float64]:
    """A flat sheet of 2 x 2 m at z = 0, a point every five centimetres, shaken a little."""
    line = np.arange(-1.0, 1.0 + 1e-9, STEP)
    x, y = np.meshgrid(line, line)
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    return points + np.random.default_rng(0).normal(scale=[0.004, 0.004, 0.001], size=points.shape)


def test_the_border_of_a_sheet_is_its_rim() -> None:
    cloud = PointCloud(sheet())
    border = PreparedCloud(cloud).border
    rim = np.abs(cloud.observed_points[:, :2]).max(axis=1)
    assert border[rim > 0.97].mean() > 0.95
    assert border[rim < 0.8].mean() < 0.02


def test_what_is_a_little_off_a_surface_contradicts_it_unless_the_surface_ends_there() -> None:
    near = NearSurface(PreparedCloud(PointCloud(sheet())))
    up, across = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    points = np.array([[0, 0, 0.0], [0, 0, 0.0], [0, 0, 0.12], [1.1, 0, 0.0], [0, 0, 1.0]])
    normals = np.array([up, across, up, up, up])
    seen = near.ask(points, normals, np.eye(4))
    np.testing.assert_array_equal(seen, [AGREE, OTHER, FRONT, OUTSIDE, OUTSIDE])


def test_what_is_far_from_any_surface_is_no_evidence_however_far_around_it_was_looked_for() -> None:
    near = NearSurface(PreparedCloud(PointCloud(sheet())))
    middle, up = np.array([840, 840]), np.tile([0.0, 0.0, 1.0], (2, 1))
    seen = near.tell(np.array([0.12, 1.0]), middle, up)
    np.testing.assert_array_equal(seen, [FRONT, OUTSIDE])


def test_a_sheet_through_the_other_is_less_likely_than_one_beside_it() -> None:
    """More points agree in the wrong pose: the share that agrees tells nothing."""
    one, other = (PreparedCloud(PointCloud(sheet())) for _ in range(2))
    judge = VisibilityTest(one, other, 1000)
    beside, through = np.eye(4), np.eye(4)
    beside[0, 3] = 1.5
    angle = 0.15
    through[:3, :3] = [
        [np.cos(angle), 0.0, np.sin(angle)],
        [0.0, 1.0, 0.0],
        [-np.sin(angle), 0.0, np.cos(angle)],
    ]
    assert not judge.views
    assert judge(beside).agree < judge(through).agree
    assert log_odds(judge(beside)) > log_odds(judge(through)) + 2.0


def test_more_surface_off_the_other_is_less_likely() -> None:
    odds = [
        log_odds(Visibility(300, off, 0, 700 - off, 0, views=False)) for off in (0, 10, 100, 400)
    ]
    assert odds == sorted(odds, reverse=True)


def test_what_faces_the_opposite_way_is_no_part_of_a_surface_of_which_sides_are_known() -> None:
    near = NearSurface(PreparedCloud(PointCloud(sheet(), viewpoint=[0, 0, 5.0])), sides=True)
    up = np.array([0.0, 0.0, 1.0])
    points = np.array([[0, 0, 0.0], [0, 0, 0.0], [0, 0, 0.12], [0, 0, -0.12]])
    seen = near.ask(points, np.array([up, -up, up, -up]), np.eye(4))
    # A little off and facing the other way it may be the other side of a board.
    np.testing.assert_array_equal(seen, [AGREE, OTHER, FRONT, OUTSIDE])
