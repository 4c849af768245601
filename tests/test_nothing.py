"""Constants that recorders write where nothing was measured."""

from __future__ import annotations

import numpy as np
import pytest

import hmrf_icp
import synthetic
from hmrf_icp import PinholeCamera, PointCloud, RegistrationWarning

CAMERA = PinholeCamera(20, 16, 18.0, 18.0, 9.5, 7.5)


def holes(seed=0, share=0.2):
    return np.random.default_rng(seed).random((16, 20)) < share


def waves():
    u, v = np.meshgrid(np.arange(20.0), np.arange(16.0))
    return 1.5 + 0.1 * np.sin(u / 3) + 0.07 * np.cos(v / 2)


@pytest.mark.parametrize("constant", [(0, 0, 0), (-1, -1, -1), (0, 0, 65.535), (1e5, 1e5, 1e5)])
@pytest.mark.parametrize("organised", [True, False])
def test_a_constant_that_many_points_share_is_unobserved(constant, organised):
    points = CAMERA.unproject(waves())
    points[holes()] = constant
    cloud = PointCloud(points if organised else points.reshape(-1, 3))
    np.testing.assert_array_equal(cloud.observed.ravel(), ~holes().ravel())
    assert len(cloud.notes) == 1
    assert f"{np.count_nonzero(holes())} of 320" in cloud.notes[0]


def test_registration_with_the_constant_is_that_with_holes_and_says_so():
    source, target = synthetic.pair()
    expected = hmrf_icp.register(source, target)
    with pytest.warns(RegistrationWarning, match="source: .* taken for nothing measured"):
        found = hmrf_icp.register(np.nan_to_num(source), np.nan_to_num(target))
    np.testing.assert_array_equal(found.transformation, expected.transformation)
    np.testing.assert_array_equal(found.distance, expected.distance)


def test_points_that_are_all_held_many_times_are_points():
    points = np.repeat(np.random.default_rng(0).normal(size=(20, 3)), 30, axis=0)
    assert len(PointCloud(points)) == 600
    assert PointCloud(points).notes == ()


def test_a_place_that_a_few_points_share_is_a_place():
    points = np.random.default_rng(0).normal(size=(2000, 3))
    points[:9] = 0.0
    assert len(PointCloud(points)) == 2000


def test_a_depth_far_beyond_all_others_is_the_sensors_maximum():
    depth = waves()
    depth[holes()] = 10.0
    cloud = PointCloud.from_depth(depth, CAMERA)
    np.testing.assert_array_equal(cloud.observed, ~holes())
    assert "a depth of exactly 10 m" in cloud.notes[0]


def test_a_depth_that_may_be_a_wall_is_kept_and_said():
    depth = waves()
    depth[holes()] = 3.0
    cloud = PointCloud.from_depth(depth, CAMERA)
    assert len(cloud) == 320
    assert "max_depth" in cloud.notes[0]
    assert len(PointCloud.from_depth(depth, CAMERA, max_depth=2.9)) == 320 - holes().sum()


def test_a_wall_or_rounded_depths_are_nothing_to_speak_of():
    for depth in (np.full((16, 20), 2.0), np.round(waves(), 1), (1000 * waves()).astype(np.uint16)):
        assert PointCloud.from_depth(depth, CAMERA).notes == ()


def test_returns_from_a_scanners_maximum_are_none():
    rng = np.random.default_rng(1)
    rays = rng.normal(size=(1000, 3))
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    reach = rng.uniform(3, 80, 1000)
    beyond = rng.random(1000) < 0.1
    reach[beyond] = 120.0
    points = (rays * reach[:, None]).astype(np.float32)
    cloud = PointCloud(points, viewpoint=(0.0, 0.0, 0.0))
    np.testing.assert_array_equal(cloud.observed, ~beyond)
    assert "a range of exactly 120" in cloud.notes[0]
    whole = rays * 2.0  # seen from the middle of a sphere
    assert len(PointCloud(whole, viewpoint=(0.0, 0.0, 0.0))) == 1000


def test_what_is_masked_is_unobserved():
    points = np.random.default_rng(0).normal(size=(30, 3))
    mask = np.zeros((30, 3), bool)
    mask[:7, 1] = True
    cloud = PointCloud(np.ma.masked_array(points, mask, fill_value=1e20))
    np.testing.assert_array_equal(cloud.observed, np.arange(30) >= 7)
    for depth in (waves(), (1000 * waves()).astype(np.uint16)):
        made = PointCloud.from_depth(np.ma.masked_array(depth, holes()), CAMERA)
        np.testing.assert_array_equal(made.observed, ~holes())
