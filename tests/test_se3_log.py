"""The logarithm of a motion is the twist that it is the exponential of."""

from __future__ import annotations

import numpy as np
import pytest

from hmrf_icp import se3


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-7, 2e-6, 1e-3, 1.0, 2.9, 3.1, np.pi - 1e-9])
def test_log_undoes_exp(angle):
    rng = np.random.default_rng(0)
    for _ in range(20):
        axis = rng.normal(size=3)
        twist = np.concatenate([angle * axis / np.linalg.norm(axis), rng.normal(0, 2, 3)])
        np.testing.assert_allclose(se3.log(se3.exp(twist)), twist, atol=1e-8)


def test_half_a_turn_has_one_of_two_axes():
    pose = se3.exp([0.0, 0.0, np.pi, 0.4, -0.1, 0.2])
    np.testing.assert_allclose(se3.exp(se3.log(pose)), pose, atol=1e-9)
