"""What two sensors say of a pose: walls and their backs, what hides and what was looked through."""

from __future__ import annotations

import numpy as np
import pytest

from hmrf_icp import PointCloud, PreparedCloud, se3
from hmrf_icp.clouds.sensor_view import SensorView
from hmrf_icp.kernels.range_image import AGREE, BEHIND, FRONT, OTHER, OUTSIDE
from hmrf_icp.search.visibility import NearSurface, VisibilityTest
from shapes import CAMERA
from views import frame, truth

UP = np.array([0.0, 0.0, 1.0])


def wall(depth):
    """A wall that faces the camera."""
    seen = np.full((CAMERA.height, CAMERA.width), depth)
    return PointCloud.from_depth(seen, CAMERA, depth_scale=1.0)


def judge(source, target, pose):
    return VisibilityTest(PreparedCloud(source), PreparedCloud(target), 800)(pose)


def test_a_wall_does_not_agree_with_its_back():
    behind = se3.rigid(se3.rotation_exp([0.0, np.pi, 0.0]), [0.0, 0.0, 4.0])
    here, there = wall(2.0), wall(2.0)
    same, back = judge(here, there, np.eye(4)), judge(here, there, behind)
    assert same.agree > 0.99 * same.asked
    assert back.agree == 0
    assert back.other > 0.9 * back.asked


def test_both_sensors_are_asked():
    """The far wall is hidden by the near one, which stands where the far one was seen through."""
    near, far = wall(1.0), wall(3.0)
    one, other = judge(near, far, np.eye(4)), judge(far, near, np.eye(4))
    for seen in (one, other):
        assert seen.front > 0.3 * seen.asked
        assert seen.behind > 0.1 * seen.asked
    assert (one.front, one.behind) == (other.front, other.behind)


@pytest.mark.parametrize(
    ("point", "normal", "code"),
    [
        ((0.5, 0.0, 2.0), -UP, AGREE),
        ((0.5, 0.0, 2.0), UP, OTHER),
        ((0.5, 0.0, 2.0), (1.0, 0.0, 0.0), OTHER),
        ((0.5, 0.0, 1.0), -UP, FRONT),
        ((0.5, 0.0, 3.0), -UP, BEHIND),
        ((3.0, 0.0, 2.0), -UP, OUTSIDE),
        ((0.0, -3.0, 2.0), -UP, OUTSIDE),
        ((0.0, 0.0, 2.0), -UP, OUTSIDE),
        ((0.0, 0.0, 1.0), -UP, OUTSIDE),
        ((0.0, 0.0, 3.0), -UP, OUTSIDE),
        ((0.5, 0.0, -2.0), -UP, OUTSIDE),
    ],
)
def test_a_wall_with_a_hole_tells_what_it_knows(point, normal, code):
    depth = np.full((CAMERA.height, CAMERA.width), 2.0)
    depth[20:40, 30:50] = np.nan
    view = PreparedCloud(PointCloud.from_depth(depth, CAMERA, depth_scale=1.0)).range_image
    assert view.ask(np.array([point]), np.array([normal], dtype=float), np.eye(4)) == [code]


# Without viewpoints -------------------------------------------------------------------------------


def faces(*axes, seed=0, size=1.0):
    """Sheets through the origin across these axes, of a point every twentieth of a metre."""
    rng = np.random.default_rng(seed)
    line = np.arange(-1.0, 1.01, 0.05)
    a, b = (grid.ravel() for grid in np.meshgrid(line, line))
    sheets = []
    for axis in axes:
        sheet = np.insert(np.stack([a, b], axis=1), axis, 0.0, axis=1)
        sheets.append(sheet + rng.normal(scale=0.002, size=sheet.shape))
    return PointCloud(size * np.concatenate(sheets))


def test_normals_without_a_sign_agree_either_way():
    near = NearSurface(PreparedCloud(faces(2)))
    points = np.array([[0.2, 0.3, 0.0], [-0.4, 0.1, 0.0]])
    for normal in (UP, -UP):
        np.testing.assert_array_equal(near.ask(points, np.array([normal] * 2), np.eye(4)), AGREE)


def test_a_point_between_the_samples_of_a_surface_is_on_it():
    near = NearSurface(PreparedCloud(faces(2)))
    points = np.array([[0.225, 0.325, 0.001], [-0.375, 0.125, -0.001]])
    np.testing.assert_array_equal(near.ask(points, np.array([UP] * 2), np.eye(4)), AGREE)


def test_two_walls_in_any_frame_face_two_ways():
    turn = se3.rigid(se3.rotation_exp([0.4, 1.2, -0.7]), [0.3, 0.1, -0.2])
    target = faces(0, 1)
    source = PointCloud(se3.transform(se3.inverse(turn), faces(0, 1, seed=1).points))
    two = judge(source, target, turn)
    assert two.agree > 0.9 * two.asked
    assert two.facing < 0.02
    three = judge(faces(0, 1, 2, seed=1), faces(0, 1, 2), np.eye(4))
    assert three.facing > 0.2


def test_what_agrees_extends_by_as_much_in_any_unit():
    flat, deep = (
        [judge(faces(*axes, seed=1, size=size), faces(*axes, size=size), np.eye(4)).extent
         for size in (1.0, 1000.0)]
        for axes in ((2,), (0, 1, 2))
    )  # fmt: skip
    assert flat[0] < 0.02
    assert deep[0] > 0.4
    np.testing.assert_allclose([flat[1], deep[1]], [flat[0], deep[0]], rtol=1e-3)


def assumed(index, at_origin):
    """A view of the desk as a list of points, seen from a place that was guessed."""
    cloud = PointCloud(frame(index).observed_points, viewpoint=np.zeros(3))
    return PreparedCloud(cloud, view=SensorView("assumed", "", at_origin))


def test_origins_that_may_be_viewpoints_tell_a_pose_from_one_that_stands_in_free_space():
    true = truth(3, 0)
    nearer = true.copy()
    nearer[2, 3] -= 0.2
    test = VisibilityTest(assumed(3, True), assumed(0, True), 800)
    right, wrong = test(true), test(nearer)
    assert not right.views
    assert right.clear > wrong.clear + 1.0
    assert VisibilityTest(assumed(3, True), assumed(0, False), 800)(true).clear is None
