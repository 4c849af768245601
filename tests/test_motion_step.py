"""The motion step: the best rigid motion between matched points, and never a reflection."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import paper_reference as paper
from hmrf_icp import se3
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.loop.align import PointToPoint, best_motion
from hmrf_icp.loop.match import Matches
from hmrf_icp.loop.placed import Placed
from hmrf_icp.loop.reject import Labels

SEEDS = st.integers(0, 2**32 - 1)


def random_motion(rng, largest_angle=np.pi, size=3.0):
    axis = rng.normal(size=3)
    turn = se3.rotation_about(axis, rng.uniform(-largest_angle, largest_angle), np.zeros(3))
    return se3.rigid(turn[:3, :3], rng.normal(0, size, 3))


def is_proper(motion):
    rotation = motion[:3, :3]
    return (
        np.abs(rotation.T @ rotation - np.eye(3)).max() < 1e-12
        and abs(np.linalg.det(rotation) - 1) < 1e-12
        and np.array_equal(motion[3], [0, 0, 0, 1])
        and np.isfinite(motion).all()
    )


def cost(motion, points, onto):
    return ((se3.transform(motion, points) - onto) ** 2).sum()


@given(SEEDS)
@settings(max_examples=100, deadline=None)
def test_a_random_motion_of_se3_is_found_again(seed):
    rng = np.random.default_rng(seed)
    truth = random_motion(rng)
    points = rng.normal(size=(rng.integers(4, 40), 3)) + rng.normal(0, 2, 3)
    found = best_motion(points, se3.transform(truth, points))
    assert is_proper(found)
    np.testing.assert_allclose(found, truth, atol=1e-9)


@given(SEEDS)
@settings(max_examples=50, deadline=None)
def test_with_noise_it_is_the_least_squares_motion(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(30, 3))
    onto = se3.transform(random_motion(rng), points) + rng.normal(0, 0.1, points.shape)
    found = best_motion(points, onto)
    np.testing.assert_allclose(found, paper.best_motion(points, onto), atol=1e-9)
    for twist in np.vstack([np.eye(6), -np.eye(6)]) * 1e-3:
        assert cost(se3.exp(twist) @ found, points, onto) > cost(found, points, onto)


@given(SEEDS, st.sampled_from(["plane", "mirrored", "mirrored plane", "unrelated", "thin"]))
@settings(max_examples=100, deadline=None)
def test_it_is_never_a_reflection(seed, kind):
    # Where a mirror image would fit best, the plain singular value decomposition returns it.
    rng = np.random.default_rng(seed)
    truth = random_motion(rng)
    points = rng.normal(size=(12, 3))
    if "plane" in kind:
        points[:, 2] = 0
    if kind == "thin":
        points[:, 2] *= 1e-9
    onto = se3.transform(truth, points)
    if "mirrored" in kind:
        onto = onto * [1, 1, -1]
    if kind == "unrelated":
        onto = rng.normal(size=points.shape)
    if kind == "thin":
        onto = onto + rng.normal(0, 1e-8, onto.shape)
    found = best_motion(points, onto)
    assert is_proper(found)
    if kind == "plane":
        np.testing.assert_allclose(found, truth, atol=1e-9)
    for _ in range(20):
        centre, centre_onto = points.mean(axis=0), onto.mean(axis=0)
        other = random_motion(rng)[:3, :3]
        rival = se3.rigid(other, centre_onto - other @ centre)
        assert cost(found, points, onto) <= cost(rival, points, onto) + 1e-9


@pytest.mark.parametrize("seed", range(5))
def test_points_on_a_line_are_not_spun_about_it(seed):
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=3)
    points = rng.normal(size=(20, 1)) * direction + rng.normal(size=3)
    still = best_motion(points, points)
    assert is_proper(still)
    assert se3.rotation_angle(still) < 1e-3
    # Turned about an axis across the line, the angle of the motion is that and no more.
    across = np.cross(direction, [1.0, 0.0, 0.0])
    truth = se3.rotation_about(across, 0.2, rng.normal(size=3))
    onto = se3.transform(truth, points)
    found = best_motion(points, onto)
    np.testing.assert_allclose(se3.transform(found, points), onto, atol=1e-9)
    assert se3.rotation_angle(found) == pytest.approx(0.2, abs=1e-3)


def test_points_that_are_all_the_same_are_shifted_and_not_turned():
    points = np.tile([1.0, 2.0, 3.0], (10, 1))
    shift = np.array([0.1, 0.0, -0.2])
    found = best_motion(points, points + shift)
    np.testing.assert_allclose(found, se3.rigid(np.eye(3), shift), atol=1e-12)


def test_half_a_turn_is_found():
    rng = np.random.default_rng(1)
    points = rng.normal(size=(10, 3))
    truth = se3.rotation_about([1.0, 2.0, -1.0], np.pi, [0.3, 0.2, 0.1])
    found = best_motion(points, se3.transform(truth, points))
    np.testing.assert_allclose(found, truth, atol=1e-9)


def test_only_inliers_count_and_two_are_too_few():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(20, 3))
    truth = random_motion(rng)
    target = se3.transform(truth, points)
    target[10:] += 5.0
    align = PointToPoint().prepare(
        PreparedCloud(PointCloud(points)), PreparedCloud(PointCloud(target))
    )
    matches = Matches(np.arange(20), np.zeros(20))
    z = np.where(np.arange(20) < 10, 0.3, -0.3)
    np.testing.assert_allclose(
        align(Placed(points, np.eye(4)), matches, Labels(z)).motion, truth, atol=1e-9
    )
    two = np.where(np.arange(20) < 2, 1.0, -1.0)
    assert align(Placed(points, np.eye(4)), matches, Labels(two)) is None
