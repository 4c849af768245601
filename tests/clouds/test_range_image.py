"""A range image about a LiDAR's place, of points in no order."""

from __future__ import annotations

import numpy as np
import pytest

import spinning
from hmrf_icp import PointCloud, PreparedCloud, se3
from hmrf_icp.kernels.range_image import AGREE, BEHIND, FRONT, OUTSIDE
from shapes import CAMERA
from views import frame, truth


def facing(count, depth, seed=0):
    """A wall of so many points across the x axis, seen from the origin."""
    rng = np.random.default_rng(seed)
    return np.column_stack([np.full(count, depth), depth * rng.uniform(-0.5, 0.5, (count, 2))])


def told(view, *points):
    towards = -np.array(points) / np.linalg.norm(points, axis=1)[:, None]
    return view.ask(np.array(points), towards, np.eye(4)).tolist()


def test_a_ray_ends_at_the_nearest_point():
    both = np.concatenate([facing(3000, 2.0), facing(3000, 4.0, 1)])
    view = PreparedCloud(PointCloud(both, viewpoint=np.zeros(3))).range_image
    assert told(view, [1.0, 0.1, 0.1], [2.0, 0.1, 0.1], [3.0, 0.1, 0.1]) == [FRONT, AGREE, BEHIND]


@pytest.mark.parametrize("tilt", [0.0, 90.0])
def test_the_image_of_a_spinning_scanner_is_full_however_it_is_mounted(tilt):
    scan, _ = spinning.scan(spinning.tunnel, 0, 24, 2e-3, azimuths=400)
    points = scan.points @ spinning.pose(tilt).T
    view = PreparedCloud(PointCloud(points, viewpoint=np.zeros(3))).range_image
    assert (view.row >= 0).mean() > 0.4


def test_a_scan_has_no_seam():
    scan, _ = spinning.scan(spinning.corridor, 0, 24, 2e-3, azimuths=400)
    again, _ = spinning.scan(spinning.corridor, 1, 24, 2e-3, azimuths=400)
    view = PreparedCloud(PointCloud(scan.points, viewpoint=np.zeros(3))).range_image
    surface = PreparedCloud(again).surface
    codes = view.ask(surface.points, surface.normals, np.eye(4))
    rotation = view.projection[8:].reshape(3, 3)
    local = surface.points @ rotation.T
    azimuth = np.arctan2(local[:, 1], local[:, 0])
    seam = np.abs(np.abs(azimuth) - np.pi) < 2.0 * np.pi / view.row.shape[1]
    assert seam.sum() > 5
    assert (codes[seam] == OUTSIDE).mean() < 0.05
    assert (codes == AGREE).mean() > 0.85


def test_points_between_the_pixels_of_a_floor_that_recedes_agree():
    """Another sampling of the same surface agrees with it, grazing or not."""
    one, other = PreparedCloud(frame(2)), PreparedCloud(frame(0))
    surface = one.surface
    codes = other.range_image.ask(surface.points, surface.normals, truth(2, 0))
    asked = codes != OUTSIDE
    assert (codes[asked] == AGREE).mean() > 0.9
    assert (codes[asked] == FRONT).mean() < 0.005


def test_a_floor_seen_at_a_grazing_angle_agrees_with_itself_a_pixel_on():
    rows = np.arange(60)[:, None] - 29.5
    depth = 0.25 / ((rows + 45.0) / CAMERA.fy) * np.ones((1, 80))
    floor = PreparedCloud(PointCloud.from_depth(depth, CAMERA, depth_scale=1.0))
    surface = floor.surface
    on = se3.rigid(np.eye(3), [0.0, 0.0, 0.01])
    far = surface.points[:, 2] > 0.8
    codes = floor.range_image.ask(surface.points[far], surface.normals[far], on)
    assert (codes == AGREE).mean() > 0.8
    assert (codes == FRONT).mean() < 0.01
