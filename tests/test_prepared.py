"""What is worked out of a cloud is worked out once, and gone with the cloud."""

import copy
import gc
import pickle
import weakref

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import PointCloud, PreparedCloud, RelativeCriteria, prepare
from views import CAMERA, frame


def cloud(count=500, seed=0):
    return PointCloud(np.random.default_rng(seed).normal(size=(count, 3)), viewpoint=(0, 0, -5))


def test_a_prepared_cloud_has_one_surface_one_tree_and_one_coarser_version():
    one = prepare(cloud())
    assert one.surface is one.surface
    assert one.tree is one.tree
    assert one.downsampled(100) is one.downsampled(100)
    assert one.downsampled(100) is not one.downsampled(200)
    assert one.downsampled(500) is one


def test_one_prepared_target_serves_many_sources():
    target = prepare(cloud())
    first = hmrf_icp.register(cloud(seed=1), target)
    tree = target.tree
    again = hmrf_icp.register(cloud(seed=1), target)
    np.testing.assert_array_equal(first.transformation, again.transformation)
    assert target.tree is tree


def test_nothing_of_a_cloud_outlives_it():
    source, target = prepare(cloud()), prepare(cloud(seed=1))
    hmrf_icp.register(source, target)
    gone = [weakref.ref(one) for one in (source, target, source.surface)]
    del source, target
    gc.collect()
    assert [reference() for reference in gone] == [None] * 3


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
def test_a_copy_of_a_prepared_cloud_is_as_good_as_the_first(copied):
    source, target = prepare(cloud()), prepare(cloud(seed=1))
    there = hmrf_icp.register(source, target).transformation
    again = hmrf_icp.register(copied(source), copied(target)).transformation
    np.testing.assert_array_equal(again, there)


def test_a_cloud_far_from_the_origin_is_prepared_about_its_own_centre():
    points = np.random.default_rng(0).normal(size=(500, 3))
    far_away = np.array([5e6, 4e6, 100.0])
    far = prepare(PointCloud(points + far_away, viewpoint=[5e6, 4e6, 90.0]))
    assert np.abs(far.points).max() < 10.0
    np.testing.assert_allclose(far.points + far.origin, points + far_away)
    np.testing.assert_allclose(far.cloud.viewpoint + far.origin, [5e6, 4e6, 90.0])
    assert not prepare(PointCloud(points)).origin.any()


def test_relative_criteria_grow_with_the_target():
    points = np.random.default_rng(0).normal(size=(500, 3))
    small, large = (
        RelativeCriteria(1e-3).on(PreparedCloud(PointCloud(k * points))) for k in (1.0, 10.0)
    )
    assert large.translation == pytest.approx(10.0 * small.translation)
    assert large.rotation == small.rotation == 1e-3
    same = hmrf_icp.Criteria(0.1, 0.2, 3)
    assert same.on(PreparedCloud(PointCloud(points))) is same


def test_a_recovered_camera_leaves_out_no_point_that_was_given():
    """A far constant is nothing measured in a depth map, and a place like others in a grid."""
    depth = frame(0).points[..., 2].copy()
    depth[:6, :40] = 100.0
    given = PointCloud(CAMERA.unproject(depth))
    viewed = prepare(given).viewed
    assert viewed.cloud.camera is not None
    assert len(viewed) == len(given)
    result = hmrf_icp.register(given, frame(4))
    assert result.distance.shape == given.shape
