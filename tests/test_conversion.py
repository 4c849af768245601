"""Clouds, tensors, tables, images and cameras of other libraries."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import InputError, PinholeCamera, PointCloud
from hmrf_icp.io import read_cloud

POINTS = np.random.default_rng(5).normal(size=(60, 3)).astype(np.float32)
INTENSITY = np.arange(60, dtype=np.uint16)


class Tensor:
    """A tensor on another device, as of PyTorch and Open3D: it has to be fetched."""

    def __init__(self, values, here=False):
        self._values, self._here = values, here

    def cpu(self):
        return Tensor(self._values, here=True)

    def numpy(self):
        if not self._here:
            raise TypeError("cannot convert a tensor on another device")
        return self._values


def structured(names):
    table = np.zeros(60, [*((name, "f4") for name in names), ("intensity", "u2"), ("text", "S3")])
    for name, values in zip(names, POINTS.T, strict=True):
        table[name] = values
    table["intensity"] = INTENSITY
    return table


HELD = {
    "float32": POINTS,
    "big-endian": POINTS.astype(">f8"),
    "read-only": np.frombuffer(POINTS.tobytes(), np.float32).reshape(60, 3),
    "Fortran": np.asfortranarray(POINTS),
    "every other": np.repeat(POINTS, 2, axis=0)[::2],
    "list": POINTS.tolist(),
    "objects": POINTS.astype(object),
    "matrix": np.asmatrix(POINTS),
    "homogeneous": np.c_[POINTS, np.ones(60)],
    "ROS": structured("xyz"),
    "LAS": structured("XYZ"),
    "vertices": POINTS.view([("f0", "f4"), ("f1", "f4"), ("f2", "f4")]).ravel(),
    "columns": dict(zip("xyz", POINTS.T, strict=True)),
    "element": {"vertex": structured("xyz")},
    "element with data": SimpleNamespace(points=structured("xyz")),
    "attribute": SimpleNamespace(points=POINTS.tolist()),
    "method": SimpleNamespace(
        points=lambda: np.c_[POINTS, np.ones(60)], normals=lambda: np.zeros((60, 4))
    ),
    "tensor": Tensor(POINTS),
    "scaled": SimpleNamespace(
        xyz=POINTS, point_format=None, points=(1000 * POINTS).astype(np.int32)
    ),
}


@pytest.mark.parametrize("held", HELD)
def test_points_are_taken_however_they_are_held(held):
    cloud = PointCloud(HELD[held], viewpoint=(0.0, 0.0, 9.0))
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert cloud.points.flags.c_contiguous
    assert cloud.points.dtype == np.float64
    assert not cloud.points.flags.writeable


def test_they_register_like_the_array():
    expected = hmrf_icp.register(POINTS, POINTS[::-1])
    for held in ("ROS", "method", "Fortran", "read-only"):
        found = hmrf_icp.register(HELD[held], POINTS[::-1])
        np.testing.assert_array_equal(found.transformation, expected.transformation)


def test_other_fields_of_a_table_are_attributes():
    cloud = PointCloud(structured("xyz"))
    assert list(cloud.attributes) == ["intensity"]
    np.testing.assert_array_equal(cloud.attributes["intensity"], INTENSITY)


def test_a_table_may_be_an_image():
    image = structured("xyz").reshape(6, 10)
    cloud = PointCloud(image)
    assert cloud.shape == (6, 10)
    assert cloud.attributes["intensity"].shape == (6, 10)


def test_masked_fields_are_unobserved():
    table = np.ma.masked_array(structured("xyz"))
    table["y"][3] = np.ma.masked
    np.testing.assert_array_equal(PointCloud(table).observed, np.arange(60) != 3)


@pytest.mark.parametrize(
    ("given", "advice"),
    [
        (np.c_[POINTS, INTENSITY], r"points\[..., :3\]"),
        (np.c_[POINTS, POINTS], r"points\[..., :3\]"),
        (POINTS.T, r"points\.T"),
        (np.ones((48, 64)), "from_depth"),
        (POINTS.astype(complex), "complex"),
        (np.full((20, 3), "1"), "expected a PointCloud"),
        ("cloud", "str"),
        (None, "NoneType"),
        (7, "int"),
        ([], r"\(0,\)"),
        ([[1, 2, 3], [4, 5]], "list"),
        (np.zeros(5, [("a", "f4"), ("b", "f4")]), "fields a, b"),
        (SimpleNamespace(fields=[], point_step=16, data=b""), "read_points"),
        (SimpleNamespace(points=lambda: 1 / 0), "division by zero"),
        (lambda: POINTS, "function"),
        (np.zeros((2, 3, 4, 3)), r"\(2, 3, 4, 3\)"),
    ],
)
def test_what_is_refused_says_what_to_pass(given, advice):
    for take in (PointCloud, hmrf_icp.prepare):
        with pytest.raises(InputError, match=advice):
            take(given)


K = np.array([[20.0, 0.0, 9.5], [0.0, 21.0, 7.5], [0.0, 0.0, 1.0]])


def test_a_matrix_will_do_for_a_camera():
    camera = PinholeCamera.from_matrix(K, 20, 16)
    depth = np.random.default_rng(0).uniform(1, 2, (16, 20))
    expected = PointCloud.from_depth(depth, camera)
    intrinsic = SimpleNamespace(width=20, height=16, intrinsic_matrix=K)
    for given in (K, K.tolist(), Tensor(K), intrinsic):
        assert PointCloud.from_depth(depth, given) == expected
        assert PointCloud(expected.points, given) == expected
    with pytest.raises(InputError, match="PinholeCameraIntrinsic"):
        PointCloud.from_depth(depth, (20.0, 21.0, 9.5, 7.5))
    with pytest.raises(InputError, match="40 x 16"):
        PointCloud.from_depth(depth, SimpleNamespace(width=40, height=16, intrinsic_matrix=K))


def test_a_depth_image_of_another_library_is_one():
    depth = np.random.default_rng(0).integers(500, 900, (16, 20)).astype(np.uint16)
    expected = PointCloud.from_depth(depth, K)
    image = SimpleNamespace(as_tensor=lambda: Tensor(depth[..., None]))
    for given in (depth[..., None], Tensor(depth), image, np.asfortranarray(depth)):
        assert PointCloud.from_depth(given, K) == expected


def test_clouds_of_open3d():
    o3d = pytest.importorskip("open3d", reason="Open3D is not installed")
    legacy = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(POINTS.astype(float)))
    legacy.normals = o3d.utility.Vector3dVector(np.tile([0.0, 0.0, 1.0], (60, 1)))
    tensor = o3d.t.geometry.PointCloud.from_legacy(legacy)
    tensor.point["intensity"] = o3d.core.Tensor(INTENSITY[:, None])
    for cloud in (legacy, tensor):
        taken = PointCloud(cloud, viewpoint=(0.0, 0.0, 5.0))
        np.testing.assert_allclose(taken.points, POINTS, atol=1e-6)
        np.testing.assert_array_equal(taken.normals[:, 2], np.ones(60))
        np.testing.assert_array_equal(taken.viewpoint, (0.0, 0.0, 5.0))
    np.testing.assert_array_equal(taken.attributes["intensity"].ravel(), INTENSITY)
    np.testing.assert_array_equal(PointCloud(tensor.point.positions).points, taken.points)
    intrinsic = o3d.camera.PinholeCameraIntrinsic(20, 16, 20.0, 21.0, 9.5, 7.5)
    depth = np.full((16, 20), 1500, np.uint16)
    expected = PointCloud.from_depth(depth, K)
    assert PointCloud.from_depth(o3d.geometry.Image(depth), intrinsic) == expected
    assert PointCloud.from_depth(o3d.t.geometry.Image(depth), intrinsic) == expected


def test_an_archive_of_open3d(tmp_path):
    np.savez(tmp_path / "cloud.npz", positions=POINTS, colors=np.zeros((60, 3)))
    np.testing.assert_array_equal(read_cloud(tmp_path / "cloud.npz").points, POINTS)


def test_clouds_of_small_gicp():
    small_gicp = pytest.importorskip("small_gicp", reason="small_gicp is not installed")
    cloud = small_gicp.PointCloud(POINTS.astype(float))
    taken = PointCloud(cloud)
    np.testing.assert_array_equal(taken.points, POINTS)
    assert taken.normals is None
    small_gicp.estimate_normals(cloud, num_neighbors=10)
    lengths = np.linalg.norm(PointCloud(cloud).normals, axis=1)
    np.testing.assert_allclose(lengths, 1.0)
