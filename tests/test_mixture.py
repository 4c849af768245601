"""Mixtures of inliers and outliers: what they were drawn from is found, and the pair is chosen."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmrf_icp.errors import InputError
from hmrf_icp.field import mixture, residuals
from hmrf_icp.field.residuals import HalfNormal, Uniform

DISTANCES = st.lists(st.floats(0, 100), min_size=1, max_size=40).map(np.array)


def draw(inliers, outliers, seed=0):
    return np.concatenate([inliers, outliers])[np.random.default_rng(seed).permutation(20_000)]


RNG = np.random.default_rng(3)
NEAR, FAR = 8_000, 12_000
DRAWN = {
    ("half-normal", "uniform"): draw(abs(RNG.normal(0, 0.01, NEAR)), RNG.uniform(0, 0.8, FAR)),
    ("log-normal", "uniform"): draw(
        RNG.lognormal(np.log(0.01), 0.5, NEAR), RNG.uniform(0, 0.8, FAR)
    ),
    ("gaussian", "gaussian"): draw(RNG.normal(0.1, 0.01, NEAR), RNG.normal(0.4, 0.06, FAR)),
    ("half-normal", "logistic"): draw(abs(RNG.normal(0, 0.01, NEAR)), RNG.logistic(0.6, 0.03, FAR)),
    ("gamma", "gaussian"): draw(RNG.gamma(2.5, 0.01, NEAR), RNG.normal(0.5, 0.05, FAR)),
    ("log-normal", "exponential"): draw(
        RNG.lognormal(np.log(0.01), 0.4, NEAR), RNG.exponential(0.5, FAR)
    ),
}


@pytest.mark.parametrize("pair", DRAWN, ids="+".join)
def test_the_pair_that_the_distances_were_drawn_from_is_chosen(pair):
    found = mixture.choose(abs(DRAWN[pair]))
    assert (found.inlier.name, found.outlier.name) == pair
    assert found.share == pytest.approx(0.4, abs=0.02)


def test_parameters_come_back_and_em_does_not_care_about_the_first_guess():
    y = DRAWN[("half-normal", "uniform")]
    for initial in (0.1, 0.5, 0.9):
        found = mixture.fit(y, "half-normal", "uniform", initial=initial)
        assert found.inlier.sigma == pytest.approx(0.01, rel=0.03)
        assert found.share == pytest.approx(0.4, abs=0.01)
        truth = np.abs(y) < 0.02
        assert np.mean((found.log_odds(y) > 0) == truth) > 0.95


def test_the_criterion_counts_the_parameters():
    # Everything from one half-normal: the richer pair gains next to nothing, and costs log(n) each.
    y = abs(np.random.default_rng(0).normal(size=2000))
    small = mixture.fit(y, "half-normal", "half-normal")
    assert small.bic == pytest.approx(3 * np.log(2000) - 2 * small.log_density(y).sum())


@given(st.integers(0, 100), st.floats(-3, 3))
@settings(max_examples=4, deadline=None)
def test_the_choice_does_not_depend_on_the_unit(seed, exponent):
    rng = np.random.default_rng(seed)
    y = np.concatenate([rng.gamma(2.0, 0.01, 300), rng.uniform(0, 0.7, 200)])
    factor = 10.0**exponent
    here, there = mixture.choose(y), mixture.choose(factor * y)
    assert (there.inlier.name, there.outlier.name) == (here.inlier.name, here.outlier.name)
    assert there.share == pytest.approx(here.share, rel=1e-4)
    np.testing.assert_allclose(there.log_odds(factor * y), here.log_odds(y), atol=1e-3)


def test_inliers_are_the_nearer_component():
    y = DRAWN[("gaussian", "gaussian")]
    assert mixture.fit(y, "gaussian", "gaussian").nearer(y)
    backwards = mixture.Mixture(Uniform(0.8), HalfNormal(0.01), 0.5)
    assert not backwards.nearer(y)
    few = y[:200]
    order = [found.nearer(few) for found in mixture.compare(few)]
    assert order == sorted(order, reverse=True)
    assert len(order) == len(residuals.names()) ** 2


@given(DISTANCES)
@settings(max_examples=12, deadline=None)
def test_nothing_gives_nan(y):
    for found in mixture.compare(y, ("half-normal", "log-normal", "gamma")):
        assert np.isfinite([found.bic, found.share]).all()
        assert np.isfinite(found.log_odds(y)).all()
        assert 0 < found.share < 1


def test_distances_that_are_none_are_refused():
    for wrong in ([], [-1.0, 2.0], [np.nan]):
        with pytest.raises(InputError, match="distances"):
            mixture.choose(np.array(wrong))
