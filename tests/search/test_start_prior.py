"""What a start says of a pose: the farther, the less likely, measured where the source is."""

from __future__ import annotations

import numpy as np
import pytest

from hmrf_icp import se3
from hmrf_icp.search.start_prior import FALL, FALL_ANYWHERE, StartPrior

START = se3.exp([0.2, -0.4, 0.1, 3.0, -1.0, 2.0])
CENTRE = np.array([40.0, -30.0, 10.0])
PRIOR = StartPrior(START, CENTRE, 2.0)


def away(degrees, shift):
    pose = se3.rotation_about([1.0, 2.0, -1.0], np.radians(degrees), CENTRE) @ START
    pose[:3, 3] += [0.0, 0.0, shift]
    return pose


def test_the_farther_from_the_start_the_less_likely():
    assert PRIOR(START) == pytest.approx(0.0, abs=1e-12)
    turns = [PRIOR(away(degrees, 0.0)) for degrees in (0.0, 5.0, 20.0, 60.0, 150.0)]
    shifts = [PRIOR(away(0.0, shift)) for shift in (0.0, 0.2, 1.0, 5.0)]
    for odds in (turns, shifts):
        assert odds == sorted(odds, reverse=True)
        assert odds[-1] < -4.0


def test_a_radian_counts_like_a_shift_by_the_size_wherever_the_origin_is():
    assert PRIOR(away(np.degrees(1.0), 0.0)) == pytest.approx(PRIOR(away(0.0, 2.0)), rel=1e-6)


def test_where_no_start_was_given_a_pose_far_from_it_loses_little():
    anywhere = StartPrior(START, CENTRE, 2.0, FALL_ANYWHERE)
    pose = away(90.0, 1.0)
    assert PRIOR(pose) < -5.0 < -1.0 < anywhere(pose) < 0.0
    assert FALL > FALL_ANYWHERE


@pytest.mark.parametrize("free", [[0, 0, 0, 0.6, 0.8, 0], [0, 0, 1.0, 30.0, 40.0, 0]])
def test_along_what_is_free_a_pose_goes_back_to_the_start(free):
    free = np.array([free], dtype=float)
    pose = se3.exp(0.7 * free[0]) @ START
    np.testing.assert_allclose(PRIOR.nearest(pose, free), START, atol=1e-6)
