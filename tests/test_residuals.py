"""Each distribution of distances: a density, its fit, and what scaling does to both."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, stats

from hmrf_icp.errors import InputError
from hmrf_icp.field import residuals
from hmrf_icp.field.residuals import (
    Exponential,
    Gamma,
    Gaussian,
    HalfNormal,
    Logistic,
    LogNormal,
    Uniform,
    residual,
)

SCALE = st.floats(1e-3, 1e3)
NAME = st.sampled_from(residuals.names())
SOME = st.one_of(
    st.builds(Gaussian, st.floats(-5, 5), st.floats(0.1, 5)),
    st.builds(Logistic, st.floats(-5, 5), st.floats(0.1, 5)),
    st.builds(HalfNormal, SCALE),
    st.builds(LogNormal, SCALE, st.floats(0.05, 2)),
    st.builds(Exponential, SCALE),
    st.builds(Gamma, st.floats(0.5, 50), SCALE),
    st.builds(Uniform, SCALE),
)
DISTANCES = st.lists(st.floats(0, 1e3), min_size=1, max_size=30).map(np.array)
# For every distribution, its twin in SciPy.
TWIN = {
    "gaussian": lambda r: stats.norm(r.mu, r.sigma),
    "logistic": lambda r: stats.logistic(r.mu, r.scale),
    "half-normal": lambda r: stats.halfnorm(scale=r.sigma),
    "log-normal": lambda r: stats.lognorm(r.spread, scale=r.median),
    "exponential": lambda r: stats.expon(scale=r.scale),
    "gamma": lambda r: stats.gamma(r.shape, scale=r.scale),
    "uniform": lambda r: stats.uniform(0, r.maximum),
}
TYPICAL = [
    Gaussian(0.5, 0.1),
    Logistic(0.5, 0.05),
    HalfNormal(0.02),
    LogNormal(0.02, 0.6),
    Exponential(0.03),
    Gamma(2.5, 0.01),
    Gamma(0.6, 0.1),
    Uniform(0.8),
]


@given(SOME)
@settings(max_examples=60, deadline=None)
def test_the_density_is_scipys_and_adds_up_to_one(some):
    twin = TWIN[some.name](some)
    low, high = twin.ppf(1e-4), twin.ppf(1 - 1e-4)
    y = np.linspace(low, high, 50)
    np.testing.assert_allclose(some.log_density(y), twin.logpdf(y), rtol=1e-9, atol=1e-9)
    total, _ = integrate.quad(
        lambda v: math.exp(some.log_density(np.array([v]))[0]), low, high, limit=200
    )
    assert total == pytest.approx(1 - 2e-4, abs=4e-4)
    assert some.mean == pytest.approx(twin.mean())


@pytest.mark.parametrize("true", TYPICAL, ids=lambda r: r.name)
def test_a_fit_finds_what_the_distances_were_drawn_from(true):
    y = TWIN[true.name](true).rvs(40_000, random_state=0)
    found = residual(true.name).fit(y, np.ones_like(y))
    for key, value in true.parameters.items():
        assert getattr(found, key) == pytest.approx(value, rel=0.03)


@pytest.mark.parametrize("true", TYPICAL[:-1], ids=lambda r: r.name)
def test_no_other_parameters_are_likelier_than_the_fit(true):
    rng = np.random.default_rng(1)
    y = TWIN[true.name](true).rvs(500, random_state=rng)
    weight = rng.random(500)
    best = residual(true.name).fit(y, weight)
    likelihood = weight @ best.log_density(y)
    for key, value in best.parameters.items():
        for factor in (0.999, 1.001):
            other = type(best)(**{**best.parameters, key: value * factor})
            assert weight @ other.log_density(y) < likelihood


@given(NAME, st.integers(0, 1000))
@settings(max_examples=40, deadline=None)
def test_a_weight_of_two_is_a_point_that_is_there_twice(name, seed):
    rng = np.random.default_rng(seed)
    y = rng.gamma(2.0, 0.1, 40)
    weight = rng.integers(0, 4, 40)
    weight[0] = 1
    weighted = residual(name).fit(y, weight.astype(float))
    repeated = residual(name).fit(np.repeat(y, weight), np.ones(weight.sum()))
    for key, value in weighted.parameters.items():
        assert getattr(repeated, key) == pytest.approx(value, rel=1e-6)


@given(NAME, st.integers(0, 1000), st.floats(-3, 3))
@settings(max_examples=60, deadline=None)
def test_other_units_give_the_same_fit_in_those_units(name, seed, exponent):
    rng = np.random.default_rng(seed)
    y, weight, factor = rng.gamma(2.0, 0.1, 60), rng.random(60), 10.0**exponent
    here = residual(name).fit(y, weight, 0.01)
    there = residual(name).fit(factor * y, weight, factor * 0.01)
    for key, value in here.parameters.items():
        in_units = factor if here.units[key] == "m" else 1.0
        assert getattr(there, key) == pytest.approx(in_units * value, rel=1e-6, abs=1e-9 * factor)
    np.testing.assert_allclose(
        there.log_density(factor * y) + math.log(factor), here.log_density(y), atol=1e-5
    )


@given(NAME, DISTANCES, st.data())
@settings(max_examples=150, deadline=None)
def test_nothing_gives_nan(name, y, data):
    weights = st.lists(st.sampled_from([0.0, 1e-300, 1e-9, 0.3, 1.0]), min_size=y.size)
    weight = np.array(data.draw(weights.map(lambda w: w[: y.size])))
    fitted = residual(name).fit(y, weight)
    assert np.isfinite(list(fitted.parameters.values())).all()
    for points in (y, np.array([0.0, 1e-300, 1e6])):
        assert np.isfinite(fitted.log_density(points)).all()


@pytest.mark.parametrize("name", residuals.names())
def test_identical_clouds_have_a_fit_too(name):
    y = np.zeros(20)
    fitted = residual(name).fit(y, np.ones(20))
    assert np.isfinite(fitted.log_density(y)).all()
    assert residual(name).fit(y, np.zeros(20)) == residual(name)


def test_the_floor_holds():
    y = np.full(20, 1e-4)
    assert HalfNormal().fit(y, np.ones(20), 0.01).sigma == 0.01
    assert Gaussian().fit(y, np.ones(20), 0.01).sigma == 0.01
    assert Exponential().fit(y, np.ones(20), 0.01).scale == 0.01


def test_free_parameters_are_counted():
    assert {name: len(residual(name).units) for name in residuals.names()} == {
        "gaussian": 2,
        "logistic": 2,
        "half-normal": 1,
        "log-normal": 2,
        "exponential": 1,
        "gamma": 2,
        "uniform": 1,
    }
    for name in residuals.names():
        assert set(residual(name).parameters) == set(residual(name).units)


def test_an_unknown_name_says_what_there_is():
    with pytest.raises(InputError, match=r"'cauchy'.*half-normal"):
        residual("cauchy")
