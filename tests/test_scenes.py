"""The built-in scenes hold a registration in all six directions, at every overlap."""

from itertools import pairwise

import numpy as np
import pytest

from hmrf_icp import se3
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.errors import InputError
from hmrf_icp.evaluate.protocol import overlap, true_transformation
from hmrf_icp.synthetic.render import render, sensor_noise
from hmrf_icp.synthetic.scenes import CAMERA, SCENES, look_at, trajectory

SMALL = CAMERA.subsampled(8)


def clouds(name, n):
    """The walk's frames as the sensor sees them, every eighth pixel."""
    scene, rng = SCENES[name](), np.random.default_rng(0)
    return [
        PointCloud.from_depth(
            sensor_noise(render(scene, CAMERA, pose), CAMERA, rng), CAMERA
        ).subsample(8)
        for pose in trajectory(name, n)
    ]


@pytest.mark.parametrize(("name", "least"), [("desk", (0.0, 0.1)), ("tabletop", (0.2, 0.4))])
def test_a_walk_leads_from_full_overlap_down_without_a_gap(name, least):
    poses, seen = trajectory(name, 10), clouds(name, 10)
    shares = [
        overlap(cloud, seen[0], true_transformation(pose, poses[0]))
        for cloud, pose in zip(seen, poses, strict=True)
    ]
    assert shares[0] == 1.0
    assert least[0] <= min(shares) < least[1]
    assert -np.diff(np.sort(shares)[::-1]).min() < 0.3, shares


@pytest.mark.parametrize("name", sorted(SCENES))
def test_every_frame_constrains_all_six_degrees_of_freedom(name):
    for pose in trajectory(name, 5):
        depth = render(SCENES[name](), SMALL, pose)
        points = SMALL.unproject(depth)
        across, down = np.gradient(points, axis=1), np.gradient(points, axis=0)
        normals = np.cross(across, down)
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        flat = np.isfinite(normals).all(axis=-1) & (np.linalg.norm(across, axis=-1) < 0.2)
        p, n = points[flat] - np.nanmean(points[flat], axis=0), normals[flat]
        # The information of point-to-plane distances about a twist, arms in units of 1 m.
        jacobian = np.concatenate([np.cross(p, n), n], axis=1)
        assert np.linalg.eigvalsh(jacobian.T @ jacobian / len(p))[0] > 0.005


@pytest.mark.parametrize("name", sorted(SCENES))
def test_a_walk_is_smooth_rigid_and_the_same_however_densely_sampled(name):
    poses = trajectory(name, 101)
    for pose in poses:
        np.testing.assert_allclose(se3.as_rigid(pose), pose, atol=1e-12)
    steps = [se3.inverse(a) @ b for a, b in pairwise(poses)]
    assert max(map(se3.translation_norm, steps)) < 0.06
    assert max(map(se3.rotation_angle, steps)) < 0.06
    np.testing.assert_allclose(trajectory(name, 11), poses[::10], atol=1e-9)


def test_the_tabletop_is_seen_from_hand_distance():
    distance = [np.linalg.norm(pose[:3, 3] - (0, 0, 0.8)) for pose in trajectory("tabletop", 50)]
    assert min(distance) > 0.6
    assert max(distance) < 1.2


@pytest.mark.parametrize("name", sorted(SCENES))
def test_the_sensor_observes_most_of_a_frame(name):
    assert all(len(cloud) > 0.85 * cloud.observed.size for cloud in clouds(name, 3))
    assert SCENES[name]().name == name


def test_roll_turns_the_image_about_the_optical_axis():
    level, rolled = look_at((0, 0, 1), (1, 2, 1)), look_at((0, 0, 1), (1, 2, 1), roll=0.1)
    between = se3.inverse(level) @ rolled
    np.testing.assert_allclose(between, se3.rotation_about((0, 0, 1), 0.1, (0, 0, 0)), atol=1e-15)


def test_an_unknown_scene_lists_those_that_are_known():
    with pytest.raises(InputError, match=r"kitchen.*desk, tabletop"):
        trajectory("kitchen", 3)
    with pytest.raises(InputError, match="one pose or more, got 0"):
        trajectory("desk", 0)
