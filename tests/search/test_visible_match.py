"""What is known of a label beside its distance: the target's view, or its surface."""

from __future__ import annotations

import numpy as np
import pytest

from hmrf_icp import PointCloud, PreparedCloud, presets, se3
from hmrf_icp.loop.placed import Placed
from shapes import CAMERA
from views import off, truth

MATCH = presets.ROBUST.method.match


def wall(depth, hole=False):
    seen = np.full((CAMERA.height, CAMERA.width), depth)
    if hole:
        seen[20:40, 30:50] = np.nan
    return PointCloud.from_depth(seen, CAMERA, depth_scale=1.0)


def told(source, target, pose):
    """Log-odds of the source's labels."""
    clouds = PreparedCloud(source), PreparedCloud(target)
    placed = Placed.at(pose, clouds[0].points)
    return MATCH.prepare(*clouds)(placed).label_log_odds


def shifted(x=0.0, y=0.0, z=0.0):
    return se3.rigid(np.eye(3), [x, y, z])


def test_a_label_hears_where_its_point_is_to_what_the_target_saw():
    target = wall(2.0)
    on = told(wall(2.0), target, np.eye(4))
    assert (on == 0.0).all()
    before = told(wall(2.0), target, shifted(z=-0.5))
    behind = told(wall(2.0), target, shifted(z=0.5))
    beside = told(wall(2.0), target, shifted(x=3.0))
    back = told(wall(2.0), target, se3.rigid(se3.rotation_exp([0.0, np.pi, 0.0]), [0, 0, 4.0]))
    for against in (before, behind, beside, back):
        assert np.median(against) < -3.0
    # Space that was looked through says more than places that were not seen.
    assert np.median(before) < np.median(behind) == np.median(beside)


def test_a_label_forgives_more_than_a_pose():
    noise = 0.003
    rng = np.random.default_rng(0)
    one, two = (
        PointCloud.from_depth(
            2.0 + away + noise * rng.standard_normal((CAMERA.height, CAMERA.width)), CAMERA, 1.0
        )
        for away in (-6.0 * noise, 0.0)
    )
    assert (told(one, two, np.eye(4)) < 0.0).mean() < 0.2
    assert (told(one, two, shifted(z=-10.0 * noise)) < 0.0).mean() > 0.9


@pytest.fixture(scope="module")
def sheet():
    """A sheet of 2 x 2 m with a point every five centimetres; nobody knows where it was seen."""
    line = np.arange(-1.0, 1.01, 0.05)
    x, y = (grid.ravel() for grid in np.meshgrid(line, line))
    shaken = np.random.default_rng(0).normal(scale=[0.004, 0.004, 0.001], size=(x.size, 3))
    return PointCloud(np.column_stack([x, y, np.zeros(x.size)]) + shaken)


def test_without_viewpoints_a_label_asks_whether_its_point_is_on_the_surface(sheet):
    assert (told(sheet, sheet, np.eye(4)) == 0.0).all()
    assert (told(sheet, sheet, shifted(z=0.2)) < -3.0).mean() > 0.8
    assert (told(sheet, sheet, shifted(z=1.0)) < -3.0).all()


def test_a_surface_that_was_turned_faces_the_way_it_was_turned_to(sheet):
    turn = se3.rigid(se3.rotation_exp([0.5 * np.pi, 0.0, 0.0]), np.zeros(3))
    upright = PointCloud(se3.transform(se3.inverse(turn), sheet.points))
    assert (told(upright, sheet, turn) == 0.0).all()
    # Laid through the sheet it is on it along a line, and faces another way there.
    across = told(sheet, sheet, turn)
    assert (across < -3.0).mean() > 0.95


def test_views_share_a_tenth_and_labels_take_the_pose_to_the_truth():
    from views import frame

    source, target, true = frame(26), frame(8), truth(26, 8)
    start = shifted(0.02, -0.02, 0.02) @ true
    clouds = PreparedCloud(source), PreparedCloud(target)
    found = presets.ROBUST.method.run(*clouds, start).transformation
    assert off(found, true, source) < 0.01
