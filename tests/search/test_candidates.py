"""Starts and where they lead: turns, shifts, and the quick registration of a few points."""

from __future__ import annotations

import numpy as np
import pytest

import shapes
from hmrf_icp import PointCloud, PreparedCloud, presets, se3
from hmrf_icp.search.candidates import Annealer, distinct, shifted, turned
from shapes import CAMERA
from views import frame, off, truth

PLAN = presets.ROBUST
MIDDLE = np.array([0.3, -0.2, 1.5])
START = se3.exp([0.4, -0.3, 0.2, 1.0, 2.0, -0.5])


def test_turns_keep_the_middle_where_it_is_and_the_start_comes_first():
    poses = turned(START, MIDDLE, PLAN.turn, PLAN.turn_step)
    np.testing.assert_allclose(poses[0], START, atol=1e-12)
    source = se3.transform(se3.inverse(START), MIDDLE)
    np.testing.assert_allclose([se3.transform(pose, source) for pose in poses], [MIDDLE] * 65)
    angles = [se3.rotation_angle(pose @ se3.inverse(START)) for pose in poses]
    assert max(angles) <= PLAN.turn + 1e-9
    assert (np.diff(angles) > -1e-9).all()


def test_no_turn_is_far_from_one_of_the_lattice():
    poses = turned(np.eye(4), np.zeros(3), PLAN.turn, PLAN.turn_step)
    for vector in np.random.default_rng(0).normal(size=(200, 3)):
        turn = se3.rotation_exp(vector / np.linalg.norm(vector) * 0.75 * PLAN.turn)
        apart = [se3.rotation_angle(se3.rigid(turn, 0.0) @ se3.inverse(pose)) for pose in poses]
        assert min(apart) < 0.62 * PLAN.turn_step


def test_shifts_go_each_way_along_each_axis():
    poses = shifted(START[None], 0.5)
    moves = poses[:, :3, 3] - START[:3, 3]
    np.testing.assert_allclose(np.sort(moves @ [1.0, 10.0, 100.0]), [-50, -5, -0.5, 0.5, 5, 50])
    np.testing.assert_array_equal(poses[:, :3, :3], [START[:3, :3]] * 6)


def test_of_poses_that_are_alike_only_the_best_is_a_candidate():
    near = START.copy()
    near[0, 3] += 0.01
    far = START.copy()
    far[0, 3] += 1.0
    poses = np.array([near, START, far, near])
    score = np.array([1.0, 3.0, 2.0, 4.0])
    assert list(distinct(poses, score, [], 0.03, 0.05)) == [3, 2]
    assert list(distinct(poses, score, [START], 0.03, 0.05)) == [2]


def annealer(source, target, level=PLAN.coarse):
    return Annealer(PreparedCloud(source), PreparedCloud(target), level)


def wall(x, y, depth=2.0, noise=1e-3, holes=None):
    """A wall with a smaller one before it at (x, y), shares of the view."""
    rng = np.random.default_rng(0)
    seen = np.full((CAMERA.height, CAMERA.width), depth)
    seen += noise * rng.standard_normal(seen.shape)
    return PointCloud.from_depth(seen, CAMERA, depth_scale=1.0)


@pytest.mark.parametrize(("degrees", "shift"), [(8.0, 0.1), (18.0, 0.0), (14.0, 0.2)])
def test_a_few_points_lead_most_starts_near_the_pose(degrees, shift):
    source, target, true = frame(8), frame(0), truth(8, 0)
    rng = np.random.default_rng(int(degrees))
    middle = se3.transform(true, source.observed_points).mean(axis=0)
    starts = []
    for axis, way in rng.normal(size=(16, 2, 3)):
        start = se3.rotation_about(axis, np.radians(degrees), middle) @ true
        start[:3, 3] += shift * way / np.linalg.norm(way)
        starts.append(start)
    ends = annealer(source, target)(np.array(starts))
    apart = np.array([off(end, true, source) for end in ends])
    assert (apart < 0.02).mean() >= 0.8


def test_a_start_is_registered_from_each_of_the_scales_down():
    close = annealer(frame(3), frame(0), PLAN.close)
    ends = close.from_each_scale(truth(3, 0))
    assert len(ends) == len(PLAN.close.scales)
    assert max(off(end, truth(3, 0), frame(3)) for end in ends) < 0.01


def test_backs_are_not_laid_on_fronts():
    """Two sides of a board of a hand's breadth: the source saw the other side of it."""
    board = wall(0, 0)
    behind = se3.rigid(se3.rotation_exp([0.0, np.pi, 0.0]), [0.0, 0.0, 4.06])
    ends = annealer(board, board)(behind[None])
    np.testing.assert_allclose(ends[0], behind, atol=1e-9)


@pytest.mark.parametrize("shape", [shapes.wall, shapes.cylinder])
def test_along_what_is_free_a_start_does_not_go_far(shape):
    """Exact surfaces hold nothing along themselves: rounding would say where to go."""
    rng = np.random.default_rng(0)
    source, target = (shapes.seen(shape, rng, 1e-4) for _ in range(2))
    starts = [
        se3.exp(np.repeat([0.05, 0.1], 3) * np.random.default_rng(k).standard_normal(6))
        for k in range(12)
    ]
    ends = annealer(source, target)(np.array(starts))
    went = [off(end, start, source) for end, start in zip(ends, starts, strict=True)]
    assert max(went) < 0.4


def test_what_only_the_target_has_does_not_pull():
    """Three walls of a corner, the source without what stands in it."""
    source, target, true = frame(12), frame(20), truth(12, 20)
    (end,) = annealer(source, target)(true[None])
    assert off(end, true, source) < 0.01
