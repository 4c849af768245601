"""Local features bring the pose of two clouds from nowhere, whatever their frames."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from hmrf_icp import se3
from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.kernels import consistency
from hmrf_icp.search.consistent_groups import Oriented, explained, motions
from hmrf_icp.search.feature_matches import match, nearest
from hmrf_icp.search.features import Grid, _histograms, thinned
from hmrf_icp.search.hypotheses import Hypotheses, hypotheses, placed, spread
from hmrf_icp.search.normal_signs import agreeing
from hmrf_icp.synthetic import render, scenes

FAR = se3.exp([2.0, -1.0, 0.5, 3.0, -2.0, 1.0])


@functools.cache
def desk(frame):
    camera = PinholeCamera(width=160, height=120, fx=146, fy=146, cx=79.5, cy=59.5)
    pose = scenes.trajectory("desk", 60)[frame]
    depth = render.render(scenes.desk(), camera, pose)
    return PreparedCloud(PointCloud.from_depth(depth, camera, depth_scale=1.0)).surface, pose


def found(scale=1.0, oriented=True, motion=FAR) -> tuple[Hypotheses, np.ndarray, float]:
    (mine, from_source), (theirs, from_target) = desk(4), desk(0)
    points = scale * se3.transform(motion, mine.points)
    normals = mine.normals @ motion[:3, :3].T
    truth = se3.inverse(from_target) @ from_source @ se3.inverse(motion)
    truth[:3, 3] *= scale
    out = hypotheses(points, normals, scale * theirs.points, theirs.normals, oriented, 50)
    return out, truth, scale * mine.size


def off(poses, truth):
    """Root mean square distance (K,) of poses from the truth over the source."""
    motion = np.einsum("ij,kjl->kil", se3.inverse(truth), poses)
    corners = np.concatenate([np.eye(3), -np.eye(3)])
    apart = placed(motion, corners) - corners.ravel()
    return np.sqrt((apart**2).sum(axis=1) / 6)


@pytest.mark.parametrize("oriented", [True, False])
def test_one_of_the_first_ten_is_right_from_any_frame(oriented):
    out, truth, size = found(oriented=oriented)
    corners, _ = spread(se3.transform(FAR, desk(4)[0].points))
    apart = placed(out.poses, corners) - placed(truth[None], corners)
    rmse = np.sqrt((apart**2).sum(axis=1) / len(corners))
    assert rmse[:10].min() < 0.1 * size


def test_scores_fall_and_the_same_clouds_give_the_same_poses():
    one, other = found()[0], found()[0]
    assert (np.diff(one.scores) <= 0.0).all()
    np.testing.assert_array_equal(one.poses, other.poses)


def test_a_scene_ten_times_as_large_has_the_same_right_pose():
    out, truth, size = found(scale=10.0)
    assert off(out.poses, truth).min() < 0.1 * size


def test_histograms_do_not_know_the_frame():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(300, 3))
    normals = rng.normal(size=(300, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    turned = se3.transform(FAR, points), normals @ FAR[:3, :3].T
    one = _histograms(points, normals, 0.2, 5.0)
    np.testing.assert_allclose(_histograms(*turned, 0.2, 5.0), one, atol=2e-4)
    votes = one.sum(axis=1)
    alone = votes == 0.0
    assert alone.mean() < 0.05
    np.testing.assert_allclose(votes[~alone], 3.0, atol=1e-4)


def test_thinning_keeps_one_point_a_cell_and_does_not_cancel_normals_without_a_sign():
    points = np.array([[0.1, 0.1, 0.1], [0.3, 0.1, 0.1], [5.1, 0.1, 0.1]])
    normals = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    where, facing = thinned(points, normals, 1.0)
    np.testing.assert_allclose(where, [[0.2, 0.1, 0.1], [5.1, 0.1, 0.1]])
    np.testing.assert_allclose(facing, [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


def test_neighbours_in_a_grid_are_those_within_reach():
    from hmrf_icp.kernels.features import within

    points = np.random.default_rng(1).uniform(size=(400, 3))
    grid = Grid.of(points, points, 0.2)
    buffer = np.empty(400, np.int64)
    for at in points[:20]:
        count = within(*grid.near[:2], grid.points, at, *grid.near[2:], buffer)
        assert count == np.count_nonzero(np.linalg.norm(points - at, axis=1) <= 0.2)


def test_nearest_features_are_those_of_all_distances():
    rng = np.random.default_rng(2)
    one, other = (rng.normal(size=(n, 8)).astype(np.float32) for n in (300, 500))
    apart = ((one[:, None] - other[None]) ** 2).sum(axis=2)
    there, _, back, _ = nearest(one, other, 2)
    np.testing.assert_array_equal(there, np.argsort(apart, axis=1)[:, :2])
    np.testing.assert_array_equal(back, np.argsort(apart, axis=0)[:2].T)


def test_a_mutual_match_comes_before_any_other():
    rng = np.random.default_rng(3)
    values = rng.normal(size=(50, 8)).astype(np.float32)
    pairs = match(values, values[::-1].copy(), 50)
    assert pairs.mutual.all()
    np.testing.assert_array_equal(pairs.source + pairs.target, 49)


def matched(right, wrong, seed=4):
    """Matches that are right at the pose FAR, and others at random."""
    rng = np.random.default_rng(seed)
    points, other = (rng.uniform(size=(right + wrong, 3)) for _ in range(2))
    normals, facing = (rng.normal(size=(right + wrong, 3)) for _ in range(2))
    for side in (normals, facing):
        side /= np.linalg.norm(side, axis=1)[:, None]
    other[:right] = points[:right]
    facing[:right] = normals[:right]
    target = Oriented(se3.transform(FAR, other), facing @ FAR[:3, :3].T)
    return Oriented(points, normals), target


def test_right_matches_are_compatible_unless_they_are_close():
    source, target = matched(100, 0)
    bits = consistency.compatible(
        source.points, source.normals, target.points, target.normals, 0.01, 0.1, 0.05
    )
    edges = sum(consistency.ones(word) for word in bits.ravel())
    apart = np.linalg.norm(source.points[:, None] - source.points[None], axis=2)
    assert edges == np.count_nonzero(apart > 0.1)


def test_a_group_of_twelve_is_found_among_a_thousand_wrong_matches():
    source, target = matched(12, 1000)
    poses, counts = motions(source, target, 0.01, 100)
    assert off(poses[np.argmax(counts)][None], FAR)[0] < 0.01
    assert explained(FAR[None], source, target, 0.01)[0] >= 12


@pytest.mark.parametrize("seed", range(3))
def test_the_match_that_most_speaks_for_is_right_where_distances_alone_would_not_tell(seed):
    """One seed, and a tolerance at which a tenth of the wrong pairs are as far apart by chance."""
    source, target = matched(12, 1000, seed)
    poses, _ = motions(source, target, 0.05, 1)
    assert off(poses, FAR).min() < 0.01


def test_two_groups_are_both_found():
    source, target = matched(30, 300)
    second = se3.exp([0.1, 2.0, 0.3, -1.0, 0.5, 2.0])
    target.points[30:45] = se3.transform(second, source.points[30:45])
    target.normals[30:45] = source.normals[30:45] @ second[:3, :3].T
    poses, _ = motions(source, target, 0.01, 100)
    assert off(poses, FAR).min() < 0.01
    assert off(poses, second).min() < 0.01


def test_no_match_makes_no_motion():
    source, target = matched(0, 40)
    poses, counts = motions(source, target, 1e-6, 100)
    assert poses.shape == (0, 4, 4)
    assert counts.shape == (0,)


def test_signs_on_a_sphere_all_face_its_middle():
    rng = np.random.default_rng(5)
    points = rng.normal(size=(2000, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    signs = rng.choice([-1.0, 1.0], size=(2000, 1))
    facing = (agreeing(points, signs * points, 0.1) * points).sum(axis=1)
    assert (facing < 0.0).all()
