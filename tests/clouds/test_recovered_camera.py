"""A pinhole camera is in the points of its organised cloud, wherever the cloud was moved."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from hmrf_icp import PinholeCamera, se3
from hmrf_icp.clouds.recovered_camera import FITS, recovered_camera
from hmrf_icp.kernels.range_image import project
from hmrf_icp.synthetic import render, scenes

CAMERA = PinholeCamera(width=120, height=90, fx=105.0, fy=110.0, cx=57.5, cy=46.0)
MOTION = se3.rigid(se3.rotation_exp(np.array([0.4, -1.1, 0.7])), np.array([3.0, -1.0, 2.0]))


@pytest.fixture(scope="module")
def points() -> NDArray[np.float64]:
    """A desk as the camera sees it, (90, 120, 3)."""
    pose = scenes.trajectory("desk", 60)[7]
    return CAMERA.unproject(render.render(scenes.desk(), CAMERA, pose))


def test_the_camera_of_a_depth_map_is_recovered_to_single_precision(
    points: NDArray[np.float64],
) -> None:
    found = recovered_camera(points.astype(np.float32))
    assert found is not None
    assert found.at_origin
    assert found.residual < 1e-3
    assert found.camera.fx == pytest.approx(CAMERA.fx, abs=1e-2)
    assert found.camera.fy == pytest.approx(CAMERA.fy, abs=1e-2)
    assert found.camera.cx == pytest.approx(CAMERA.cx, abs=1e-2)
    assert found.camera.cy == pytest.approx(CAMERA.cy, abs=1e-2)
    assert "pinhole 120 x 90" in found.text


def test_coordinates_in_millimetres_still_tell_it(points: NDArray[np.float64]) -> None:
    found = recovered_camera(np.round(points, 3))
    assert found is not None
    assert found.at_origin
    assert found.camera.fx == pytest.approx(CAMERA.fx, rel=1e-2)


def test_a_crop_has_the_same_focal_lengths_and_its_own_centre(
    points: NDArray[np.float64],
) -> None:
    found = recovered_camera(points[20:70, 30:100])
    assert found is not None
    assert found.camera.fx == pytest.approx(CAMERA.fx)
    assert found.camera.cx == pytest.approx(CAMERA.cx - 30)
    assert found.camera.cy == pytest.approx(CAMERA.cy - 20)


def test_every_third_pixel_has_a_third_of_the_focal_length(points: NDArray[np.float64]) -> None:
    found = recovered_camera(points[::3, ::3])
    assert found is not None
    assert found.camera.fx == pytest.approx(CAMERA.fx / 3)


@pytest.mark.parametrize("scale", [1.0, 1000.0])
def test_a_moved_cloud_tells_how_it_was_moved(points: NDArray[np.float64], scale: float) -> None:
    moved = scale * se3.transform(MOTION, points.reshape(-1, 3)).reshape(points.shape)
    found = recovered_camera(moved)
    assert found is not None
    assert not found.at_origin
    np.testing.assert_allclose(found.pose[:3, :3], MOTION[:3, :3], atol=1e-6)
    np.testing.assert_allclose(found.viewpoint, scale * MOTION[:3, 3], atol=1e-6 * scale)
    assert found.camera.fx == pytest.approx(CAMERA.fx, rel=1e-6)


def test_the_view_of_a_moved_cloud_projects_its_points_to_their_pixels(
    points: NDArray[np.float64],
) -> None:
    moved = se3.transform(MOTION, points.reshape(-1, 3)).reshape(points.shape)
    found = recovered_camera(moved)
    assert found is not None
    for row, column in ((10, 20), (45, 60), (80, 100)):
        assert np.isfinite(moved[row, column, 0])
        v, u, depth = project(found.projection, *moved[row, column])
        assert (v, u) == pytest.approx((row, column), abs=1e-6)
        assert depth == pytest.approx(points[row, column, 2])


@pytest.mark.parametrize("way", ["columns", "rows", "transposed", "upwards"])
def test_a_grid_in_another_order_is_put_right(points: NDArray[np.float64], way: str) -> None:
    """Whatever was done to grid or axes, camera and pose project every point to its pixel."""
    grid = {
        "columns": points[:, ::-1],
        "rows": points[::-1],
        "transposed": points.transpose(1, 0, 2),
        "upwards": points * [1.0, -1.0, -1.0],
    }[way]
    found = recovered_camera(grid)
    assert found is not None
    assert found.mirrored == (way != "upwards")
    upright = grid[:, ::-1] if found.mirrored else grid
    seen = se3.transform(se3.inverse(found.pose), upright.reshape(-1, 3)).reshape(grid.shape)
    u, v, depth = found.camera.project(seen)
    there = np.isfinite(depth)
    rows, columns = np.indices(depth.shape)
    np.testing.assert_allclose(u[there], columns[there], atol=1e-6)
    np.testing.assert_allclose(v[there], rows[there], atol=1e-6)


def test_a_few_spoilt_points_do_not_spoil_the_camera(points: NDArray[np.float64]) -> None:
    rng = np.random.default_rng(0)
    elsewhere = points + np.abs(rng.normal(size=points.shape))  # and still before the camera
    spoilt = np.where(rng.random((*points.shape[:2], 1)) < 0.03, elsewhere, points)
    found = recovered_camera(spoilt)
    assert found is not None
    assert found.camera.fx == pytest.approx(CAMERA.fx, rel=1e-6)


def test_coordinates_that_were_rounded_have_a_camera_as_far_as_rounding_allows(
    points: NDArray[np.float64],
) -> None:
    """To a centimetre a metre off, a third of a pixel: more than exact ones may be off."""
    found = recovered_camera(np.round(points, 2))
    assert found is not None
    assert found.residual > FITS
    assert found.camera.fx == pytest.approx(CAMERA.fx, rel=0.01)


def test_what_no_pinhole_saw_has_no_camera(points: NDArray[np.float64]) -> None:
    rng = np.random.default_rng(0)
    shuffled = rng.permutation(points.reshape(-1, 3)).reshape(points.shape)
    assert recovered_camera(shuffled) is None

    rows, columns = np.indices(points.shape[:2])
    heights = np.dstack([columns * 0.01, rows * 0.01, points[..., 2]])
    assert recovered_camera(heights) is None

    azimuth, elevation = columns * (2 * np.pi / 120), (rows - 45) * 0.01
    rays = np.dstack(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )
    assert recovered_camera(rays * points[..., 2:]) is None


def test_a_plane_that_faces_the_camera_is_no_evidence() -> None:
    flat = CAMERA.unproject(np.full((90, 120), 2.0))
    assert recovered_camera(flat) is None


@pytest.mark.parametrize("away", [0, 1, 3, 1000])
@pytest.mark.parametrize("axes", [(0, 1, 2), (2, 0, 1), (1, 2, 0)])
@pytest.mark.parametrize("shape", [(8, 8), (12, 20), (21, 15)])
@pytest.mark.filterwarnings("error")
def test_a_flat_grid_anywhere_has_no_camera_and_divides_by_nothing(
    shape: tuple[int, int], axes: tuple[int, int, int], away: float
) -> None:
    v, u = np.mgrid[: shape[0], : shape[1]].astype(float)
    flat = np.stack([u / 10 - shape[1] / 20, v / 10 - shape[0] / 20, np.ones(shape)], axis=-1)
    assert recovered_camera(flat[..., list(axes)] + away) is None
