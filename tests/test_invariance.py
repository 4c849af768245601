"""What may not change the answer, and what has to change with it."""

from __future__ import annotations

import warnings
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hmrf_icp
import paper_reference as paper
import shapes
import synthetic
from hmrf_icp import Criteria, presets, se3
from hmrf_icp.synthetic import render, scenes

register = partial(hmrf_icp.register, preset="paper")
"""These are statements about the paper's method and its parts."""

SEED = st.integers(0, 1000)
REJECTOR = st.sampled_from(presets.rejector_names())
TWIST = st.lists(st.floats(-2, 2), min_size=6, max_size=6).map(np.array)

# The paper's threshold on a step's translation depends on where the origin is: a rotation about
# a far one has a long translation. So many iterations, and no threshold, compare like with like.
FIXED = Criteria(translation=0.0, rotation=0.0, max_iterations=6)

examples = settings(max_examples=15, deadline=None)


@given(SEED, TWIST, REJECTOR)
@examples
def test_moving_both_clouds_moves_the_result_with_them(seed, twist, rejector):
    source, target = synthetic.pair(seed)
    motion = se3.exp(twist)
    here = register(source, target, rejector=rejector, criteria=FIXED)
    there = register(
        se3.transform(motion, source),
        se3.transform(motion, target),
        rejector=rejector,
        criteria=FIXED,
    )
    expected = motion @ here.transformation @ se3.inverse(motion)
    np.testing.assert_allclose(there.transformation, expected, atol=1e-7)
    np.testing.assert_allclose(there.inlier_probability, here.inlier_probability, atol=1e-7)
    assert there.inlier_rmse == pytest.approx(here.inlier_rmse, abs=1e-7)


@given(SEED, TWIST, REJECTOR)
@examples
def test_a_source_that_was_moved_first_comes_out_the_same_with_the_start_that_undoes_it(
    seed, twist, rejector
):
    source, target = synthetic.pair(seed)
    motion = se3.exp(twist)
    here = register(source, target, rejector=rejector)
    moved = se3.transform(motion, source)
    there = register(moved, target, init=se3.inverse(motion), rejector=rejector)
    assert there.iterations == here.iterations
    np.testing.assert_allclose(there.transformation @ motion, here.transformation, atol=1e-7)


@given(SEED, st.floats(-3, 3), REJECTOR)
@examples
def test_scaling_everything_scales_the_translation_and_nothing_else(seed, exponent, rejector):
    source, target = synthetic.pair(seed)
    scale = 10.0**exponent
    small = register(source, target, rejector=rejector, criteria=Criteria(0.01, 0.001))
    large = register(
        scale * source,
        scale * target,
        rejector=rejector,
        criteria=Criteria(0.01 * scale, 0.001),
    )
    assert (large.converged, large.iterations) == (small.converged, small.iterations)
    assert large.em_iterations == small.em_iterations
    np.testing.assert_allclose(
        large.transformation[:3, :3], small.transformation[:3, :3], atol=1e-7
    )
    np.testing.assert_allclose(
        large.transformation[:3, 3] / scale, small.transformation[:3, 3], atol=1e-7
    )
    assert large.inlier_rmse / scale == pytest.approx(small.inlier_rmse, rel=1e-6)
    np.testing.assert_allclose(large.inlier_probability, small.inlier_probability, atol=1e-7)


@given(SEED, REJECTOR)
@examples
def test_identical_clouds_give_the_identity(seed, rejector):
    source, _ = synthetic.pair(seed)
    result = register(source, source, rejector=rejector)
    np.testing.assert_allclose(result.transformation, np.eye(4), atol=1e-9)
    assert result.converged
    assert result.iterations == 1
    assert result.inlier_rmse < 1e-12
    # Two Gaussians that are the same say nothing: a pixel between holes is left at one half.
    observed = ~np.isnan(source[..., 0])
    has_a_neighbour = paper.neighbour_sum(np.where(observed, 1.0, np.nan)) > 0
    assert (result.inlier_probability[observed & has_a_neighbour] > 0.5).all()
    assert (result.inlier_probability[observed] >= 0.5).all()


@given(SEED, REJECTOR)
@examples
def test_the_order_of_an_unorganised_target_does_not_matter(seed, rejector):
    source, target = synthetic.pair(seed)
    points = target[~np.isnan(target[..., 0])]
    shuffled = np.random.default_rng(seed).permutation(points)
    organised = register(source, target, rejector=rejector)
    ordered = register(source, points, rejector=rejector)
    anyhow = register(source, shuffled, rejector=rejector)
    np.testing.assert_array_equal(ordered.transformation, organised.transformation)
    np.testing.assert_allclose(anyhow.transformation, ordered.transformation, atol=1e-9)
    np.testing.assert_allclose(anyhow.inlier_probability, ordered.inlier_probability, atol=1e-9)


@given(SEED)
@examples
def test_a_source_seen_in_a_mirror_image_grid_has_the_same_field(seed):
    # The four neighbours are the same ones when the image is read from right to left or by columns.
    source, target = synthetic.pair(seed)
    plain = register(source, target)
    flipped = register(source[:, ::-1], target)
    transposed = register(source.transpose(1, 0, 2), target)
    np.testing.assert_allclose(flipped.transformation, plain.transformation, atol=1e-9)
    np.testing.assert_allclose(transposed.transformation, plain.transformation, atol=1e-9)
    np.testing.assert_allclose(
        flipped.inlier_probability[:, ::-1], plain.inlier_probability, atol=1e-9
    )
    np.testing.assert_allclose(transposed.inlier_probability.T, plain.inlier_probability, atol=1e-9)


def test_the_same_call_gives_the_same_answer_to_the_last_digit():
    source, target = synthetic.pair(3)
    once, twice = (register(source, target) for _ in range(2))
    np.testing.assert_array_equal(once.transformation, twice.transformation)
    np.testing.assert_array_equal(once.inlier_probability, twice.inlier_probability)


def test_the_input_is_not_changed():
    source, target = synthetic.pair(3)
    source_before, target_before, init = source.copy(), target.copy(), np.eye(4)
    register(source, target, init=init)
    np.testing.assert_array_equal(source, source_before)
    np.testing.assert_array_equal(target, target_before)
    np.testing.assert_array_equal(init, np.eye(4))


def test_single_precision_moves_the_result_by_less_than_it_measures():
    source, target = synthetic.pair(2)
    double = register(source, target)
    single = register(source, target, rejector=replace(presets.PAPER.reject, precision="single"))
    assert single.iterations == double.iterations
    np.testing.assert_allclose(single.transformation, double.transformation, atol=1e-4)


# The default ------------------------------------------------------------------------------------

CAMERA = hmrf_icp.PinholeCamera(width=80, height=60, fx=73.0, fy=73.0, cx=39.5, cy=29.5)


@cache
def view(index, seed=0):
    """Points (60, 80, 3) of the desk with a millimetre of noise, and the sensor's pose."""
    pose = scenes.trajectory("desk", 60)[index]
    depth = render.render(scenes.desk(), CAMERA, pose)
    depth = depth + 1e-3 * np.random.default_rng((index, seed)).standard_normal(depth.shape)
    return CAMERA.unproject(depth), pose


def by_default(source, target, stood=(0.0, 0.0, 0.0), init=None):
    clouds = [hmrf_icp.PointCloud(c, viewpoint=np.array(stood)) for c in (source, target)]
    return hmrf_icp.register(*clouds, init)


@pytest.mark.parametrize("unit", [1e-9, 1e-3, 1e3, 1e9])
def test_the_default_registers_in_any_unit(unit):
    source, target = view(3)[0], view(0)[0]
    here, there = by_default(source, target), by_default(unit * source, unit * target)
    back = there.transformation.copy()
    back[:3, 3] /= unit
    # A match that rounding decides may flip.
    np.testing.assert_allclose(back, here.transformation, atol=2e-4)
    assert there.believed
    assert there.converged
    assert there.overlap == pytest.approx(here.overlap, abs=0.01)
    assert there.inlier_rmse / unit == pytest.approx(here.inlier_rmse, rel=0.05)


@pytest.mark.parametrize("preset", ["robust", "paper"])
@pytest.mark.parametrize("offset", [(500.0, 4000.0, 100.0), (5e5, 4649776.0, 312.0)])
def test_map_coordinates_give_the_pose_of_local_ones(preset, offset):
    source, target = view(3)[0].round(4), view(0)[0].round(4)
    there = np.array(offset)
    local, far = (
        hmrf_icp.register(
            *(hmrf_icp.PointCloud(c + away, viewpoint=away) for c in (source, target)),
            preset=preset,
        )
        for away in (np.zeros(3), there)
    )
    moved, expected = (
        se3.transform(result.transformation, source.reshape(-1, 3)[::97] + away) - away
        for result, away in ((far, there), (local, np.zeros(3)))
    )
    # Nine digits before the decimal point leave seven behind it.
    np.testing.assert_allclose(moved, expected, atol=1e-6)
    assert (far.converged, far.iterations) == (local.converged, local.iterations)
    assert far.converged
    if preset == "robust":
        assert np.linalg.cond(far.information) < 1e4
        np.testing.assert_allclose(far.centre - there, local.centre, atol=1e-6)
        np.testing.assert_allclose(far.information, local.information, rtol=1e-3, atol=1.0)


def test_a_free_motion_is_told_in_the_frame_given():
    rng = np.random.default_rng(0)
    away = np.array([2e3, -1e3, 5e2])
    source, target = (shapes.seen(shapes.wall, rng, noise=2e-3).points + away for _ in range(2))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", hmrf_icp.RegistrationWarning)
        result = by_default(source, target, away)
    assert len(result.degenerate) == 3
    for free in result.degenerate:
        moves = np.cross(free.twist[:3], target[::7, ::7].reshape(-1, 3)) + free.twist[3:]
        # No farther than the wall reaches, and along it.
        assert np.linalg.norm(moves, axis=1).max() < 5.0
        assert np.abs(moves @ shapes.WALL_NORMAL).max() < 0.1


@given(st.integers(0, 1000), TWIST)
@settings(max_examples=4, deadline=None)
def test_where_both_clouds_stand_and_in_which_order_their_points_come_does_not_matter(seed, twist):
    rng, motion = np.random.default_rng(seed), se3.exp(twist)
    source, target = (view(i)[0].reshape(-1, 3) for i in (3, 0))
    here = by_default(source, target)
    moved = [se3.transform(motion, rng.permutation(c)) for c in (source, target)]
    there = by_default(*moved, stood=motion[:3, 3])
    back = se3.inverse(motion) @ there.transformation @ motion
    points = source[::50]
    gap = se3.transform(back, points) - se3.transform(here.transformation, points)
    # Not to the last digit: a thinned cloud is made of cells along the axes.
    assert np.linalg.norm(gap, axis=1).max() < 2e-3
    assert there.overlap == pytest.approx(here.overlap, abs=0.02)


@pytest.mark.parametrize(("one", "other"), [(3, 0), (10, 2), (20, 14)])
def test_the_other_way_round_gives_the_inverse_within_the_errors_told(one, other):
    clouds = [hmrf_icp.PointCloud.from_depth(view(i)[0][..., 2], CAMERA, 1.0) for i in (one, other)]
    forth, back = hmrf_icp.register(*clouds), hmrf_icp.register(*clouds[::-1])
    off = se3.inverse(back.transformation) @ se3.inverse(forth.transformation)
    there = se3.rigid(np.eye(3), forth.centre)
    twist = se3.log(se3.inverse(there) @ off @ there)
    # Both errors together are twice the variance, and six numbers of it are seldom above 3 each.
    assert twist @ forth.information @ twist < 2 * 6 * 3


@pytest.mark.parametrize("noise", [1e-3, 3e-3])
def test_the_errors_told_are_those_made(noise):
    errors = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        (_, first), (_, second) = view(3 + seed % 3), view(0)
        clouds = []
        for pose in (first, second):
            depth = render.render(scenes.desk(), CAMERA, pose)
            depth = depth + noise * rng.standard_normal(depth.shape)
            clouds.append(hmrf_icp.PointCloud.from_depth(depth, CAMERA, depth_scale=1.0))
        result = hmrf_icp.register(*clouds)
        off = se3.inverse(second) @ first @ se3.inverse(result.transformation)
        there = se3.rigid(np.eye(3), result.centre)
        twist = se3.log(se3.inverse(there) @ off @ there)
        errors.append(twist @ result.information @ twist)
    assert 3.0 < np.mean(errors) < 12.0
