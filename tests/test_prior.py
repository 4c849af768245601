"""The start is evidence: of poses that the clouds cannot tell apart, the nearest is found."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hmrf_icp
import shapes
from hmrf_icp import se3
from hmrf_icp.search.start_prior import StartPrior

CENTRE = np.array([0.3, -0.2, 2.0])
HERE = StartPrior(np.eye(4), CENTRE, 1.5)


def turned(angle):
    return se3.rotation_about(np.array([0.2, 1.0, -0.3]), angle, CENTRE)


def shifted(metres):
    return se3.rigid(np.eye(3), metres * np.array([0.6, 0.0, 0.8]))


def test_nothing_is_likelier_than_the_start():
    assert HERE(np.eye(4)) == 0.0


@given(near=st.floats(0.001, 1.5), more=st.floats(0.001, 1.5))
def test_the_farther_from_the_start_the_less_likely(near, more):
    assert HERE(turned(near + more)) < HERE(turned(near)) < 0.0
    assert HERE(shifted(near + more)) < HERE(shifted(near)) < 0.0


def test_a_shift_by_the_size_counts_like_a_turn_by_a_radian():
    assert HERE(shifted(1.5)) == pytest.approx(HERE(turned(1.0)))


@given(scale=st.floats(1e-3, 1e3), angle=st.floats(0.0, 3.0), metres=st.floats(0.0, 5.0))
def test_a_scene_of_another_size_is_judged_in_the_same_way(scale, angle, metres):
    pose = shifted(metres) @ turned(angle)
    scaled = pose.copy()
    scaled[:3, 3] *= scale
    there = StartPrior(np.eye(4), scale * CENTRE, scale * 1.5)
    assert there(scaled) == pytest.approx(HERE(pose), rel=1e-6, abs=1e-9)


FREE = np.array(
    [
        [0.0, 0.0, 1.0, 0.4, -0.1, 0.0],  # about an upright axis
        [0.0, 0.0, 0.0, 0.6, 0.0, 0.8],  # along a wall
    ]
)


@given(
    angle=st.floats(-0.8, 0.8),
    metres=st.floats(-1.0, 1.0),
    x=st.floats(-1.0, 1.0),
    y=st.floats(-1.0, 1.0),
)
def test_of_the_poses_along_free_motions_the_nearest_to_the_start_is_found(angle, metres, x, y):
    pose = shifted(metres) @ turned(angle)
    nearest = HERE.nearest(pose, FREE)
    assert HERE(nearest) >= HERE(pose) - 1e-9
    assert HERE(nearest) >= HERE(se3.exp(0.3 * np.array([x, y]) @ FREE) @ nearest) - 1e-4
    np.testing.assert_allclose(HERE.nearest(nearest, FREE), nearest, atol=1e-3)


def test_where_everything_is_free_the_nearest_pose_is_the_start():
    np.testing.assert_allclose(
        HERE.nearest(shifted(0.7) @ turned(0.5), np.eye(6)), np.eye(4), atol=1e-6
    )


def facade(rays):
    """A wall in waves of 50 cm that goes on to both sides, above a floor."""
    wall = np.full(rays.shape[:2], 2.0)
    for _ in range(100):
        wall = 2.0 + 0.1 * np.cos(4.0 * np.pi * rays[..., 0] * wall)
    with np.errstate(divide="ignore"):
        floor = np.where(rays[..., 1] > 0.0, 0.5 / rays[..., 1], np.inf)
    return np.minimum(wall, floor)


@pytest.mark.parametrize(("start", "nearest"), [(0.1, 0.0), (0.4, 0.5), (-0.4, -0.5)])
def test_of_the_places_where_a_facade_repeats_the_one_by_the_start_is_found(start, nearest):
    one, other = (shapes.seen(facade, np.random.default_rng(seed)) for seed in (0, 1))
    init = se3.rigid(se3.rotation_exp([0.02, 0.03, -0.02]), [start, 0.0, 0.0])
    found = hmrf_icp.register(one, other, init).transformation
    metres, radians = se3.error(found, se3.rigid(np.eye(3), [nearest, 0.0, 0.0]))
    assert metres < 0.01
    assert radians < 0.01
