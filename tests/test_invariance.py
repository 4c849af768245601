"""What may not change the answer, and what has to change with it."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hmrf_icp
import paper_reference as paper
import synthetic
from hmrf_icp import Criteria, presets, se3

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
