"""Clouds and cameras are values: equal, hashed, copied and pickled as what they hold."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest

from hmrf_icp import PinholeCamera, PointCloud, PreparedCloud, prepare

CAMERA = PinholeCamera(8, 6, 7.0, 7.0, 3.5, 2.5)


def clouds():
    rng = np.random.default_rng(3)
    depth = rng.uniform(1, 2, (6, 8))
    depth[2, 3:5] = np.nan
    points = rng.normal(size=(30, 3))
    return [
        PointCloud.from_depth(depth, CAMERA),
        PointCloud(points),
        PointCloud(points, viewpoint=(0.5, 0.0, 1.0)),
        PointCloud(points, normals=rng.normal(size=(30, 3)), attributes={"red": np.arange(30)}),
        PointCloud(np.r_[points, np.zeros((40, 3))]),
    ]


ROUTES = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda value: pickle.loads(pickle.dumps(value)),
    "replace": replace,
}


def arrays(cloud):
    beside = [cloud.viewpoint, cloud.normals, *cloud.attributes.values()]
    derived = [cloud.points, cloud.observed, cloud.observed_points]
    return [array for array in (*derived, *beside) if array is not None]


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize("which", range(5))
def test_a_copy_is_equal_and_as_frozen(which, route):
    cloud = clouds()[which]
    other = ROUTES[route](cloud)
    assert other == cloud
    assert hash(other) == hash(cloud)
    assert other.notes == cloud.notes
    for array in arrays(other):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 1


def test_clouds_that_differ_in_anything_are_not_equal():
    first = clouds()
    for i, cloud in enumerate(first):
        assert [other == cloud for other in clouds()] == [i == j for j in range(len(first))]
        assert cloud != "a cloud"
    assert len({*first, *clouds()}) == len(first)


def test_a_zero_equals_its_negative():
    points = np.random.default_rng(0).normal(size=(12, 3))
    points[0, 1] = 0.0
    negative = points.copy()
    negative[0, 1] = -0.0
    assert PointCloud(points) == PointCloud(negative)
    assert hash(PointCloud(points)) == hash(PointCloud(negative))


@pytest.mark.parametrize("route", ["copy", "deepcopy", "pickle"])
def test_prepared_clouds_are_values_too(route):
    far = prepare(clouds()[1].points + np.array([4e6, 5e5, 100.0]))
    surface = far.surface
    other = ROUTES[route](far)
    assert other == far
    assert hash(other) == hash(far)
    assert other != prepare(clouds()[1])
    assert other != far.cloud
    np.testing.assert_array_equal(other.surface.normals, surface.normals)
    with pytest.raises(ValueError, match="read-only"):
        other.origin[0] = 0.0
    assert PreparedCloud(far.cloud) != far


def test_a_camera_of_numpy_numbers_is_that_of_plain_ones():
    camera = PinholeCamera(np.int64(8), 6.0, np.float32(7.0), 7, np.float64(3.5), 2.5)
    assert camera == CAMERA
    assert hash(camera) == hash(CAMERA)
    assert [type(getattr(camera, name)) for name in ("width", "height", "fx")] == [int, int, float]


@pytest.mark.parametrize("size", [8.5, "8", None, float("nan")])
def test_half_a_pixel_is_none(size):
    with pytest.raises(ValueError, match="width"):
        PinholeCamera(size, 6, 7.0, 7.0, 3.5, 2.5)
