"""The surface that a cloud samples: where it ends, how it faces, how much of it there is."""

from __future__ import annotations

import numpy as np
import pytest

import spinning
from hmrf_icp import PointCloud, PreparedCloud
from hmrf_icp.clouds.surface import evenly
from shapes import CAMERA, WALL_NORMAL, seen, sphere, wall


def depth_map(depth):
    return PreparedCloud(PointCloud.from_depth(depth, CAMERA, depth_scale=1.0))


def test_what_stands_behind_a_jump_in_depth_is_no_neighbour():
    depth = np.full((CAMERA.height, CAMERA.width), 1.0)
    depth[:, 40:] = 2.0
    normals = depth_map(depth).surface.normals
    np.testing.assert_allclose(normals[:, 2], -1.0, atol=1e-6)


@pytest.mark.parametrize("organised", [True, False])
@pytest.mark.parametrize("shape", [sphere, wall])
def test_normals_face_the_sensor(shape, organised):
    cloud = seen(shape, np.random.default_rng(0), 1e-4)
    if not organised:
        cloud = PointCloud(cloud.observed_points, viewpoint=np.zeros(3))
    surface = PreparedCloud(cloud).surface
    assert surface.oriented
    towards = -(surface.points * surface.normals).sum(axis=1)
    known = surface.normals.any(axis=1)
    assert known.mean() > 0.95
    assert (towards[known] > 0.0).all()


def strips(*depths):
    """Walls side by side that all face the camera."""
    return np.repeat(np.array(depths), CAMERA.width // len(depths))[None].repeat(CAMERA.height, 0)


def test_noise_that_grows_with_the_square_of_the_depth_is_told_so():
    depth = strips(1.0, 1.4, 2.0, 2.8)
    rng = np.random.default_rng(0)
    surface = depth_map(depth + 2e-3 * depth**2 * rng.standard_normal(depth.shape)).surface
    for there in (1.0, 1.4, 2.0, 2.8):
        here = np.abs(surface.points[:, 2] - there) < 0.1
        assert np.median(surface.noise[here]) == pytest.approx(2e-3 * there**2, rel=0.4)


def test_a_wall_that_recedes_has_the_area_that_it_has():
    tilted = np.array([0.0, -0.5, np.sqrt(0.75)])
    surface = PreparedCloud(seen(lambda rays: 2.0 / (rays @ tilted), np.random.default_rng(0), 0.0))
    points, area = surface.points, surface.surface.area
    along = points @ np.array([0.0, np.sqrt(0.75), 0.5])
    middle = (np.abs(points[:, 0]) < 0.5) & (np.abs(along - along.mean()) < 0.5)
    assert area[middle].sum() == pytest.approx(1.0, rel=0.1)


def test_points_of_a_dense_part_stand_for_less_than_those_of_a_sparse_one():
    """One square metre with a point every 2 cm, and sixteen with one every 20, shuffled."""
    rng = np.random.default_rng(0)
    fine, coarse = (
        np.column_stack([rng.uniform(at, at + side, (count, 2)), np.zeros(count)])
        for at, side, count in ((0.0, 1.0, 2500), (2.0, 4.0, 400))
    )
    points = rng.permutation(np.concatenate([fine, coarse]))
    area = PreparedCloud(PointCloud(points)).surface.area
    dense = points[:, 0] < 1.5
    assert area[dense].sum() == pytest.approx(1.0, rel=0.2)
    assert area[~dense].sum() == pytest.approx(16.0, rel=0.2)


@pytest.mark.parametrize("organised", [True, False])
def test_the_rings_of_a_scanner_are_walls_and_floor(organised):
    scan, _ = spinning.scan(spinning.corridor, 0, 24, 2e-3, organised=organised, azimuths=600)
    surface = PreparedCloud(scan).surface
    x, y, z = np.abs(surface.points.T)
    # Away from where walls meet floor and ceiling, and near enough to have a next ring.
    wall = (np.abs(y - 1.0) < 0.05) & (surface.points[:, 2] > -0.6) & (z < 0.6) & (x < 3.0)
    faces = np.abs(surface.normals[wall, 1])
    assert wall.sum() > 100
    assert (faces > 0.95).mean() > 0.9


def test_an_image_of_few_pixels_has_neighbours_anyway():
    kept = np.random.default_rng(0).random((CAMERA.height, CAMERA.width)) < 0.1
    cloud = seen(wall, np.random.default_rng(1), 1e-4)
    few = PointCloud(np.where(kept[..., None], cloud.points, np.nan), viewpoint=np.zeros(3))
    normals = PreparedCloud(few).surface.normals
    assert (np.abs(normals @ WALL_NORMAL) > 0.99).mean() > 0.9


def test_points_on_a_line_have_no_normal():
    line = np.random.default_rng(0).uniform(size=(400, 1)) * [[1.0, 0.5, 0.2]]
    thin = PointCloud(line + 1e-6 * np.random.default_rng(1).standard_normal((400, 3)))
    assert not PreparedCloud(thin).surface.normals.any()


def test_normals_are_as_far_off_as_is_told():
    surface = PreparedCloud(seen(wall, np.random.default_rng(0), 2e-3)).surface
    inside = surface.normals.any(axis=1)
    off = np.linalg.norm(np.cross(surface.normals[inside], WALL_NORMAL), axis=1)
    expected = np.sqrt(2.0 * np.mean(surface.tilt[inside] ** 2))
    assert np.sqrt(np.mean(off**2)) == pytest.approx(expected, rel=0.4)


def test_the_near_and_the_far_are_asked_by_their_area():
    surface = depth_map(strips(1.0, 2.5)).surface
    near = surface.points[evenly(surface, 500), 2] < 2.0
    assert near.mean() == pytest.approx(1.0 / 7.25, abs=0.03)
