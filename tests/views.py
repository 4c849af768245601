"""Views of the rendered scenes for the tests: small, with noise, their poses known."""

from __future__ import annotations

import warnings
from functools import cache

import numpy as np

import hmrf_icp
from hmrf_icp import PinholeCamera, PointCloud, RegistrationWarning, se3
from hmrf_icp.synthetic import render, scenes

CAMERA = PinholeCamera(width=80, height=60, fx=73.0, fy=73.0, cx=39.5, cy=29.5)
FRAMES = 60


@cache
def poses(scene="desk"):
    return scenes.trajectory(scene, FRAMES)


@cache
def frame(index, scene="desk", noise=1e-3):
    """A view (60, 80) of a scene, its depth off by ``noise`` metres."""
    depth = render.render(scenes.SCENES[scene](), CAMERA, poses(scene)[index])
    depth = depth + noise * np.random.default_rng(index).standard_normal(depth.shape)
    return PointCloud.from_depth(depth, CAMERA, depth_scale=1.0)


def truth(source, target, scene="desk"):
    """The pose that takes one view onto another."""
    return se3.inverse(poses(scene)[target]) @ poses(scene)[source]


def off(pose, true, cloud):
    """Root mean square distance between where two poses put a cloud, metres."""
    points = cloud.observed_points
    gap = se3.transform(pose, points) - se3.transform(true, points)
    return float(np.sqrt((gap**2).sum(axis=1).mean()))


def turned(pose, cloud, axis, degrees, shift=(0.0, 0.0, 0.0)):
    """A pose turned about the middle of the cloud where it puts it, and shifted."""
    middle = se3.transform(pose, cloud.observed_points).mean(axis=0)
    start = se3.rotation_about(axis, np.radians(degrees), middle) @ pose
    start[:3, 3] += shift
    return start


def loose(points):
    """A list (N, 3) that is no depth map any more: one of its points is beside its ray."""
    points = np.array(points)
    points[0, 0] += 0.02 * points[0, 2]
    return points


def heard(*arguments, **options):
    """The result, and what was warned of."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        result = hmrf_icp.register(*arguments, **options)
    return result, " ".join(
        str(one.message) for one in said if issubclass(one.category, RegistrationWarning)
    )
