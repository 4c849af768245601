"""Clouds: what is observed, how a depth map becomes points, what is accepted as a cloud."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

from hmrf_icp import PinholeCamera, PointCloud
from hmrf_icp.clouds.cloud import as_cloud

CAMERA = PinholeCamera(width=6, height=4, fx=5.0, fy=4.0, cx=2.0, cy=1.0)


def test_a_depth_map_is_unprojected_by_hand():
    depth = np.zeros((4, 6), np.uint16)
    depth[3, 4] = 2500
    cloud = PointCloud.from_depth(depth, CAMERA)
    # z = 2.5 m, x = (4 - 2) / 5 z, y = (3 - 1) / 4 z.
    np.testing.assert_allclose(cloud.points[3, 4], [1.0, 1.25, 2.5])
    assert len(cloud) == 1
    assert np.isnan(cloud.points[0, 0]).all()


@pytest.mark.parametrize(
    ("depth", "scale", "metres"),
    [
        (np.full((4, 6), 1500, np.uint16), None, 1.5),
        (np.full((4, 6), 1500, np.int32), None, 1.5),
        (np.full((4, 6), 1.5, np.float32), None, 1.5),
        (np.full((4, 6), 7500, np.uint16), 5000.0, 1.5),
        (np.full((4, 6), 1500.0), 1000.0, 1.5),
    ],
)
def test_depth_scale_is_units_per_metre(depth, scale, metres):
    cloud = PointCloud.from_depth(depth, CAMERA, depth_scale=scale)
    np.testing.assert_allclose(cloud.points[..., 2], metres)


def test_what_a_sensor_writes_for_nothing_is_unobserved():
    depth = np.full((4, 6), 1000, np.uint16)
    depth[0] = 0
    depth[1] = 65535
    assert len(PointCloud.from_depth(depth, CAMERA)) == 12
    metres = np.full((4, 6), 1.0)
    metres[0, :4] = [0.0, -1.0, np.nan, np.inf]
    assert len(PointCloud.from_depth(metres, CAMERA)) == 20
    metres[1] = 3.0
    assert len(PointCloud.from_depth(metres, CAMERA, max_depth=2.0)) == 14


def test_projection_undoes_unprojection():
    depth = np.random.default_rng(0).uniform(0.5, 3, (4, 6))
    cloud = PointCloud.from_depth(depth, CAMERA)
    u, v, z = CAMERA.project(cloud.points)
    np.testing.assert_allclose(u, np.tile(np.arange(6.0), (4, 1)), atol=1e-12)
    np.testing.assert_allclose(v, np.tile(np.arange(4.0)[:, None], (1, 6)), atol=1e-12)
    np.testing.assert_allclose(z, depth)
    behind = CAMERA.project(np.array([[0.0, 0.0, -1.0], [0.1, 0.2, 0.0]]))
    assert np.isnan(behind[:2]).all()


def test_subsampling_keeps_points_and_camera_together():
    depth = np.random.default_rng(0).uniform(0.5, 3, (4, 6))
    whole = PointCloud.from_depth(depth, CAMERA)
    half = whole.subsample(2)
    assert half.shape == (2, 3)
    np.testing.assert_array_equal(half.points, whole.points[::2, ::2])
    np.testing.assert_allclose(half.camera.unproject(depth[::2, ::2]), half.points)
    odd = whole.subsample(4)
    assert (odd.camera.height, odd.camera.width) == odd.shape == (1, 2)


def test_a_camera_survives_its_matrix():
    assert PinholeCamera.from_matrix(CAMERA.matrix, 6, 4) == CAMERA


def test_a_cloud_is_a_frozen_copy():
    points = np.zeros((4, 6, 3))
    cloud = PointCloud(points)
    points[:] = 7.0
    assert (cloud.points == 0).all()
    with pytest.raises(ValueError, match="read-only"):
        cloud.points[0, 0] = 1.0


def test_one_coordinate_that_is_not_finite_makes_a_point_unobserved():
    points = np.ones((4, 3))
    points[1, 2] = np.inf
    points[2, 0] = np.nan
    cloud = PointCloud(points)
    np.testing.assert_array_equal(cloud.observed, [True, False, False, True])
    assert np.isnan(cloud.points[1]).all()
    assert cloud.observed_points.shape == (2, 3)


def test_a_beam_that_did_not_return_is_unobserved_where_the_sensor_is_known():
    points = np.random.default_rng(0).normal(size=(20, 3)) + 5.0
    points[[2, 7]] = 0.0
    assert len(PointCloud(points)) == 20
    assert not PointCloud(points, viewpoint=np.zeros(3)).observed[[2, 7]].any()
    assert len(PointCloud(points + 1.0, viewpoint=np.ones(3))) == 18
    assert len(PointCloud(points, viewpoint=np.ones(3))) == 20


def test_values_are_laid_out_where_the_points_are():
    points = np.ones((2, 3, 3))
    points[0, 1] = np.nan
    laid = PointCloud(points).on_grid(np.arange(5.0))
    np.testing.assert_array_equal(laid, [[0.0, np.nan, 1.0], [2.0, 3.0, 4.0]])


def test_the_camera_stands_at_the_origin():
    cloud = PointCloud.from_depth(np.ones((4, 6)), CAMERA)
    np.testing.assert_array_equal(cloud.viewpoint, np.zeros(3))
    assert PointCloud(np.ones((4, 3))).viewpoint is None


def test_whatever_has_points_is_taken_for_a_cloud():
    points = np.random.default_rng(0).normal(size=(20, 3))

    class Foreign:
        def __init__(self):
            self.points = points.tolist()  # as of Open3D: a sequence, not an array

    for thing in (points, points.tolist(), points.astype(np.float32), Foreign()):
        np.testing.assert_allclose(as_cloud(thing).points, points, atol=1e-6)
    cloud = PointCloud(points)
    assert as_cloud(cloud) is cloud


def test_an_open3d_cloud_is_one():
    open3d = pytest.importorskip("open3d", reason="Open3D is not installed")
    points = np.random.default_rng(0).normal(size=(20, 3))
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    np.testing.assert_array_equal(as_cloud(cloud).points, points)


@pytest.mark.parametrize("twin", [copy.deepcopy, lambda cloud: pickle.loads(pickle.dumps(cloud))])
def test_a_cloud_travels_between_processes(twin):
    cloud = PointCloud.from_depth(np.ones((4, 6)), CAMERA)
    other = twin(cloud)
    np.testing.assert_array_equal(other.points, cloud.points)
    assert other.camera == cloud.camera


def test_a_cloud_says_what_it_is():
    points = np.ones((4, 6, 3))
    points[0, 0] = np.nan
    assert repr(PointCloud(points)) == "PointCloud(organised, 4 x 6, 23 observed)"
