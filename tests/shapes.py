"""Depth maps of simple shapes with the noise of a depth camera, for the tests of metrics."""

from __future__ import annotations

import numpy as np

from hmrf_icp import PinholeCamera, PointCloud, PreparedCloud

CAMERA = PinholeCamera(80, 60, 73.0, 73.0, 39.5, 29.5)

WALL_NORMAL = np.array([0.3, 0.2, 1.0]) / np.linalg.norm([0.3, 0.2, 1.0])
SPHERE_CENTRE = np.array([0.0, 0.0, 1.5])


def wall(rays):
    return 2.0 / (rays @ WALL_NORMAL)


def corridor(rays):
    """Walls at x = +-1 and y = +-1.2, without an end, seen to 5 m."""
    with np.errstate(divide="ignore"):
        depth = np.minimum(1.0 / np.abs(rays[..., 0]), 1.2 / np.abs(rays[..., 1]))
    return np.where(depth < 5.0, depth, np.nan)


def corner(rays):
    normals = np.array([[0.8, 0.0, 0.6], [-0.8, 0.1, 0.6], [0.0, 0.9, 0.5]])
    towards = rays @ normals.T
    return np.where(towards > 0, 1.5 / np.maximum(towards, 1e-9), np.inf).min(axis=-1)


def sphere(rays):
    return ball(rays, rays)


def cylinder(rays):
    """Standing along y."""
    return ball(rays, rays * [1.0, 0.0, 1.0])


def ball(rays, across, radius=0.5):
    a, b = (across**2).sum(axis=-1), across @ SPHERE_CENTRE
    inside = b * b - a * (SPHERE_CENTRE @ SPHERE_CENTRE - radius**2)
    return np.where(inside > 0.02, (b - np.sqrt(np.maximum(inside, 0.0))) / a, np.nan)


def seen(shape, rng, noise=1e-3, camera=CAMERA):
    """A cloud of ``shape``, its depth off by ``noise`` times its square."""
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    rays = np.stack(
        [(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], axis=-1
    )
    depth = shape(rays)
    return PointCloud.from_depth(depth + noise * depth**2 * rng.normal(size=depth.shape), camera)


def both(source, target):
    """Two clouds, prepared for a part of the loop."""
    return PreparedCloud(source), PreparedCloud(target)
