"""Rigid motions: the group, its exponential, and what is refused as one."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from hmrf_icp import se3
from hmrf_icp.errors import InputError

NUMBER = st.floats(-3, 3)
TWIST = st.lists(NUMBER, min_size=6, max_size=6).map(np.array)


def generator(twist):
    """The (4, 4) element of the Lie algebra."""
    matrix = np.zeros((4, 4))
    matrix[:3, :3] = se3.skew(twist[:3])
    matrix[:3, 3] = twist[3:]
    return matrix


@given(TWIST)
@settings(max_examples=100, deadline=None)
def test_exp_is_the_matrix_exponential(twist):
    np.testing.assert_allclose(se3.exp(twist), scipy.linalg.expm(generator(twist)), atol=1e-10)


@given(TWIST, st.floats(-9, -3))
@settings(max_examples=100, deadline=None)
def test_exp_stays_exact_for_small_twists(twist, exponent):
    small = twist * 10.0**exponent
    expected = np.eye(4) + generator(small) + generator(small) @ generator(small) / 2
    bound = 1e-15 + np.linalg.norm(small) ** 3
    np.testing.assert_allclose(se3.exp(small), expected, atol=bound, rtol=0)
    assert se3.rotation_angle(se3.exp(small)) == pytest.approx(
        np.linalg.norm(small[:3]), rel=1e-6, abs=1e-15
    )


@given(TWIST)
@settings(max_examples=50, deadline=None)
def test_inverse_undoes_a_motion(twist):
    motion = se3.exp(twist)
    np.testing.assert_allclose(se3.inverse(motion) @ motion, np.eye(4), atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-9, 1e-3, 1.0, 3.0, np.pi - 1e-7, np.pi])
def test_rotation_angle_keeps_its_digits_at_both_ends(angle):
    motion = se3.rotation_about([1.0, -2.0, 0.5], angle, [3.0, 1.0, 2.0])
    assert se3.rotation_angle(motion) == pytest.approx(angle, rel=1e-6, abs=1e-15)


def test_a_rotation_about_a_centre_leaves_the_centre():
    centre = np.array([0.4, -1.0, 2.0])
    motion = se3.rotation_about([0.0, 0.0, 2.0], 0.7, centre)
    np.testing.assert_allclose(se3.transform(motion, centre), centre, atol=1e-12)


def test_transform_keeps_the_grid_and_its_holes():
    points = np.ones((2, 3, 3))
    points[0, 1] = np.nan
    moved = se3.transform(se3.rigid(np.eye(3), [1.0, 0.0, 0.0]), points)
    assert moved.shape == (2, 3, 3)
    assert np.isnan(moved[0, 1]).all()
    np.testing.assert_array_equal(moved[1, 1], [2.0, 1.0, 1.0])


def test_error_is_the_papers():
    truth = se3.exp([0.1, 0.2, 0.3, 1.0, 2.0, 3.0])
    estimate = se3.rigid(truth[:3, :3] @ se3.rotation_exp([0.0, 0.05, 0.0]), [1.0, 2.0, 3.0])
    metres, radians = se3.error(estimate, truth)
    assert metres == pytest.approx(np.linalg.norm(truth[:3, 3] - [1.0, 2.0, 3.0]))
    assert radians == pytest.approx(0.05)
    assert se3.error(truth, truth) == (0.0, pytest.approx(0.0, abs=1e-15))


def test_a_pose_with_few_decimals_is_cleaned():
    pose = se3.exp([0.1, 0.2, 0.3, 1.0, 2.0, 3.0])
    cleaned = se3.as_rigid(pose.round(4))
    np.testing.assert_allclose(cleaned[:3, :3].T @ cleaned[:3, :3], np.eye(3), atol=1e-14)
    np.testing.assert_allclose(cleaned, pose, atol=1e-3)


@given(TWIST)
@settings(max_examples=100, deadline=None)
def test_three_decimals_are_enough_for_any_pose(twist):
    pose = se3.exp(twist)
    cleaned = se3.as_rigid(pose.round(3))
    np.testing.assert_allclose(cleaned[:3, :3].T @ cleaned[:3, :3], np.eye(3), atol=1e-14)
    np.testing.assert_allclose(cleaned, pose, atol=2e-3)


def test_a_scale_of_a_fifth_of_a_percent_is_refused_and_the_distance_said():
    scaled = np.diag([1.002, 1.002, 1.002, 1.0])
    with pytest.raises(InputError, match=r"off the identity by 0\.004, three decimals by 0\.002"):
        se3.as_rigid(scaled)


def test_no_pose_is_the_identity_and_the_argument_is_left_alone():
    np.testing.assert_array_equal(se3.as_rigid(None), np.eye(4))
    pose = np.eye(4)
    se3.as_rigid(pose)[0, 3] = 5.0
    np.testing.assert_array_equal(pose, np.eye(4))


SCALED = np.diag([2.0, 2.0, 2.0, 1.0])
SHEARED = np.eye(4)
SHEARED[0, 1] = 0.1
MIRRORED = np.diag([1.0, 1.0, -1.0, 1.0])
ROWS = se3.rigid(np.eye(3), [1.0, 2.0, 3.0]).T


@pytest.mark.parametrize(
    ("matrix", "says"),
    [
        (np.eye(3), r"start: expected a 4 x 4 matrix, got shape \(3, 3\)"),
        (np.zeros(16), r"shape \(16,\)"),
        (SCALED, "not a rotation.*scale"),
        (SHEARED, "not a rotation.*shear"),
        (MIRRORED, "reflection"),
        (ROWS, "transpose"),
        (np.full((4, 4), np.nan), "NaN"),
        (np.diag([1.0, 1.0, np.inf, 1.0]), "infinity"),
        (np.zeros((4, 4)), "last row"),
        ([[1, 2], [3]], "start: expected a 4 x 4 matrix of numbers"),
        ("identity", "start: expected a 4 x 4 matrix of numbers"),
    ],
)
def test_what_is_no_rigid_motion_is_refused(matrix, says):
    with pytest.raises(InputError, match=says):
        se3.as_rigid(matrix, "start")
