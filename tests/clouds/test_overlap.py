"""Overlap: what has a counterpart, and what only is near one."""

from __future__ import annotations

import numpy as np

from hmrf_icp import PointCloud, PreparedCloud, se3
from hmrf_icp.clouds.overlap import overlap

STEP = 0.05


def lattice(first, last, step=STEP):
    line = np.arange(first, last + 0.1 * step, step)
    x, y = (grid.ravel() for grid in np.meshgrid(line, line))
    return np.column_stack([x, y, np.zeros(x.size)])


def prepared(points, viewpoint=None, noise=2e-4, seed=0):
    shaken = points + noise * np.random.default_rng(seed).standard_normal(points.shape)
    return PreparedCloud(PointCloud(shaken, viewpoint=viewpoint))


def shift(x=0.0, y=0.0, z=0.0):
    return se3.rigid(np.eye(3), [x, y, z])


def test_a_sheet_laid_half_over_another_overlaps_by_half():
    one, other = prepared(lattice(-1.0, 1.0)), prepared(lattice(-1.0, 1.0), seed=1)
    assert 0.5 < overlap(one, other, shift(x=0.975)) < 0.62


def test_the_back_of_a_wall_is_not_its_front():
    front = prepared(lattice(-1.0, 1.0), np.array([0.0, 0.0, -3.0]))
    back = prepared(lattice(-1.0, 1.0), np.array([0.0, 0.0, 3.0]), seed=1)
    nobody_knows = prepared(lattice(-1.0, 1.0), seed=1)
    assert overlap(front, front, np.eye(4)) > 0.99
    assert overlap(front, back, np.eye(4)) < 0.01
    assert overlap(front, nobody_knows, np.eye(4)) > 0.99
    assert overlap(nobody_knows, front, np.eye(4)) > 0.99


def test_sheets_that_cross_overlap_along_a_line():
    one, other = prepared(lattice(-1.0, 1.0)), prepared(lattice(-1.0, 1.0), seed=1)
    across = se3.rigid(se3.rotation_exp([0.5 * np.pi, 0.0, 0.0]), np.zeros(3))
    assert overlap(one, other, across) < 0.03


def stairs(step, seed):
    """Steps of a hand's breadth, up and along."""
    rng = np.random.default_rng(seed)
    count = int(8.0 / step**2)
    x, y = rng.uniform(-1.0, 1.0, (2, count))
    rise = rng.random(count) < 0.5
    level = np.floor(x / 0.2) * 0.2
    z = np.where(rise, level + rng.uniform(0.0, 0.2, count), level)
    return np.column_stack([np.where(rise, level, x), y, z])


def test_a_coarse_cloud_overlaps_what_a_fine_one_shows_of_the_same_stairs():
    fine, coarse = prepared(stairs(0.02, 0)), prepared(stairs(0.2, 1))
    assert overlap(fine, coarse, np.eye(4)) > 0.95


def test_a_thing_with_edges_overlaps_itself_seen_again():
    one, other = prepared(stairs(0.08, 0)), prepared(stairs(0.08, 1))
    assert overlap(one, other, np.eye(4)) > 0.96


def test_noise_wider_than_the_spacing_is_no_lack_of_overlap():
    one, other = (prepared(lattice(-0.5, 0.5, 0.01), noise=0.02, seed=k) for k in (0, 1))
    assert overlap(one, other, np.eye(4)) > 0.9


def test_a_pose_that_is_off_within_the_noise_is_no_lack_of_overlap():
    """Two deviations: what a sensor that reads a little long makes of the same wall."""
    one, other = (prepared(lattice(-1.0, 1.0, 0.02), noise=0.02, seed=k) for k in (0, 1))
    assert overlap(one, other, shift(z=0.04)) > 0.97
    assert overlap(one, other, shift(z=0.4)) < 0.01
