"""No length is built in: worlds of any size and unit, from nowhere, as points alone."""

from __future__ import annotations

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import PinholeCamera, se3
from hmrf_icp.synthetic import render, scenes
from hmrf_icp.synthetic.primitives import Box, Frustum, Rectangle, Sphere, Torus

CAMERA = PinholeCamera(width=160, height=120, fx=150.0, fy=150.0, cx=79.5, cy=59.5)


def at(x, y, z, *turn):
    return se3.rigid(se3.rotation_exp(turn or (0.0, 0.0, 0.0)), (x, y, z))


def world(*primitives):
    return scenes.Scene("world", primitives)


def beast():
    """A body with a neck, a head, a tail and four legs, about a tenth across."""
    limbs = [
        Frustum(at(0.03, side * 0.018, 0.0, 0.2 * side, 0.1, 0.0), 0.008, 0.011, 0.045)
        for side in (-1, 1)
    ]
    limbs += [
        Frustum(at(-0.025, side * 0.02, 0.0, 0.3 * side, -0.2, 0.0), 0.009, 0.013, 0.045)
        for side in (-1, 1)
    ]
    return world(
        *limbs,
        Sphere(at(-0.02, 0.0, 0.05), 0.026),
        Sphere(at(0.005, 0.003, 0.056), 0.022),
        Sphere(at(0.03, 0.0, 0.05), 0.02),
        Frustum(at(0.035, 0.0, 0.055, 0.0, 0.7, 0.1), 0.014, 0.009, 0.04),
        Sphere(at(0.066, 0.004, 0.088), 0.014),
        Box(at(0.08, 0.005, 0.086, 0.0, 0.2, 0.15), (0.024, 0.012, 0.009)),
        Frustum(at(-0.04, 0.0, 0.045, 0.3, -1.7, 0.0), 0.013, 0.004, 0.06),
        Torus(at(-0.012, 0.0, 0.075, 1.4, 0.2, 0.0), 0.014, 0.005),
    )


def street():
    """Sixty metres of a street: fronts that step back, cars, poles, a kiosk, a tree."""
    fronts = [
        Box(at(x, y, h / 2), (w, 8.0, h))
        for x, y, w, h in (
            (-22.0, 11.0, 14.0, 9.0),
            (-6.0, 12.5, 17.0, 14.0),
            (10.0, 10.5, 13.0, 7.0),
            (25.0, 12.0, 15.0, 11.0),
            (-18.0, -11.5, 20.0, 8.0),
            (2.0, -10.5, 16.0, 12.0),
            (21.0, -13.0, 19.0, 10.0),
        )
    ]
    cars = [
        Box(at(x, y, 0.75, 0.0, 0.0, yaw), (4.3, 1.8, 1.5))
        for x, y, yaw in (
            (-12.0, 4.6, 0.05),
            (-3.0, 4.7, -0.03),
            (9.0, -4.5, 0.2),
            (17.0, 4.4, 0.0),
        )
    ]
    poles = [
        Frustum(at(x, y, 0.0), 0.12, 0.1, 6.0) for x, y in ((-9.0, 6.2), (5.0, 6.1), (12.0, -6.0))
    ]
    return world(
        Rectangle(at(0.0, 0.0, 0.0), (90.0, 60.0)),
        *fronts,
        *cars,
        *poles,
        Box(at(-16.0, -5.5, 1.2, 0.0, 0.0, 0.4), (2.5, 2.0, 2.4)),
        Sphere(at(1.0, -5.8, 4.0), 1.6),
        Frustum(at(1.0, -5.8, 0.0), 0.2, 0.2, 3.0),
    )


def noisy(points, noise, seed):
    points = points.reshape(-1, 3)
    points = points[np.isfinite(points[:, 0])]
    return points + noise * np.random.default_rng(seed).standard_normal(points.shape)


def turntable():
    """Two scans of the beast, each as a list of points in the frame of its camera, one moved."""
    scans, poses = [], []
    for k, azimuth in enumerate((0.3, 0.95)):
        eye = np.array([0.3 * np.cos(azimuth), 0.3 * np.sin(azimuth), 0.14])
        pose = scenes.look_at(eye, (0.01, 0.0, 0.045))
        depth = render.render(beast(), CAMERA, pose)
        scans.append(noisy(CAMERA.unproject(depth), 1e-4, k))
        poses.append(pose)
    return *scans, se3.inverse(poses[1]) @ poses[0]


def room():
    """Two views of a desk in a room, from other places."""
    poses = scenes.trajectory("desk", 60)
    scans = [
        noisy(CAMERA.unproject(render.render(scenes.desk(), CAMERA, poses[k])), 2e-3, k)
        for k in (9, 0)
    ]
    return *scans, se3.inverse(poses[0]) @ poses[9]


def drive():
    """Two turns of a LiDAR, nine metres apart, the car turned between them."""
    poses = [at(-4.0, 0.5, 1.8, 0.0, 0.0, 0.1), at(5.0, -0.8, 1.8, 0.0, 0.0, -0.35)]
    beams = np.radians(np.linspace(15.0, -25.0, 32))
    scans = [
        noisy(render.render_lidar(street(), pose, beams, 600).points, 0.02, k)
        for k, pose in enumerate(poses)
    ]
    return *scans, se3.inverse(poses[1]) @ poses[0]


FAR = se3.exp([0.8, -1.1, 1.9, 0.4, -0.7, 1.2])

WORLDS = {
    # What is scanned, its unit in metres, and where the source's frame was moved to.
    "a beast without a unit": (turntable, 1 / 731.0, FAR),
    "a room in millimetres": (room, 1e-3, FAR),
    "a street in map coordinates": (
        drive,
        1.0,
        se3.rigid(se3.rotation_exp([0.01, -0.02, 0.6]), (463_000.0, 4_429_000.0, 1_640.0)),
    ),
}


@pytest.mark.parametrize("name", WORLDS)
def test_a_world_of_any_size_is_registered_from_nowhere(name):
    make, unit, moved = WORLDS[name]
    source, target, truth = make()
    size = float(np.linalg.norm(target - target.mean(axis=0), axis=1).mean())
    away = moved[:3, 3] if name.endswith("coordinates") else np.zeros(3)
    # Both in map coordinates, or only the source in a frame of its own.
    source, target = se3.transform(moved, source) / unit, (target + away) / unit
    result = hmrf_icp.register(source, target)
    expected = se3.transform(truth, se3.transform(se3.inverse(moved), source * unit)) + away
    off = np.linalg.norm(se3.transform(result.transformation, source) * unit - expected, axis=1)
    assert off.mean() < 0.01 * size
    assert result.believed
    # Lengths are told in the unit of the clouds.
    assert 0.0 < result.inlier_rmse * unit < 0.03 * size
