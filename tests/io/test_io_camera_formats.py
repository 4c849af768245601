"""The cameras that recorders write are read as the recorders' own libraries read them."""

from __future__ import annotations

import json

import numpy as np
import pytest

from hmrf_icp import DistortedCamera, InputError, PinholeCamera, PointCloud
from hmrf_icp.io import read_camera, read_cloud, read_intrinsics

REALSENSE = {
    "width": 640,
    "height": 480,
    "ppx": 321.5,
    "ppy": 239.25,
    "fx": 385.0,
    "fy": 386.0,
    "model": "distortion.brown_conrady",
    "coeffs": [0.0, 0.0, 0.0, 0.0, 0.0],
}
IDEAL = PinholeCamera(640, 480, 385.0, 386.0, 321.5, 239.25)
NUMBERS = [0.1, -0.2, 0.001, 0.002, 0.05]

# The layout of a factory's calibration, with numbers of our own.
KINECT = {
    "CalibrationInformation": {
        "Cameras": [
            {"Location": "CALIBRATION_CameraLocationPV0", "Purpose": "PhotoVideo"},
            {
                "Intrinsics": {
                    "ModelParameterCount": 14,
                    "ModelParameters": [
                        *(0.5125, 0.4945, 0.4921, 0.4922),
                        *(3.13, 2.32, 0.13, 3.46, 3.35, 0.66),
                        *(0, 0, -5.0e-5, 8.0e-5),
                    ],
                    "ModelType": "CALIBRATION_LensDistortionModelBrownConrady",
                },
                "Location": "CALIBRATION_CameraLocationD0",
                "Purpose": "CALIBRATION_CameraPurposeDepth",
                "MetricRadius": 1.74,
                "SensorHeight": 1024,
                "SensorWidth": 1024,
            },
        ]
    }
}

CALIBRATED = """\
image_width: 640
image_height: 480
camera_name: depth
camera_matrix:
  rows: 3
  cols: 3
  data: [385.0, 0.0, 321.5, 0.0, 386.0, 239.25, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.1, -0.2, 0.001, 0.002, 0.05]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
"""

TOPIC = """\
header:
  stamp: {sec: 1, nanosec: 2}
  frame_id: camera_depth_optical_frame
height: 480
width: 640
distortion_model: rational_polynomial
d:
- 0.1
- -0.2
- 0.001
- 0.002
- 0.05
- 0.3
- 0.02
- 0.01
k: [385.0, 0.0, 321.5, 0.0, 386.0, 239.25, 0.0, 0.0, 1.0]
binning_x: 0
roi: {x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false}
---
height: 1
"""

OPENCV = """\
%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 385., 0., 321.5, 0., 386., 239.25, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ 0.1, -0.2, 0.001, 0.002, 0.05 ]
"""


def saved(folder, name, content):
    path = folder / name
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def test_realsense_without_distortion_is_a_pinhole(tmp_path):
    assert read_camera(saved(tmp_path, "r.json", REALSENSE), 640, 480) == IDEAL
    assert read_camera(saved(tmp_path, "d.json", {"depth": REALSENSE}), 640, 480) == IDEAL


@pytest.mark.parametrize(
    ("model", "ours"),
    [
        ("distortion.brown_conrady", "brown-conrady"),
        ("Brown Conrady", "brown-conrady"),
        (4, "brown-conrady"),
        ("RS2_DISTORTION_INVERSE_BROWN_CONRADY", "inverse brown-conrady"),
        (2, "inverse brown-conrady"),
        ("Modified Brown Conrady", "modified brown-conrady"),
    ],
)
def test_models_of_realsense(tmp_path, model, ours):
    path = saved(tmp_path, "r.json", REALSENSE | {"model": model, "coeffs": NUMBERS})
    camera = read_camera(path, 640, 480)
    assert isinstance(camera, DistortedCamera)
    assert camera.camera == IDEAL
    assert camera.distortion.model == ours
    assert camera.distortion.coefficients[:5] == tuple(NUMBERS)


@pytest.mark.parametrize(
    ("size", "centre", "focal"),
    [
        ((640, 576), (0.5125 * 1024 - 192.5, 0.4945 * 1024 - 180.5), 0.4921 * 1024),
        ((320, 288), (0.5125 * 512 - 96.5, 0.4945 * 512 - 90.5), 0.4921 * 512),
        ((1024, 1024), (0.5125 * 1024 - 0.5, 0.4945 * 1024 - 0.5), 0.4921 * 1024),
        ((512, 512), (0.5125 * 512 - 0.5, 0.4945 * 512 - 0.5), 0.4921 * 512),
    ],
)
def test_the_depth_camera_of_an_azure_kinect_in_each_mode(tmp_path, size, centre, focal):
    camera = read_camera(saved(tmp_path, "k4a.json", KINECT), *size)
    assert isinstance(camera, DistortedCamera)
    assert (camera.camera.cx, camera.camera.cy) == pytest.approx(centre)
    assert camera.camera.fx == pytest.approx(focal)
    assert camera.distortion.coefficients == (3.13, 2.32, 8.0e-5, -5.0e-5, 0.13, 3.46, 3.35, 0.66)
    assert camera.distortion.reach == 1.74


def test_an_azure_kinect_has_no_other_sizes(tmp_path):
    with pytest.raises(InputError, match=r"of 640 x 576 or 320 x 288 or .*, the depth map has 640"):
        read_camera(saved(tmp_path, "k4a.json", KINECT), 640, 480)


@pytest.mark.parametrize(
    ("name", "content", "count"),
    [
        ("c.yaml", CALIBRATED, 5),
        ("c.yml", TOPIC, 8),
        ("c.txt", CALIBRATED, 5),
        ("o.yml", OPENCV, 5),
    ],
)
def test_camera_info_of_ros_and_opencv(tmp_path, name, content, count):
    pytest.importorskip("yaml", reason="needs PyYAML")
    camera = read_camera(saved(tmp_path, name, content), 640, 480)
    assert isinstance(camera, DistortedCamera)
    assert camera.camera == IDEAL
    expected = (*NUMBERS, 0.3, 0.02, 0.01)[:count]
    assert camera.distortion.coefficients[:count] == expected


def test_camera_info_of_a_rectified_topic_is_a_pinhole(tmp_path):
    pytest.importorskip("yaml", reason="needs PyYAML")
    plain = CALIBRATED.replace("[0.1, -0.2, 0.001, 0.002, 0.05]", "[0, 0, 0, 0, 0]")
    assert read_camera(saved(tmp_path, "c.yaml", plain), 640, 480) == IDEAL


def test_open3d_writes_what_is_read(tmp_path):
    o3d = pytest.importorskip("open3d", reason="needs Open3D")
    intrinsic = o3d.camera.PinholeCameraIntrinsic(640, 480, 385.0, 386.0, 321.5, 239.25)
    o3d.io.write_pinhole_camera_intrinsic(str(tmp_path / "o.json"), intrinsic)
    assert read_camera(tmp_path / "o.json", 640, 480) == IDEAL


def test_a_depth_map_is_undistorted_on_reading(tmp_path):
    small = REALSENSE | {"width": 64, "height": 48, "ppx": 32, "ppy": 24, "fx": 50, "fy": 50}
    bent = saved(tmp_path, "r.json", small | {"coeffs": [-0.28, 0.07, 0, 0, 0]})
    np.save(tmp_path / "d.npy", np.full((48, 64), 2.0, np.float32))
    cloud = read_cloud(tmp_path / "d.npy", read_intrinsics(bent))
    assert isinstance(cloud.camera, PinholeCamera)
    np.testing.assert_allclose(cloud.observed_points[:, 2], 2.0)
    straight = PointCloud.from_depth(np.full((48, 64), 2.0), read_camera(bent, 64, 48).camera)
    wide = [np.ptp(each.observed_points[:, 0]) for each in (cloud, straight)]
    assert abs(wide[0] - wide[1]) > 0.02


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("r.json", REALSENSE | {"ppx": "a"}, "found 'a' where a number should be"),
        ("r.json", REALSENSE | {"width": 640.5}, "width and height are not whole numbers"),
        ("r.json", REALSENSE | {"model": "ftheta", "coeffs": NUMBERS}, "model 'ftheta'.*not known"),
        ("r.json", REALSENSE | {"model": 7, "coeffs": NUMBERS}, "distortion model 7"),
        ("r.json", REALSENSE | {"model": [], "coeffs": NUMBERS}, "model is list"),
        ("r.json", {"fx": 1.0}, "has no 'fy'"),
        ("k.json", {"CalibrationInformation": {"Cameras": []}}, "none of its 0 cameras"),
        ("k.json", {"CalibrationInformation": 3}, "expected a 3 x 3 matrix"),
        ("c.yaml", "a: [", "cannot be read as a YAML camera"),
        ("c.yaml", "- 1", "found list; expected a 3 x 3 matrix"),
        ("c.yaml", "image_width: 3\nimage_height: 4", "has no 'camera_matrix'"),
        ("c.yaml", "a: &a [1, 1]\nb: [*a, *a]", "anchors"),
        ("c.yaml", "[" * 10_000, "YAML"),
        ("c.yaml", CALIBRATED.replace("plumb_bob", "equidistant"), "'equidistant'.*not known"),
        ("c.yaml", CALIBRATED + "binning_x: 2\n", "binned or cut out"),
        ("c.yaml", "k: " + "1" * 70_000, "too long"),
    ],
)
def test_cameras_that_are_none(tmp_path, name, content, message):
    if name.endswith("yaml"):
        pytest.importorskip("yaml", reason="needs PyYAML")
    with pytest.raises(InputError, match=message) as caught:
        read_camera(saved(tmp_path, name, content), 640, 480)
    assert str(caught.value).startswith(str(tmp_path))


def test_a_library_that_is_missing_is_named_with_its_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "yaml", None)
    with pytest.raises(InputError, match=r"needs yaml .*pip install 'hmrf-icp\[yaml\]'"):
        read_camera(saved(tmp_path, "c.yaml", CALIBRATED), 640, 480)
