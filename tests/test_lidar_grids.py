"""Scans of a spinning LiDAR as grids: rings are far apart, and none is to spare."""

from __future__ import annotations

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import PointCloud, prepare, se3
from hmrf_icp.synthetic import render
from test_scale_free import at, street

NOISE = 0.01


def scan(pose, beams, shots, seed):
    elevations = np.radians(np.linspace(15.0, -25.0, beams))
    points = render.render_lidar(street(), pose, elevations, shots).points
    reach = np.linalg.norm(points, axis=-1, keepdims=True)
    off = NOISE * np.random.default_rng(seed).standard_normal(reach.shape)
    return PointCloud(points * (1.0 + off / reach), viewpoint=np.zeros(3))


@pytest.mark.parametrize(("beams", "shots"), [(16, 1800), (64, 512)])
def test_a_grid_of_few_rings_is_registered_as_well_as_its_points(beams, shots):
    poses = at(-4.0, 0.5, 1.8, 0.0, 0.0, 0.1), at(1.0, 0.3, 1.8, 0.0, 0.0, 0.05)
    source, target = (scan(pose, beams, shots, k) for k, pose in enumerate(poses))
    result = hmrf_icp.register(source, target, np.eye(4))
    metres, radians = se3.error(result.transformation, se3.inverse(poses[1]) @ poses[0])
    assert metres < 0.5 * NOISE
    assert radians < 3e-4
    assert result.confidence > 0.9


def test_thinning_keeps_the_rings_and_leaves_out_points_along_them():
    few = prepare(scan(at(0.0, 0.0, 1.8), 16, 1800, 0)).downsampled(10_000)
    assert few.cloud.shape[0] == 16
    assert 6000 < len(few) <= 10_000


def test_every_point_of_a_thinned_grid_stands_for_those_of_its_own_ring():
    whole = prepare(scan(at(0.0, 0.0, 1.8), 16, 1800, 0))
    few = whole.downsampled(10_000)
    ring = [np.nonzero(cloud.cloud.observed)[0] for cloud in (whole, few)]
    told = ring[1][whole.representatives(10_000)]
    assert np.mean(told == ring[0]) > 0.99
