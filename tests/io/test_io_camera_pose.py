"""Cameras and poses from text, and the mistakes that people make with them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmrf_icp import InputError, PinholeCamera, se3
from hmrf_icp.io import (
    parse_intrinsics,
    read_camera,
    read_cloud,
    read_intrinsics,
    read_pose,
    write_pose,
)

KINECT = PinholeCamera(width=640, height=480, fx=585.0, fy=580.5, cx=320.0, cy=241.5)
OPEN3D = {
    "width": 640,
    "height": 480,
    "intrinsic_matrix": [585.0, 0, 0, 0, 580.5, 0, 320.0, 241.5, 1],
}


def test_text_matrix(tmp_path):
    np.savetxt(tmp_path / "k.txt", KINECT.matrix)
    assert read_camera(tmp_path / "k.txt", 640, 480) == KINECT
    (tmp_path / "k.csv").write_text("# Kinect\n585,0,320\n0,580.5,241.5\n0,0,1\n")
    assert read_camera(tmp_path / "k.csv", 640, 480) == KINECT
    (tmp_path / "k.np").write_text(str(KINECT.matrix))
    assert read_camera(tmp_path / "k.np", 640, 480) == KINECT


def test_open3d_json_is_read_column_by_column(tmp_path):
    (tmp_path / "k.json").write_text(json.dumps(OPEN3D))
    assert read_camera(tmp_path / "k.json", 640, 480) == KINECT
    parameters = {"class_name": "PinholeCameraParameters", "extrinsic": [], "intrinsic": OPEN3D}
    (tmp_path / "p.json").write_text(json.dumps(parameters))
    assert read_camera(tmp_path / "p.json", 640, 480) == KINECT


def test_intrinsics_of_the_command_line():
    assert parse_intrinsics("585, 580.5,320,241.5").for_image(640, 480) == KINECT


@pytest.mark.parametrize("text", ["", "585", "1,2,3", "1,2,3,4,5", "a,b,c,d", "585 585 320 240"])
def test_intrinsics_that_are_not_four_numbers(text):
    with pytest.raises(InputError, match="--intrinsics: expected four numbers FX,FY,CX,CY"):
        parse_intrinsics(text, "--intrinsics")


@pytest.mark.parametrize("text", ["0,585,320,240", "585,-1,320,240", "nan,1,2,3", "1,1,inf,1"])
def test_intrinsics_of_no_lens(text):
    with pytest.raises(InputError, match="intrinsics: focal lengths must be positive"):
        parse_intrinsics(text)


@given(
    factor=st.sampled_from([0.25, 0.5, 2.0, 4.0]),
    off=st.tuples(st.floats(0.42, 0.58), st.floats(0.42, 0.58)),
)
def test_a_matrix_for_an_image_of_half_or_twice_the_size_is_noticed(factor, off):
    cx, cy = 640 * off[0], 480 * off[1]
    assert parse_intrinsics(f"585,585,{cx},{cy}").for_image(640, 480).cx == cx
    other = parse_intrinsics(f"{585 * factor},{585 * factor},{cx * factor},{cy * factor}")
    with pytest.raises(InputError, match=r"principal point .* 640 x 480 .*another image size"):
        other.for_image(640, 480)


def test_json_for_another_image_size(tmp_path):
    (tmp_path / "k.json").write_text(json.dumps(OPEN3D))
    with pytest.raises(InputError, match=r"k\.json: intrinsics for images of 640 x 480.*320 x 240"):
        read_camera(tmp_path / "k.json", 320, 240)


def test_json_of_a_crop_may_have_its_principal_point_anywhere(tmp_path):
    crop = OPEN3D | {"width": 100, "height": 80}
    (tmp_path / "k.json").write_text(json.dumps(crop))
    assert read_camera(tmp_path / "k.json", 100, 80).cx == 320.0


def test_the_depth_map_is_named_beside_the_camera(tmp_path):
    np.savetxt(tmp_path / "k.txt", KINECT.matrix)
    np.save(tmp_path / "small.npy", np.ones((240, 320)))
    with pytest.raises(InputError, match=r"small\.npy: .*k\.txt: .*another image size"):
        read_cloud(tmp_path / "small.npy", read_intrinsics(tmp_path / "k.txt"))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("585 0 320\n0 585 240\n", "found 2 rows"),
        ("585 0 320 0\n0 585 240 0\n0 0 1 0\n", "found 3 rows of 4 4 4"),
        ("fx fy cx cy\n", "found 'fx fy cx cy'"),
        ("585 0 nan\n0 585 240\n0 0 1\n", "NaN or infinity"),
        ("585 3 320\n0 585 240\n0 0 1\n", "no skew"),
        ("-585 0 320\n0 585 240\n0 0 1\n", "must be positive"),
        ("{", "malformed JSON"),
        ("{}", "no 'intrinsic_matrix'"),
        (json.dumps(OPEN3D | {"width": "wide"}), "not whole numbers"),
        (json.dumps(OPEN3D | {"intrinsic_matrix": [1, 2]}), "cannot reshape|expected a 3 x 3"),
        (json.dumps(OPEN3D | {"intrinsic_matrix": "K"}), "expected a 3 x 3"),
        (json.dumps({"intrinsic": 3}), "expected a 3 x 3"),
        (
            json.dumps(OPEN3D | {"intrinsic_matrix": [585, 0, 320, 0, 585, 240, 0, 0, 1]}),
            "row by row",
        ),
        (json.dumps({"width": 640, "intrinsic_matrix": [0] * 9}), "no 'height'"),
        ("\xff\xfe", "expected a 3 x 3"),
    ],
)
def test_malformed_intrinsics(tmp_path, content, message):
    (tmp_path / "k.json").write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=rf"k\.json: .*({message})"):
        read_camera(tmp_path / "k.json", 640, 480)


def test_intrinsics_that_are_missing_or_not_text(tmp_path):
    with pytest.raises(InputError, match=r"none\.txt: no such file"):
        read_camera(tmp_path / "none.txt", 640, 480)
    (tmp_path / "k.txt").write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(InputError, match=r"k\.txt: cannot be read as camera intrinsics"):
        read_camera(tmp_path / "k.txt", 640, 480)


@given(twist=st.lists(st.floats(-3, 3), min_size=6, max_size=6))
def test_a_pose_comes_back_as_it_was_written(twist, tmp_path_factory):
    path = tmp_path_factory.mktemp("pose") / "t.txt"
    pose = se3.exp(twist)
    write_pose(path, pose)
    np.testing.assert_allclose(read_pose(path), pose, rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("1 0 0 0\n0 1 0 0\n0 0 1 0\n", "found 3 rows of 4 4 4 numbers"),
        ("1 0 0\n0 1 0\n0 0 1\n", "found 3 rows"),
        ("2 0 0 0\n0 2 0 0\n0 0 2 0\n0 0 0 1\n", "not a rotation"),
        ("-1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n", "reflection"),
        ("1 0 0 0\n0 1 0 0\n0 0 1 0\n5 6 7 1\n", "last row"),
        ("1 0 0 inf\n0 1 0 0\n0 0 1 0\n0 0 0 1\n", "NaN or infinity"),
        ("# nothing\n", "no numbers"),
    ],
)
def test_malformed_pose(tmp_path, content, message):
    (tmp_path / "t.txt").write_text(content)
    with pytest.raises(InputError, match=rf"t\.txt: .*{message}"):
        read_pose(tmp_path / "t.txt")


def test_a_pose_that_is_not_rigid_is_not_written(tmp_path):
    (tmp_path / "t.txt").write_text("before")
    with pytest.raises(InputError, match="pose: "):
        write_pose(tmp_path / "t.txt", 2 * np.eye(4))
    assert (tmp_path / "t.txt").read_text() == "before"
