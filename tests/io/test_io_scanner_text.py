"""The plain formats of scanners: KITTI's and nuScenes' scans, PTS, ASC."""

from __future__ import annotations

import numpy as np
import pytest

from hmrf_icp import InputError, PointCloud
from hmrf_icp.io import read_cloud, write_cloud

POINTS = np.array([[0.125, -1.5, 2.0], [3.0, 4.25, -5.5], [1e-3, 0.1, 0.5]])
UTM = POINTS + np.array([691_000.0, 5_336_000.0, 500.0])
COLOURS = {
    "red": np.array([1, 2, 255], np.uint8),
    "green": np.array([0, 50, 60], np.uint8),
    "blue": np.array([9, 8, 7], np.uint8),
}


def test_a_scan_of_kitti_is_seen_from_the_origin(tmp_path):
    table = np.c_[POINTS, [0.0, 0.5, 0.99]].astype("<f4")
    table = np.r_[table, np.zeros((1, 4), "<f4")]  # a shot that met nothing
    table.tofile(tmp_path / "000.bin")
    cloud = read_cloud(tmp_path / "000.bin")
    np.testing.assert_array_equal(cloud.points[:3], POINTS.astype(np.float32))
    assert np.isnan(cloud.points[3]).all()
    np.testing.assert_array_equal(cloud.viewpoint, np.zeros(3))
    np.testing.assert_array_equal(cloud.attributes["intensity"], table[:, 3])


def test_a_scan_of_nuscenes_has_five_numbers_a_point(tmp_path):
    np.c_[POINTS, [1.0, 2.0, 3.0], [0.0, 31.0, 7.0]].astype("<f4").tofile(tmp_path / "s.pcd.bin")
    cloud = read_cloud(tmp_path / "s.pcd.bin")
    assert len(cloud) == 3
    assert cloud.attributes["ring"].tolist() == [0.0, 31.0, 7.0]


def test_a_bin_that_is_no_scan(tmp_path):
    (tmp_path / "cut.bin").write_bytes(bytes(30))
    with pytest.raises(InputError, match="30 bytes are not a whole number of points of 16 bytes"):
        read_cloud(tmp_path / "cut.bin")
    np.full(8, 3e9, "<f4").tofile(tmp_path / "other.bin")
    with pytest.raises(InputError, match="a coordinate of 3e\\+09 m; expected x, y, z, reflect"):
        read_cloud(tmp_path / "other.bin")


@pytest.mark.parametrize(
    ("attributes", "columns"),
    [
        ({}, 3),
        ({"intensity": np.array([-2048, 0, 2047])}, 4),
        (COLOURS, 6),
        ({"intensity": np.array([0.5, 0.25, 1.0])} | COLOURS, 7),
    ],
)
def test_pts_keeps_intensity_and_colour(tmp_path, attributes, columns):
    path = tmp_path / "c.pts"
    write_cloud(path, PointCloud(UTM, attributes=attributes))
    lines = path.read_text().splitlines()
    assert lines[0] == "3"
    assert [len(line.split()) for line in lines[1:]] == [columns] * 3
    cloud = read_cloud(path)
    np.testing.assert_array_equal(cloud.points, UTM)
    assert set(cloud.attributes) == set(attributes)
    for name, values in attributes.items():
        np.testing.assert_array_equal(cloud.attributes[name], values)
        assert cloud.attributes[name].dtype.kind == values.dtype.kind


def test_pts_of_two_scans_and_one_cut_short(tmp_path):
    (tmp_path / "two.pts").write_text("2\n0 0 1 5\n1 0 1 6\n1\n2 0 1 7\n")
    assert len(read_cloud(tmp_path / "two.pts")) == 3
    (tmp_path / "cut.pts").write_text("20000000000000000000000\n0 0 1 5\n")
    with pytest.raises(InputError, match=r"cut\.pts: cut short: .* points promised, 1 found"):
        read_cloud(tmp_path / "cut.pts")
    (tmp_path / "no.pts").write_text("0\n")
    with pytest.raises(InputError, match="no points in it"):
        read_cloud(tmp_path / "no.pts")


def test_asc_as_cloudcompare_writes_it(tmp_path):
    rows = [f"{x} {y} {z} 255 0 7 0.5 0 0 1" for x, y, z in UTM]
    (tmp_path / "c.asc").write_text("\n".join(["//X Y Z R G B Intensity Nx Ny Nz", *rows]))
    cloud = read_cloud(tmp_path / "c.asc")
    np.testing.assert_array_equal(cloud.points, UTM)
    np.testing.assert_array_equal(cloud.normals, [[0, 0, 1]] * 3)
    assert cloud.attributes["red"].dtype == np.uint8
    assert set(cloud.attributes) == {"red", "green", "blue", "Intensity"}
    write_cloud(tmp_path / "d.asc", cloud)
    np.testing.assert_array_equal(read_cloud(tmp_path / "d.asc").points, UTM)


def test_asc_that_is_a_grid_of_heights(tmp_path):
    (tmp_path / "g.asc").write_text("ncols 4\nnrows 2\ncellsize 1\n1 2 3 4\n")
    with pytest.raises(InputError, match="an ESRI grid of heights, not points"):
        read_cloud(tmp_path / "g.asc")
