"""What surfaces leave free is found, left as it was, and said in words."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

import hmrf_icp
import shapes
from hmrf_icp import Criteria, FreeMotion, PointCloud, se3
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.loop.degeneracy import split, unit_twists
from hmrf_icp.loop.match import NearestNeighbour
from hmrf_icp.loop.placed import Placed
from hmrf_icp.loop.reject import Labels
from hmrf_icp.loop.surface_metrics import Pairing, PlaneToPlane, PointToPlane, Symmetric, extent
from shapes import both

METRICS = ("point-to-plane", "symmetric", "plane-to-plane")

START = se3.exp([0.01, -0.015, 0.012, 0.01, -0.012, 0.015])

# Shape, how many translations and how many rotations it leaves free.
FREE = [
    (shapes.wall, 2, 1),
    (shapes.corridor, 1, 0),
    (shapes.corner, 0, 0),
    (shapes.sphere, 0, 3),
    (shapes.cylinder, 1, 1),
]

registered = partial(hmrf_icp.register, rejector="all", criteria=Criteria(1e-5, 1e-5, 12))


def views(shape, seed=0, noise=1e-3):
    rng = np.random.default_rng(seed)
    return shapes.seen(shape, rng, noise), shapes.seen(shape, rng, noise)


@pytest.mark.parametrize("metric", METRICS)
@pytest.mark.parametrize(("shape", "translations", "rotations"), FREE)
def test_shapes_leave_free_what_slides_them_along_themselves(
    shape, translations, rotations, metric
):
    source, target = views(shape)
    result = registered(source, target, START, aligner=metric)
    turning = [motion.rotation for motion in result.degenerate]
    assert turning == [True] * rotations + [False] * translations
    assert result.converged
    for motion in result.degenerate:
        turn, shift = motion.twist[:3], motion.twist[3:]
        # The information is about the source's centroid, a free motion about the origin.
        twist = np.concatenate([turn, shift + np.cross(turn, result.centre)])
        largest = np.linalg.eigvalsh(result.information)[-1]
        assert twist @ result.information @ twist < 1e-9 * largest * (twist @ twist)
    # What is bound is found: the surfaces lie on each other.
    assert result.inlier_rmse < 0.03


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("shape", "translations", "rotations"), FREE)
def test_neither_the_noise_nor_its_seed_decides(shape, translations, rotations, seed):
    for noise in (0.0, 1e-4, 1.5e-3):
        result = registered(*views(shape, seed, noise), START, aligner="symmetric")
        assert len(result.degenerate) == translations + rotations


@pytest.mark.parametrize("metric", [PointToPlane, Symmetric, PlaneToPlane])
@pytest.mark.parametrize("shape", [shapes.wall, shapes.corridor, shapes.sphere, shapes.cylinder])
def test_a_step_has_nothing_of_what_is_free(shape, metric):
    source, target = views(shape)
    placed = Placed.at(START, source.observed_points)
    matches = NearestNeighbour().prepare(*both(source, target))(placed)
    one = np.ones(len(placed.points))
    step = metric().prepare(*both(source, target))(placed, matches, Labels(one))
    assert len(step.degenerate) > 0
    # In the coordinates of the solution: about the centre, a radian as long as the points are far.
    pairing = Pairing(PreparedCloud(source).surface, PreparedCloud(target).surface)
    m = pairing.matched(placed, matches.index, one)
    centre, length = extent(m.points, m.weight)
    units = np.array([length] * 3 + [1.0] * 3)
    about = se3.rigid(np.eye(3), -centre)
    went = units * se3.log(about @ step.motion @ se3.inverse(about))
    assert np.linalg.norm(went) > 0.002
    for twist in step.degenerate:
        here = np.concatenate([twist[:3], twist[3:] + np.cross(twist[:3], centre)]) * units
        assert abs(went @ here) < 1e-9 * np.linalg.norm(went) * np.linalg.norm(here)


@pytest.mark.parametrize("metric", METRICS)
def test_a_wall_is_not_slid_along(metric):
    # Started 3 cm along the wall and turned about its normal: there it stays, and lies on it.
    source, target = views(shapes.wall)
    normal = shapes.WALL_NORMAL
    along = np.cross(normal, [0.0, 1.0, 0.0])
    along *= 0.03 / np.linalg.norm(along)
    off = se3.rigid(se3.rotation_exp(0.03 * normal), along)
    result = registered(source, target, off, aligner=metric)
    went = result.transformation @ se3.inverse(off)
    assert se3.translation_norm(went) < 0.001
    assert se3.rotation_angle(went) < 0.001
    tilted = registered(source, target, off @ START, aligner=metric)
    left = normal @ tilted.transformation[:3, :3] @ normal
    assert np.arccos(min(left, 1.0)) < 0.002


def test_the_free_motions_of_a_wall_are_its_own():
    result = registered(*views(shapes.wall), START, aligner="point-to-plane")
    turn, *shifts = result.degenerate
    assert abs(turn.direction @ shapes.WALL_NORMAL) > 0.999
    assert str(turn).startswith("rotation about")
    for shift in shifts:
        assert abs(shift.direction @ shapes.WALL_NORMAL) < 0.05
        assert shift.point is None
        assert str(shift).startswith("translation along")
    assert "translation along" in repr(result)


def test_a_cylinder_is_free_along_and_about_its_axis():
    result = registered(*views(shapes.cylinder), START, aligner="symmetric")
    turn, shift = result.degenerate
    assert abs(turn.direction[1]) > 0.999
    assert abs(shift.direction[1]) > 0.999
    np.testing.assert_allclose(turn.point[[0, 2]], shapes.SPHERE_CENTRE[[0, 2]], atol=0.02)


def test_a_sphere_turns_about_its_centre():
    result = registered(*views(shapes.sphere), START, aligner="symmetric")
    for motion in result.degenerate:
        # The centre stays where it is.
        moved = np.cross(motion.twist[:3], shapes.SPHERE_CENTRE) + motion.twist[3:]
        assert np.linalg.norm(moved) < 0.03


@pytest.mark.parametrize("shape", [shapes.wall, shapes.corridor, shapes.corner])
def test_the_unit_of_length_does_not_matter(shape):
    source, target = (PointCloud(cloud.points) for cloud in views(shape))
    small = registered(source, target, START, aligner="plane-to-plane")
    for scale in (1e-3, 10.0):
        init = START.copy()
        init[:3, 3] *= scale
        criteria = Criteria(scale * 1e-5, 1e-5, 12)
        large = registered(
            PointCloud(scale * source.points),
            PointCloud(scale * target.points),
            init,
            aligner="plane-to-plane",
            criteria=criteria,
        )
        assert len(large.degenerate) == len(small.degenerate)
        assert [m.rotation for m in large.degenerate] == [m.rotation for m in small.degenerate]
        np.testing.assert_allclose(
            large.transformation[:3, :3], small.transformation[:3, :3], atol=1e-6
        )
        np.testing.assert_allclose(
            large.transformation[:3, 3] / scale, small.transformation[:3, 3], atol=1e-6
        )


def test_point_to_point_does_not_look():
    source, target = views(shapes.wall)
    result = registered(source, target, START, aligner="point-to-point")
    assert result.degenerate == ()
    assert result.information is None


def test_a_direction_is_bound_where_the_signal_is_above_the_noise():
    information = np.diag([100.0, 100.0, 100.0, 50.0, 50.0, 10.0])
    assert split(information, 0.01 * np.eye(6)).free.shape == (6, 0)
    free, bound, weakest = split(information, 4.0 * np.eye(6))
    assert weakest == pytest.approx(10.0 / (3.0 * 4.0 + 0.1))
    np.testing.assert_allclose(np.abs(free[:, 0]), np.eye(6)[5], atol=1e-12)
    assert bound.shape == (6, 5)
    np.testing.assert_allclose(bound.T @ free, 0.0, atol=1e-12)
    assert split(information, 200.0 * np.eye(6)).bound.shape == (6, 0)
    assert split(np.zeros((6, 6)), np.zeros((6, 6))).bound.shape == (6, 0)


def test_noise_along_one_direction_frees_that_one():
    # The weakest direction is clean and the strongest is all noise.
    free = split(np.diag([9.0, 1, 1, 1, 1, 0.1]), np.diag([9.0, 0, 0, 0, 0, 0])).free
    np.testing.assert_allclose(np.abs(free[:, 0]), np.eye(6)[0], atol=1e-12)


def test_twists_are_given_about_the_origin():
    free = np.zeros((6, 2))
    free[2, 0] = free[5, 1] = 1.0
    turn, shift = unit_twists(free, 0.5, np.array([1.0, 2.0, 3.0]))
    motion = FreeMotion(turn)
    np.testing.assert_allclose(np.abs(motion.direction), [0, 0, 1])
    np.testing.assert_allclose(motion.point, [1, 2, 0], atol=1e-12)
    np.testing.assert_allclose(
        se3.transform(se3.exp(turn), np.array([1.0, 2.0, 7.0])), [1, 2, 7], atol=1e-12
    )
    assert not FreeMotion(shift).rotation
    np.testing.assert_allclose(np.abs(shift), [0, 0, 0, 0, 0, 1])
