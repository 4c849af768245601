"""What a file has for each point beside its coordinates comes along, and goes out again."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmrf_icp import InputError, PinholeCamera, PointCloud, se3
from hmrf_icp.clouds.cloud import as_cloud
from hmrf_icp.clouds.moved import moved
from hmrf_icp.io import read_cloud, write_cloud
from hmrf_icp.io.cloud import dropped

RNG = np.random.default_rng(11)
POINTS = RNG.normal(size=(30, 3))
NORMALS = POINTS / np.linalg.norm(POINTS, axis=1, keepdims=True)
COLOURS = dict(zip(("red", "green", "blue"), RNG.integers(0, 256, (3, 30), np.uint8), strict=True))
CLOUD = PointCloud(
    POINTS,
    normals=NORMALS,
    attributes={
        **COLOURS,
        "intensity": RNG.random(30, np.float32),
        "ring": RNG.integers(0, 64, 30, np.uint16),
        "time": RNG.random(30),
    },
)
KEEP_ALL = (".ply", ".pcd", ".csv", ".npz")
POSE = se3.exp([0.3, -0.2, 1.1, 4.0, -5.0, 6.0])


@pytest.mark.parametrize("suffix", KEEP_ALL)
def test_what_was_written_comes_back(tmp_path, suffix):
    write_cloud(tmp_path / f"c{suffix}", CLOUD)
    read = read_cloud(tmp_path / f"c{suffix}")
    np.testing.assert_allclose(read.normals, NORMALS, atol=1e-7)
    assert {*read.attributes} - {"rgb"} >= {"intensity", "ring", "time"}
    for name in ("intensity", "ring", "time"):
        np.testing.assert_array_equal(read.attributes[name], CLOUD.attributes[name])
    assert dropped(f"c{suffix}", CLOUD) == []


@pytest.mark.parametrize("through", KEEP_ALL)
def test_a_colour_stays_a_colour_whatever_it_goes_through(tmp_path, through):
    write_cloud(tmp_path / f"a{through}", CLOUD)
    write_cloud(tmp_path / "b.ply", read_cloud(tmp_path / f"a{through}"))
    read = read_cloud(tmp_path / "b.ply").attributes
    for name, values in COLOURS.items():
        np.testing.assert_array_equal(read[name], values)
    write_cloud(tmp_path / "c.pcd", read_cloud(tmp_path / f"a{through}"))
    if through != ".csv":  # whose numbers have no type: 255 is an integer like any other
        assert b" rgb\n" in (tmp_path / "c.pcd").read_bytes()


@pytest.mark.parametrize("suffix", [".pcd", ".npz"])
def test_a_grid_keeps_them_on_its_pixels(tmp_path, suffix):
    grid = PointCloud(
        POINTS.reshape(5, 6, 3),
        normals=NORMALS.reshape(5, 6, 3),
        attributes={
            "gain": np.arange(30, dtype=np.int32).reshape(5, 6),
            "pair": np.ones((5, 6, 2)),
        },
    )
    write_cloud(tmp_path / f"g{suffix}", grid)
    read = read_cloud(tmp_path / f"g{suffix}")
    np.testing.assert_allclose(read.normals, grid.normals, atol=1e-7)
    for name, values in grid.attributes.items():
        np.testing.assert_array_equal(read.attributes[name], values)


def test_a_hole_takes_its_values_with_it_where_only_points_are_written(tmp_path):
    points = POINTS.copy()
    points[3] = np.nan
    write_cloud(tmp_path / "c.ply", PointCloud(points, attributes={"n": np.arange(30)}))
    kept = read_cloud(tmp_path / "c.ply").attributes["n"]
    assert kept.tolist() == [n for n in range(30) if n != 3]


def test_formats_without_a_place_say_what_they_drop(tmp_path):
    assert dropped("c.npy", CLOUD) == ["normals", *CLOUD.attributes]
    assert dropped("c.xyzn", CLOUD) == [*CLOUD.attributes]
    write_cloud(tmp_path / "c.xyzn", CLOUD)
    np.testing.assert_array_equal(read_cloud(tmp_path / "c.xyzn").normals, NORMALS)


def test_a_point_that_is_kept_keeps_what_it_has():
    thinned = CLOUD.subsample(7)
    np.testing.assert_array_equal(thinned.normals, NORMALS[::7])
    np.testing.assert_array_equal(thinned.attributes["ring"], CLOUD.attributes["ring"][::7])


@settings(max_examples=20)
@given(st.lists(st.floats(-3, 3), min_size=6, max_size=6))
def test_a_motion_turns_the_normals_and_moves_the_viewpoint(twist):
    pose = se3.exp(twist)
    there = moved(PointCloud(POINTS, viewpoint=[1.0, 2.0, 3.0], normals=NORMALS), pose)
    # A normal is the difference of two points of the cloud's frame.
    tips = se3.transform(pose, POINTS + NORMALS)
    np.testing.assert_allclose(there.points + there.normals, tips, atol=1e-12)
    np.testing.assert_allclose(there.viewpoint, se3.transform(pose, np.array([1.0, 2, 3])))


def test_a_camera_stays_where_it_is():
    camera = PinholeCamera(width=6, height=5, fx=6.0, fy=6.0, cx=3.0, cy=2.5)
    seen = PointCloud(POINTS.reshape(5, 6, 3), camera)
    assert moved(seen, np.eye(4)).camera == camera
    assert moved(seen, POSE).camera is None
    np.testing.assert_allclose(moved(seen, POSE).viewpoint, POSE[:3, 3])


def test_nobody_changes_them_afterwards():
    values = np.arange(30.0)
    cloud = PointCloud(POINTS, attributes={"a": values})
    values[0] = 7.0
    assert cloud.attributes["a"][0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        cloud.attributes["a"][0] = 1.0
    with pytest.raises(TypeError):
        cloud.attributes["b"] = values


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"normals": NORMALS[:5]}, "normals: expected one value"),
        ({"normals": NORMALS[:, :2]}, "normals: expected shape"),
        ({"normals": [["a"] * 3] * 30}, "normals: expected an array of numbers"),
        ({"attributes": {"i": np.ones(29)}}, r"attributes: 'i': .* for each point of \(30,\)"),
        ({"attributes": {"i": ["a"] * 30}}, "attributes: 'i': expected an array of numbers"),
    ],
)
def test_what_does_not_fit_the_points_is_named(given, says):
    with pytest.raises(InputError, match=says):
        PointCloud(POINTS, **given)


def test_normals_and_colours_of_other_libraries_come_along():
    colours = np.linspace(0, 1, 90).reshape(30, 3)
    other = SimpleNamespace(points=POINTS, normals=NORMALS, colors=colours)
    cloud = as_cloud(other)
    np.testing.assert_array_equal(cloud.normals, NORMALS)
    np.testing.assert_array_equal(cloud.attributes["blue"], np.rint(255 * colours[:, 2]))
    odd = as_cloud(SimpleNamespace(points=POINTS, normals=lambda: None, colors=[]))
    assert odd.normals is None
    assert not odd.attributes


def test_names_that_a_header_cannot_hold_or_that_mean_something_else(tmp_path):
    odd = {"two words": np.ones(30), "x": np.zeros(30), "nx": np.zeros(30), "points": np.ones(30)}
    cloud = PointCloud(POINTS, normals=NORMALS, attributes=odd)
    for suffix in KEEP_ALL:
        write_cloud(tmp_path / f"c{suffix}", cloud)
        read = read_cloud(tmp_path / f"c{suffix}")
        np.testing.assert_allclose(read.points, POINTS, atol=1e-4)
        np.testing.assert_allclose(read.normals, NORMALS, atol=1e-6)
        assert len(read.attributes) == 4
