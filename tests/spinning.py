"""Scans of a spinning LiDAR in places that know no length: a bare corridor and a tunnel."""

from __future__ import annotations

import numpy as np

from hmrf_icp import PointCloud, se3

AXIS = np.array([1.0, 0.0, 0.0])
FAR = 60.0


def corridor(rays):
    """2 m wide, the floor 1 m below the sensor and the ceiling 1.5 m above."""
    with np.errstate(divide="ignore"):
        height = np.where(rays[..., 2] > 0, 1.5, -1.0) / rays[..., 2]
        return np.minimum(1.0 / np.abs(rays[..., 1]), height)


def tunnel(rays, radius=2.0, above=0.3):
    """Round, its axis above the sensor."""
    a = rays[..., 1] ** 2 + rays[..., 2] ** 2
    b = above * rays[..., 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        return (b + np.sqrt(b * b + a * (radius**2 - above**2))) / a


def pose(degrees):
    """Rotation that takes the axes of a tilted sensor to those of the place."""
    return se3.rotation_exp(np.radians(degrees) * np.array([0.6, 0.7, 0.38]))


def scan(place, seed, beams, noise, tilt=0.0, organised=False, azimuths=900):
    """Rings of one turn, (beams, azimuths) or as a list of points, and the sensor's rotation."""
    elevation, azimuth = np.meshgrid(
        np.radians(np.linspace(-25, 25, beams)),
        np.linspace(-np.pi, np.pi, azimuths, endpoint=False),
        indexing="ij",
    )
    rays = np.stack(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ],
        axis=-1,
    )
    rotation = pose(tilt)
    reach = place(rays @ rotation.T)
    off = noise * np.random.default_rng(seed).normal(size=reach.shape)
    points = rays * np.where(reach < FAR, reach + off, np.nan)[..., None]
    if not organised:
        points = points[np.isfinite(points[..., 0])]
    return PointCloud(points, viewpoint=np.zeros(3)), rotation


def pair(place, beams, noise, tilts=(0.0, 0.0), organised=False):
    """Source, target, a true pose, and the axis of the place in the target's frame.

    The two stand at the same place, which nothing tells from any other along the axis.
    """
    source, turned = scan(place, 1, beams, noise, tilts[0], organised)
    target, onto = scan(place, 2, beams, noise, tilts[1], organised)
    return source, target, se3.rigid(onto.T @ turned, np.zeros(3)), onto.T @ AXIS
