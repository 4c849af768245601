"""E57 keeps points to the last digit, what was measured at them, and where the scanner stood."""

from __future__ import annotations

import numpy as np
import pytest

from hmrf_icp import InputError, PointCloud
from hmrf_icp.io import read_cloud, write_cloud

pye57 = pytest.importorskip("pye57", reason="needs pye57 (the extra 'e57')")

RNG = np.random.default_rng(4)
POINTS = RNG.normal(size=(50, 3))
UTM = POINTS + np.array([691_000.0, 5_336_000.0, 500.0])
NORMALS = RNG.normal(size=(50, 3))
ATTRIBUTES = {
    "intensity": RNG.random(50),
    "red": RNG.integers(0, 256, 50, np.uint8),
    "green": RNG.integers(0, 256, 50, np.uint8),
    "blue": RNG.integers(0, 256, 50, np.uint8),
}
ROWS = {
    "rowIndex": np.arange(50, dtype=np.uint16) // 10,
    "columnIndex": np.arange(50, dtype=np.uint16) % 10,
}
STILL = np.array([1.0, 0.0, 0.0, 0.0])
TURN = np.array([0.8, 0.0, 0.0, 0.6])  # about z, w first


def scan_of(points, **more):
    x, y, z = np.asarray(points, dtype=float).T
    return {"cartesianX": x, "cartesianY": y, "cartesianZ": z, **more}


def written(path, *scans):
    """Write scans by pye57 itself, each with its rotation and translation."""
    with pye57.E57(str(path), mode="w") as file:
        for data, rotation, translation in scans:
            file.write_scan_raw(data, rotation=rotation, translation=np.asarray(translation))
    return path


def test_everything_comes_back(tmp_path):
    stood = UTM.mean(axis=0)
    cloud = PointCloud(UTM, viewpoint=stood, normals=NORMALS, attributes=ATTRIBUTES)
    write_cloud(tmp_path / "c.e57", cloud)
    read = read_cloud(tmp_path / "c.e57")
    np.testing.assert_allclose(read.points, UTM, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(read.normals, NORMALS)
    np.testing.assert_array_equal(read.viewpoint, stood)
    assert set(read.attributes) == set(ATTRIBUTES)
    for name, values in ATTRIBUTES.items():
        np.testing.assert_array_equal(read.attributes[name], values)
        assert read.attributes[name].dtype == values.dtype
    again = tmp_path / "d.e57"
    write_cloud(again, cloud)
    assert again.read_bytes() == (tmp_path / "c.e57").read_bytes()


def test_what_is_written_is_what_pye57_reads(tmp_path):
    write_cloud(tmp_path / "c.e57", PointCloud(UTM, attributes=ATTRIBUTES))
    with pye57.E57(str(tmp_path / "c.e57")) as file:
        data = file.read_scan(0, intensity=True, colors=True, ignore_missing_fields=True)
    np.testing.assert_array_equal(data["cartesianY"], UTM[:, 1])
    np.testing.assert_array_equal(data["colorGreen"], ATTRIBUTES["green"])


def test_a_scan_stands_where_its_pose_says(tmp_path):
    path = written(tmp_path / "c.e57", (scan_of(POINTS), TURN, [10.0, 20.0, 1.5]))
    cloud = read_cloud(path)
    turn = np.array([[0.28, -0.96, 0.0], [0.96, 0.28, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(cloud.points, POINTS @ turn.T + [10.0, 20.0, 1.5], atol=1e-5)
    np.testing.assert_array_equal(cloud.viewpoint, [10.0, 20.0, 1.5])


def test_a_pose_that_says_nothing_is_no_viewpoint_unless_there_are_rows(tmp_path):
    """A merged cloud is written with the identity; a scan with rows and columns is a sensor's."""
    plain = written(tmp_path / "p.e57", (scan_of(POINTS), STILL, np.zeros(3)))
    assert read_cloud(plain).viewpoint is None
    grid = read_cloud(written(tmp_path / "g.e57", (scan_of(POINTS, **ROWS), STILL, np.zeros(3))))
    np.testing.assert_array_equal(grid.viewpoint, np.zeros(3))


def test_rows_and_columns_are_a_grid_again(tmp_path):
    """Whatever the order of the records and the first row; what is invalid is a hole."""
    order = RNG.permutation(50)
    invalid = (order % 7 == 0).astype(np.int8) * 2
    data = scan_of(
        POINTS[order],
        rowIndex=ROWS["rowIndex"][order] + np.uint16(3),
        columnIndex=ROWS["columnIndex"][order],
        intensity=order.astype(np.float32),
        cartesianInvalidState=invalid,
    )
    cloud = read_cloud(written(tmp_path / "g.e57", (data, STILL, np.zeros(3))))
    assert cloud.shape == (5, 10)
    hole = np.arange(50) % 7 == 0
    np.testing.assert_array_equal(cloud.observed.ravel(), ~hole)
    np.testing.assert_allclose(cloud.points.reshape(-1, 3)[~hole], POINTS[~hole], atol=1e-6)
    assert set(cloud.attributes) == {"intensity"}
    np.testing.assert_array_equal(
        cloud.attributes["intensity"].ravel()[~hole], np.arange(50.0)[~hole]
    )


@pytest.mark.parametrize("why", ["thinned out", "two returns", "one row"])
def test_points_that_fill_no_grid_are_a_list(tmp_path, why):
    rows, columns = (values.copy() for values in ROWS.values())
    if why == "thinned out":
        rows, columns = rows * 4, columns * 4
    elif why == "two returns":
        rows[1], columns[1] = rows[0], columns[0]
    elif why == "one row":
        rows[:], columns = 0, np.arange(50, dtype=np.uint16)
    data = scan_of(POINTS, rowIndex=rows, columnIndex=columns)
    cloud = read_cloud(written(tmp_path / "l.e57", (data, STILL, np.zeros(3))))
    assert cloud.shape == (50,)
    np.testing.assert_array_equal(cloud.attributes["rowIndex"], rows)


def test_a_grid_that_was_seen_from_somewhere_is_written_as_one(tmp_path):
    """Rows say that a sensor stood there, so a grid without a viewpoint is written without them."""
    points = POINTS.reshape(5, 10, 3).copy()
    points[1, 2] = np.nan
    for stood in (np.zeros(3), np.array([1.0, 2.0, 3.0])):
        write_cloud(tmp_path / "g.e57", PointCloud(points, viewpoint=stood))
        read = read_cloud(tmp_path / "g.e57")
        np.testing.assert_allclose(read.points, points, atol=1e-12)
        np.testing.assert_array_equal(read.viewpoint, stood)
    write_cloud(tmp_path / "g.e57", PointCloud(points))
    read = read_cloud(tmp_path / "g.e57")
    assert read.shape == (49,)
    assert read.viewpoint is None


def test_several_scans_are_one_cloud_without_a_viewpoint(tmp_path):
    one = scan_of(POINTS, intensity=np.ones(50, np.float32))
    path = written(
        tmp_path / "c.e57", (one, TURN, [1.0, 0, 0]), (scan_of(POINTS), TURN, [5.0, 0, 0])
    )
    cloud = read_cloud(path)
    assert cloud.shape == (100,)
    np.testing.assert_allclose(cloud.points[50:] - cloud.points[:50], [[4.0, 0, 0]] * 50, atol=1e-5)
    assert cloud.viewpoint is None
    assert not cloud.attributes  # the second scan has no intensity


def test_points_marked_as_invalid_are_left_out(tmp_path):
    invalid = (np.arange(50) % 5 == 0).astype(np.int8) * 2
    data = scan_of(POINTS, cartesianInvalidState=invalid)
    path = written(tmp_path / "c.e57", (data, TURN, np.zeros(3)))
    assert len(read_cloud(path)) == 40


def test_files_cut_short_or_changed(tmp_path):
    write_cloud(tmp_path / "c.e57", PointCloud(UTM, attributes=ATTRIBUTES))
    whole = (tmp_path / "c.e57").read_bytes()
    cut = tmp_path / "cut.e57"
    for end in (5, 40, 1024, len(whole) - 1024, len(whole) - 1):
        cut.write_bytes(whole[:end])
        with pytest.raises(InputError, match=r"cut\.e57: "):
            read_cloud(cut)
    for at in (60, 1500, len(whole) - 500):  # the checksums tell
        cut.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        with pytest.raises(InputError, match=r"cut\.e57: cannot be read as an E57 file"):
            read_cloud(cut)
    cut.write_bytes(b"hello")
    with pytest.raises(InputError, match="not an E57 file"):
        read_cloud(cut)


def test_without_pye57_the_extra_is_named(tmp_path, monkeypatch):
    (tmp_path / "c.e57").write_bytes(b"ASTM-E57")
    monkeypatch.setitem(__import__("sys").modules, "pye57", None)
    with pytest.raises(InputError, match=r"needs pye57 .*pip install 'hmrf-icp\[e57\]'"):
        read_cloud(tmp_path / "c.e57")
