"""A pose that explains what others do not is likelier than one that slides along a plane."""

import numpy as np
import pytest

from hmrf_icp.search.surprise import surprise


def test_the_pose_that_agrees_where_no_other_does_comes_first():
    agree = np.zeros((10, 100), dtype=bool)
    agree[:, :60] = True  # a plane, on which all agree
    agree[:, 60:64] = False
    agree[3, :30] = False  # one agrees with half of it
    agree[3, 60:90] = True  # and with what stands on it
    scores = surprise(agree, np.zeros_like(agree))
    assert scores.argmax() == 3


def test_what_stands_in_empty_space_counts_against_a_pose():
    rng = np.random.default_rng(0)
    agree = np.tile(rng.random(200) < 0.5, (2, 1))
    front = np.zeros_like(agree)
    front[0, np.flatnonzero(~agree[0])[:30]] = True
    scores = surprise(agree, front)
    assert scores[1] > scores[0] + 2.0


def test_poses_of_which_nothing_is_known_are_equal():
    nothing = np.zeros((4, 50), dtype=bool)
    scores = surprise(nothing, nothing)
    assert np.isfinite(scores).all()
    assert scores == pytest.approx(scores[0])
