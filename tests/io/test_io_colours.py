"""Colour, intensity and normals come along from every format to every other that has a place."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest

from hmrf_icp import PinholeCamera, PointCloud, se3
from hmrf_icp.clouds.moved import moved
from hmrf_icp.io import read_cloud, write_cloud

RNG = np.random.default_rng(8)
COLOURS = ("red", "green", "blue")
NEEDED = {".las": "laspy", ".laz": "lazrs", ".e57": "pye57"}
ALL = (".ply", ".pcd", ".csv", ".npz", ".las", ".laz", ".e57")
GRID = (".pcd", ".npz")


def cloud_of(*shape):
    points = RNG.normal(size=(*shape, 3))
    attributes = {name: RNG.integers(0, 256, shape, np.uint8) for name in COLOURS}
    attributes["intensity"] = RNG.random(shape, np.float32)
    normals = RNG.normal(size=(*shape, 3))
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return PointCloud(points, normals=normals, attributes=attributes)


def through(folder, cloud, suffix):
    library = NEEDED.get(suffix)
    if library is not None and importlib.util.find_spec(library) is None:
        pytest.skip(f"needs {library}")
    write_cloud(folder / f"c{suffix}", cloud)
    return read_cloud(folder / f"c{suffix}")


def in_three(cloud):
    """Colours (N, 3), also of PCD's one number for all."""
    if "rgb" in cloud.attributes:
        packed = np.ascontiguousarray(cloud.attributes["rgb"]).view(np.uint32)
        return np.stack([packed >> shift & 255 for shift in (16, 8, 0)], axis=-1)
    return np.stack([cloud.attributes[name] for name in COLOURS], axis=-1)


def assert_alike(read, cloud):
    np.testing.assert_allclose(read.points, cloud.points, rtol=0, atol=1e-6)
    np.testing.assert_allclose(read.normals, cloud.normals, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(in_three(read), in_three(cloud))
    assert in_three(read).max() > 200
    np.testing.assert_allclose(read.attributes["intensity"], cloud.attributes["intensity"])


@pytest.mark.parametrize("last", ALL)
@pytest.mark.parametrize("first", ALL)
def test_from_any_format_to_any_other(tmp_path, first, last):
    cloud = cloud_of(30)
    assert_alike(through(tmp_path, through(tmp_path, cloud, first), last), cloud)


@pytest.mark.parametrize("suffix", GRID)
def test_on_a_grid(tmp_path, suffix):
    cloud = cloud_of(5, 6)
    read = through(tmp_path, cloud, suffix)
    assert read.shape == (5, 6)
    assert_alike(read, cloud)


@pytest.mark.parametrize("suffix", ALL)
def test_a_cloud_that_has_moved_keeps_them_and_its_normals_turn(tmp_path, suffix):
    cloud, pose = cloud_of(30), se3.exp([0.3, -0.2, 0.5, 1.0, 2.0, 3.0])
    read = through(tmp_path, moved(cloud, pose), suffix)
    np.testing.assert_allclose(read.normals, cloud.normals @ pose[:3, :3].T, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(in_three(read), in_three(cloud))


def test_fewer_points_keep_theirs():
    cloud = cloud_of(6, 8)
    few = cloud.subsample(2)
    assert few.shape == (3, 4)
    np.testing.assert_array_equal(in_three(few), in_three(cloud)[::2, ::2])
    np.testing.assert_array_equal(
        few.attributes["intensity"], cloud.attributes["intensity"][::2, ::2]
    )


def test_points_that_are_unobserved_take_their_colour_with_them(tmp_path):
    cloud = cloud_of(30)
    points = cloud.points.copy()
    points[::3] = np.nan
    holes = PointCloud(points, normals=cloud.normals, attributes=cloud.attributes)
    for suffix in (".ply", ".las", ".e57", ".pts"):
        read = through(tmp_path, holes, suffix)
        np.testing.assert_array_equal(in_three(read), in_three(cloud)[holes.observed])


@pytest.mark.parametrize("tensor", [False, True])
def test_clouds_of_open3d(tmp_path, tensor):
    open3d = pytest.importorskip("open3d", reason="needs Open3D")
    cloud = cloud_of(30)
    theirs = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(cloud.points.copy()))
    theirs.normals = open3d.utility.Vector3dVector(cloud.normals.copy())
    theirs.colors = open3d.utility.Vector3dVector(in_three(cloud) / 255.0)
    if tensor:
        theirs = open3d.t.geometry.PointCloud.from_legacy(theirs)
        theirs.point.intensity = open3d.core.Tensor(cloud.attributes["intensity"][:, None].copy())
    taken = PointCloud(theirs)
    np.testing.assert_array_equal(in_three(taken), in_three(cloud))
    np.testing.assert_allclose(taken.normals, cloud.normals, atol=1e-6)
    if tensor:
        intensity = taken.attributes["intensity"]
        np.testing.assert_array_equal(intensity[:, 0], cloud.attributes["intensity"])
    write_cloud(tmp_path / "c.ply", taken)
    again = open3d.io.read_point_cloud(str(tmp_path / "c.ply"))
    np.testing.assert_allclose(np.asarray(again.colors), in_three(cloud) / 255.0, atol=1e-9)
    np.testing.assert_allclose(np.asarray(again.normals), cloud.normals, atol=1e-6)


def test_what_a_format_has_no_place_for_is_named():
    from hmrf_icp.io.cloud import dropped

    cloud = cloud_of(30)
    camera = PinholeCamera(6, 5, 5.0, 5.0, 2.5, 2.0)
    assert dropped("c.e57", cloud) == []
    assert dropped("c.las", cloud) == []
    assert dropped("c.obj", cloud) == ["intensity"]
    assert dropped("c.pts", cloud) == ["normals"]
    assert dropped("c.asc", cloud) == ["normals", *COLOURS, "intensity"]
    assert dropped("c.npy", PointCloud.from_depth(np.ones((5, 6)), camera)) == []
