"""LAS and LAZ keep the digits of a national grid, and what was measured beside them."""

from __future__ import annotations

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import InputError, PointCloud
from hmrf_icp.io import read_cloud, write_cloud

laspy = pytest.importorskip("laspy", reason="needs laspy (the extra 'las')")
pytest.importorskip("lazrs", reason="needs lazrs (the extra 'las')")

RNG = np.random.default_rng(3)
UTM = RNG.uniform(size=(300, 3)) * [400.0, 300.0, 40.0] + [691_000.0, 5_336_000.0, 500.0]
NORMALS = RNG.normal(size=(300, 3)) * [1.0, 0.0, 1.0]
ATTRIBUTES = {
    "red": RNG.integers(0, 256, 300, np.uint8),
    "green": RNG.integers(0, 256, 300, np.uint8),
    "blue": RNG.integers(0, 256, 300, np.uint8),
    "intensity": RNG.random(300, np.float32),
    "classification": RNG.integers(1, 30, 300, np.uint8),
    "gps_time": 1e9 * RNG.random(300),
    "label": RNG.integers(-5, 5, 300),
}


def las(version="1.2", point_format=3, scale=1e-3):
    header = laspy.LasHeader(version=version, point_format=point_format)
    header.scales, header.offsets = [scale] * 3, [691_000.0, 5_336_000.0, 0.0]
    data = laspy.LasData(header)
    data.x, data.y, data.z = UTM.T
    return data


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_everything_comes_back(tmp_path, suffix):
    cloud = PointCloud(UTM, normals=NORMALS, attributes=ATTRIBUTES)
    write_cloud(tmp_path / f"c{suffix}", cloud)
    read = read_cloud(tmp_path / f"c{suffix}")
    np.testing.assert_allclose(read.points, UTM, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(read.normals, NORMALS)
    assert set(read.attributes) == set(ATTRIBUTES)
    for name, values in ATTRIBUTES.items():
        np.testing.assert_array_equal(read.attributes[name], values)
        assert read.attributes[name].dtype == values.dtype
    assert read.viewpoint is None


def test_what_is_written_is_what_other_programs_read(tmp_path):
    write_cloud(tmp_path / "c.las", PointCloud(UTM, attributes=ATTRIBUTES))
    other = laspy.read(tmp_path / "c.las")
    np.testing.assert_allclose(np.asarray(other.xyz), UTM, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(other.red, ATTRIBUTES["red"].astype(int) * 257)
    np.testing.assert_array_equal(other.classification, ATTRIBUTES["classification"])


def test_a_survey_in_utm_keeps_scale_and_offset_in_float64(tmp_path):
    data = las(scale=1e-4)
    data.intensity = np.arange(300)
    data.red = data.green = data.blue = np.full(300, 200, np.uint16)  # bytes, from the right
    data.write(tmp_path / "c.las")
    cloud = read_cloud(tmp_path / "c.las")
    np.testing.assert_array_equal(cloud.points, np.asarray(data.xyz))
    assert np.abs(cloud.points - UTM).max() < 1e-4
    assert set(cloud.attributes) == {"intensity", "red", "green", "blue"}
    assert (cloud.attributes["red"] == 200).all()
    assert cloud == PointCloud(data)  # as laspy's own object


def test_colours_of_sixteen_bits_become_bytes(tmp_path):
    data = las()
    data.red = np.arange(300) * 218
    data.write(tmp_path / "c.las")
    red = read_cloud(tmp_path / "c.las").attributes["red"]
    assert red.dtype == np.uint8
    np.testing.assert_array_equal(red, np.arange(300) * 218 // 256)


def test_points_marked_as_withheld_are_left_out(tmp_path):
    data = las()
    data.withheld = np.arange(300) < 7
    data.write(tmp_path / "c.las")
    cloud = read_cloud(tmp_path / "c.las")
    assert len(cloud) == 293
    assert "7 of 300 points are marked as withheld" in cloud.notes[0]
    assert "withheld" not in cloud.attributes


@pytest.mark.parametrize(
    ("wkt", "word"),
    [
        ('PROJCS["a",GEOGCS["b",UNIT["degree",0.017]],UNIT["US survey foot",0.3048006]]', "feet"),
        ('GEOGCS["WGS 84",UNIT["degree",0.0174532925]]', "degrees"),
        ('PROJCS["UTM",GEOGCS["b",UNIT["degree",0.017]],UNIT["metre",1]]', None),
    ],
)
def test_feet_and_degrees_are_said_and_never_converted(tmp_path, wkt, word):
    data = las("1.4", 6)
    data.header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr(wkt))
    data.write(tmp_path / "c.las")
    cloud = read_cloud(tmp_path / "c.las")
    assert np.abs(cloud.points - UTM).max() < 1e-2
    assert [word in note for note in cloud.notes] == ([True] if word else [])


def test_two_surveys_register_where_they_lie(tmp_path):
    x, y = np.random.default_rng(0).uniform(size=(2, 2000)) * [[400.0], [280.0]]
    heights = 40.0 * np.sin(x / 57.0) * np.cos(y / 44.0)
    ground = np.c_[x, y, heights] + [691_000.0, 5_336_000.0, 500.0]
    shift = np.array([0.7, -0.4, 0.3])
    write_cloud(tmp_path / "a.laz", PointCloud(ground - shift))
    write_cloud(tmp_path / "b.las", PointCloud(ground))
    result = hmrf_icp.register(tmp_path / "a.laz", tmp_path / "b.las", np.eye(4))
    middle = np.append(ground.mean(axis=0) - shift, 1.0)
    np.testing.assert_allclose((result.transformation @ middle)[:3] - middle[:3], shift, atol=1e-3)


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_files_cut_short_anywhere(tmp_path, suffix):
    write_cloud(tmp_path / f"c{suffix}", PointCloud(UTM, attributes=ATTRIBUTES))
    whole = (tmp_path / f"c{suffix}").read_bytes()
    for end in (3, 100, 226, 300, len(whole) // 2, len(whole) - 30):
        (tmp_path / f"cut{suffix}").write_bytes(whole[:end])
        with pytest.raises(InputError, match=r"cut\.la[sz]: "):
            read_cloud(tmp_path / f"cut{suffix}")


def test_more_points_than_there_is_room_for(tmp_path):
    write_cloud(tmp_path / "c.laz", PointCloud(UTM))
    whole = bytearray((tmp_path / "c.laz").read_bytes())
    whole[247:255] = (10**11).to_bytes(8, "little")
    (tmp_path / "c.laz").write_bytes(whole)
    with pytest.raises(InputError, match="compressed bytes would become"):
        read_cloud(tmp_path / "c.laz")
    (tmp_path / "x.las").write_bytes(b"hello")
    with pytest.raises(InputError, match="not a LAS file"):
        read_cloud(tmp_path / "x.las")


def test_without_laspy_the_extra_is_named(tmp_path, monkeypatch):
    write_cloud(tmp_path / "c.las", PointCloud(UTM))
    monkeypatch.setitem(__import__("sys").modules, "laspy", None)
    with pytest.raises(InputError, match=r"needs laspy .*pip install 'hmrf-icp\[las\]'"):
        read_cloud(tmp_path / "c.las")
