"""Depth maps of bent images lie on the surfaces that were seen."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmrf_icp import DistortedCamera, Distortion, InputError, PinholeCamera, PointCloud

KINECT = (6.0841, 4.3755, -5.5e-5, 6.5e-5, 0.23618, 6.4087, 6.4183, 1.2203)
WEBCAM = (-0.28, 0.07, 1e-3, -5e-4, 0.01)
MODELS = {
    "plumb_bob": Distortion("brown-conrady", WEBCAM),
    "four": Distortion("brown-conrady", WEBCAM[:4]),
    "pincushion": Distortion("brown-conrady", (0.26, -0.95, -0.0054, 0.0026, 1.16)),
    "rational": Distortion("brown-conrady", KINECT, 1.74),
    "modified": Distortion("modified brown-conrady", WEBCAM),
    "inverse": Distortion("inverse brown-conrady", (0.15, -0.1, 1e-3, 5e-4, 0.04)),
}
CAMERA = PinholeCamera(64, 48, 50.0, 51.0, 31.0, 24.5)


def opencv(x, y, k1, k2, p1, p2, k3=0.0, k4=0.0, k5=0.0, k6=0.0):
    """The formula of OpenCV's documentation."""
    r2 = x * x + y * y
    radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    return (
        x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
        y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
    )


@pytest.mark.parametrize("numbers", [WEBCAM, WEBCAM[:4], KINECT])
def test_distortion_is_that_of_opencv(numbers):
    ours = Distortion("brown-conrady", numbers).distort(0.3, -0.4)
    np.testing.assert_allclose(ours, opencv(0.3, -0.4, *numbers), rtol=1e-14)


def test_the_models_of_realsense_differ_as_it_says():
    x, y = 0.3, -0.4
    moved = opencv(x, y, WEBCAM[0], WEBCAM[1], 0.0, 0.0, WEBCAM[4])
    p1, p2, r2 = WEBCAM[2], WEBCAM[3], x * x + y * y
    tangential = (
        moved[0] + 2 * p1 * moved[0] * moved[1] + p2 * (r2 + 2 * moved[0] ** 2),
        moved[1] + 2 * p2 * moved[0] * moved[1] + p1 * (r2 + 2 * moved[1] ** 2),
    )
    np.testing.assert_allclose(MODELS["modified"].distort(x, y), tangential, rtol=1e-14)
    inverse = Distortion("inverse brown-conrady", WEBCAM)
    np.testing.assert_allclose(inverse.undistort(x, y), opencv(x, y, *WEBCAM), rtol=1e-14)


@pytest.mark.parametrize("lens", MODELS.values(), ids=MODELS)
def test_every_pixel_comes_back_to_within_a_millionth(lens):
    wide = DistortedCamera(PinholeCamera(640, 576, 504.0, 503.0, 321.0, 285.0), lens)
    columns, rows = np.meshgrid(np.arange(0.0, 640.0, 7.0), np.arange(0.0, 576.0, 7.0))
    back = wide.seen(*wide.ideal(columns, rows))
    np.testing.assert_allclose(back, (columns, rows), rtol=0, atol=1e-6)


@given(
    k=st.lists(st.floats(-2.0, 2.0), min_size=8, max_size=8),
    model=st.sampled_from(["brown-conrady", "modified brown-conrady", "inverse brown-conrady"]),
)
def test_any_lens_gives_a_ray_that_comes_back_or_none(k, model):
    numbers = k if model == "brown-conrady" else k[:5]
    camera = DistortedCamera(CAMERA, Distortion(model, tuple(numbers)))
    columns, rows = np.meshgrid(np.arange(64.0), np.arange(48.0))
    u, v = camera.ideal(columns, rows)
    back = np.array(camera.seen(u, v))
    seen = np.isfinite(back[0])
    if model != "inverse brown-conrady":  # whose rays turn back where the image is bent too far
        assert (seen == np.isfinite(u)).all()
        np.testing.assert_allclose(back[0][seen], columns[seen], rtol=0, atol=1e-6)


@pytest.mark.parametrize("lens", MODELS.values(), ids=MODELS)
def test_the_points_of_a_bent_depth_map_lie_on_its_surfaces(lens):
    """An oblique plane, and a wall before it on the right."""
    camera = DistortedCamera(CAMERA, lens)
    u, v = camera.ideal(*np.meshgrid(np.arange(64.0), np.arange(48.0)))
    x, y = (u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy
    floor = 2.0 / (1.0 + 0.3 * x + 0.5 * y)  # 0.3 X + 0.5 Y + Z = 2
    depth = np.where(x > 0.2, 0.8, floor)
    depth[10:14, 10:14] = np.nan
    cloud = PointCloud.from_depth(depth, camera)
    assert isinstance(cloud.camera, PinholeCamera)
    assert len(cloud) > 0.9 * np.isfinite(depth).sum()
    pixel, _, z = cloud.camera.project(cloud.points)
    assert np.nanmax(np.abs(pixel - np.arange(cloud.camera.width))) < 1e-9
    points = cloud.observed_points
    off_floor = np.abs(points @ [0.3, 0.5, 1.0] - 2.0)
    off_wall = np.abs(points[:, 2] - 0.8)
    off = np.minimum(off_floor, off_wall)
    # Beside an edge the nearest pixel is taken, half a pixel off and on the oblique plane.
    assert off.max() < 0.03
    assert np.quantile(off, 0.9) < 1e-3
    assert np.isnan(z).any()


def test_as_a_pinhole_the_same_map_would_bend_the_plane():
    lens = MODELS["plumb_bob"]
    u, v = DistortedCamera(CAMERA, lens).ideal(*np.meshgrid(np.arange(64.0), np.arange(48.0)))
    x, y = (u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy
    depth = 2.0 / (1.0 + 0.3 * x + 0.5 * y)
    bent = PointCloud.from_depth(depth, CAMERA).observed_points @ [0.3, 0.5, 1.0] - 2.0
    flat = PointCloud.from_depth(depth, DistortedCamera(CAMERA, lens))
    assert np.abs(flat.observed_points @ [0.3, 0.5, 1.0] - 2.0).max() < 1e-3
    assert np.abs(bent).max() > 0.02


@pytest.mark.parametrize(
    ("model", "numbers", "message"),
    [
        ("fisheye", (0.0,) * 4, "unknown model 'fisheye', expected one of brown-conrady"),
        ("brown-conrady", (1.0, 2.0, 3.0), "expected four, five or eight finite coefficients"),
        ("brown-conrady", (1.0, 2.0, 3.0, np.nan), "finite"),
        ("brown-conrady", (0.1,) * 12, "four, five or eight"),
        ("inverse brown-conrady", KINECT, "has five coefficients"),
    ],
)
def test_what_is_no_lens(model, numbers, message):
    with pytest.raises(InputError, match=message):
        Distortion(model, numbers)


def test_a_distorted_camera_is_no_camera_of_an_organised_cloud():
    with pytest.raises(InputError, match=r"make the cloud of its depth map with PointCloud\.from_"):
        PointCloud(np.ones((48, 64, 3)), DistortedCamera(CAMERA, MODELS["four"]))


def test_a_map_of_another_size_than_the_cameras():
    with pytest.raises(InputError, match="intrinsics are for 64 x 48 pixels, the depth map has"):
        PointCloud.from_depth(np.ones((24, 32)), DistortedCamera(CAMERA, MODELS["four"]))
