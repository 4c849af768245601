"""beta: schedules, and the estimate found again in samples of a field of known beta."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmrf_icp.errors import InputError
from hmrf_icp.field.beta import LARGEST, BetaPrior, Schedule, most_likely, pseudo_likelihood
from hmrf_icp.field.graph import PixelGrid


def gibbs_sample(beta, log_odds, height, width, rng, sweeps=120):
    """Labels (H * W,) drawn from the Gibbs distribution, one colour of a checkerboard at a time."""
    z = rng.choice([-1.0, 1.0], (height, width))
    colour = np.indices((height, width)).sum(axis=0) % 2
    for _ in range(sweeps):
        for c in (0, 1):
            around = np.pad(z, 1)
            sums = around[:-2, 1:-1] + around[2:, 1:-1] + around[1:-1, :-2] + around[1:-1, 2:]
            likely = 1 / (1 + np.exp(-2 * beta * sums - log_odds))
            drawn = np.where(rng.random((height, width)) < likely, 1.0, -1.0)
            z = np.where(colour == c, drawn, z)
    return z.ravel()


@pytest.mark.parametrize(("beta", "log_odds"), [(0.0, 0.5), (0.2, -0.3), (0.35, 0.0), (0.4, 0.2)])
def test_the_estimate_finds_the_beta_of_a_sample(beta, log_odds):
    z = gibbs_sample(beta, log_odds, 90, 90, np.random.default_rng(7))
    sums = PixelGrid(np.ones((90, 90), bool)).sums(z)
    found = most_likely(z, sums, BetaPrior(0.0))
    assert found.beta == pytest.approx(beta, abs=0.03)
    assert found.log_odds == pytest.approx(log_odds, abs=0.1)
    alone = most_likely(z, sums, BetaPrior(1.0, log_odds), learn_share=False)
    assert alone.log_odds == log_odds
    assert alone.beta == pytest.approx(beta, abs=0.03)


@given(st.integers(0, 1000), st.floats(0, 2), st.floats(-2, 2))
@settings(max_examples=30, deadline=None)
def test_no_other_prior_is_likelier_and_the_start_does_not_matter(seed, beta, log_odds):
    rng = np.random.default_rng(seed)
    z = np.clip(rng.normal(0.2, 0.7, 144), -1, 1)
    sums = PixelGrid(np.ones((12, 12), bool)).sums(z)
    best = most_likely(z, sums, BetaPrior(0.0))
    again = most_likely(z, sums, BetaPrior(beta, log_odds))
    assert again.beta == pytest.approx(best.beta, abs=1e-4)
    assert again.log_odds == pytest.approx(best.log_odds, abs=1e-4)
    assert pseudo_likelihood(z, sums, BetaPrior(beta, log_odds)) <= (
        pseudo_likelihood(z, sums, best) + 1e-12
    )


def test_without_a_field_the_share_is_the_mean_label():
    # The M-step of a plain mixture.
    z = np.random.default_rng(0).uniform(-1, 1, 50)
    found = most_likely(z, np.zeros(50), BetaPrior(0.0), learn_beta=False)
    assert 1 / (1 + math.exp(-found.log_odds)) == pytest.approx((1 + z.mean()) / 2, abs=1e-6)


def test_labels_without_a_dissenter_stop_at_the_bounds():
    sums = PixelGrid(np.ones((8, 8), bool)).sums(np.ones(64))
    found = most_likely(np.ones(64), sums, BetaPrior(0.0), share_floor=0.01)
    assert 0 <= found.beta <= LARGEST
    assert abs(found.log_odds) <= math.log(99) * (1 + 1e-12)
    # Neighbours that always differ would ask for a beta below 0: there is none.
    z = np.where(np.indices((8, 8)).sum(axis=0) % 2, 1.0, -1.0).ravel()
    grid = PixelGrid(np.ones((8, 8), bool))
    assert most_likely(z, grid.sums(z), BetaPrior(1.0)).beta == 0.0


def test_a_schedule_rises_and_stays():
    schedule = Schedule(end=2.0, start=0.5, iterations=3)
    assert [schedule.at(i) for i in range(5)] == pytest.approx([0.5, 1.0, 1.5, 2.0, 2.0])
    assert Schedule(1.0, 0.0, 0).at(0) == 1.0
    for wrong in ({"end": -1.0}, {"start": math.nan}, {"iterations": -1}):
        with pytest.raises(InputError, match="beta"):
            Schedule(**wrong)
