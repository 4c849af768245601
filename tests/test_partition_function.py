"""The mean field against the exact distribution, all 512 configurations of a 3 x 3 grid."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from hmrf_icp.kernels import em

CONFIGURATIONS = np.array(list(product((-1.0, 1.0), repeat=9))).reshape(512, 3, 3)

CRITICAL_BETA = 1 / (2 * np.sqrt(2))
"""The inverse of the largest eigenvalue of the 3 x 3 grid's adjacency matrix, 2 cos(pi/4) * 2.

Below it z = 0 is the only fixed point of z = tanh(beta * neighbours); above it the field takes a
side of its own accord, which the exact distribution never does.
"""

THETA = (0.1, 0.1, 0.3, 0.2)  # mu_in, sigma_in, mu_out, sigma_out
Y = np.array([[0.05, 0.12, 0.2], [0.15, 0.21, 0.3], [0.1, 0.35, 0.24]])


def energy(z, beta):
    """H(z) = -beta sum over pairs of neighbours of z z', every pair once."""
    pairs = (z[:, 1:, :] * z[:, :-1, :]).sum((1, 2)) + (z[:, :, 1:] * z[:, :, :-1]).sum((1, 2))
    return -beta * pairs


def log_normal(y, mu, sigma):
    return -np.log(sigma) - 0.5 * ((y - mu) / sigma) ** 2


def exact(y, theta, beta):
    """E[Z | y] under the Gibbs distribution itself: the partition function summed out."""
    mu_in, sigma_in, mu_out, sigma_out = theta
    likelihood = np.where(
        CONFIGURATIONS > 0, log_normal(y, mu_in, sigma_in), log_normal(y, mu_out, sigma_out)
    ).sum(axis=(1, 2))
    exponent = likelihood - energy(CONFIGURATIONS, beta)
    weight = np.exp(exponent - exponent.max())
    partition_function = weight.sum()
    return np.tensordot(weight, CONFIGURATIONS, axes=1) / partition_function


def e_step(y, z, theta, beta):
    """One pass of the compiled E-step with parameters that stay."""
    mu_in, sigma_in, mu_out, sigma_out = theta
    framed = np.pad(z, 1)
    new = np.zeros_like(framed)
    constants = np.array(
        [beta, mu_in, 0.5 / sigma_in**2, mu_out, 0.5 / sigma_out**2, np.log(sigma_out / sigma_in)]
    )
    sums = np.zeros((len(y), em.COLUMNS))
    em.em_pass_double(y, np.ones_like(y), framed, framed.copy(), new, constants, sums)
    return new[1:-1, 1:-1]


def mean_field(y, theta, beta, start, steps=2000):
    """Fixed point of the E-step, damped so that the simultaneous update does not swing."""
    z = np.full((3, 3), start)
    for _ in range(steps):
        z = 0.5 * (z + e_step(y, z, theta, beta))
    return z


def test_without_interaction_the_mean_field_is_exact():
    found = e_step(Y, np.zeros((3, 3)), THETA, beta=0.0)
    np.testing.assert_allclose(found, exact(Y, THETA, beta=0.0), atol=1e-12)
    # It is no matter then where the field stood before.
    np.testing.assert_allclose(e_step(Y, np.ones((3, 3)), THETA, 0.0), found, atol=1e-12)


def test_the_error_of_the_mean_field_starts_with_the_square_of_beta():
    # Mean field and exact expectation agree to first order: halving beta quarters the error.
    error = [
        np.abs(mean_field(Y, THETA, beta, 0.0) - exact(Y, THETA, beta)).max()
        for beta in (0.02, 0.01, 0.005)
    ]
    assert 1e-6 < error[2] < 1e-4
    assert error[0] / error[1] == pytest.approx(4, rel=0.1)
    assert error[1] / error[2] == pytest.approx(4, rel=0.1)


def test_the_error_grows_with_beta_and_overstates_how_sure_the_field_is():
    betas = (0.0, 0.05, 0.1, 0.2, 0.3)
    fields = [mean_field(Y, THETA, beta, 0.0) for beta in betas]
    truths = [exact(Y, THETA, beta) for beta in betas]
    errors = [np.abs(f - t).max() for f, t in zip(fields, truths, strict=True)]
    assert errors == sorted(errors)
    assert 0.02 < errors[-1] < 0.6
    assert np.abs(fields[-1]).mean() > np.abs(truths[-1]).mean()


@pytest.mark.parametrize("beta", [0.1, 0.3, 0.34])
def test_below_the_critical_beta_the_mean_field_of_the_prior_is_the_exact_zero(beta):
    assert beta < CRITICAL_BETA
    same = (0.2, 0.1, 0.2, 0.1)  # both labels explain the data equally well
    assert np.abs(exact(Y, same, beta)).max() < 1e-12
    assert np.abs(mean_field(Y, same, beta, start=1.0)).max() < 1e-9


@pytest.mark.parametrize("beta", [0.4, 1.0, 2.0])
def test_above_the_critical_beta_the_first_guess_stays_where_the_exact_answer_is_zero(beta):
    # What the paper's beta = 2 does on its own four neighbours: it keeps the labels it was given.
    assert beta > CRITICAL_BETA
    same = (0.2, 0.1, 0.2, 0.1)
    assert np.abs(exact(Y, same, beta)).max() < 1e-12
    for start in (1.0, -1.0):
        field = mean_field(Y, same, beta, start)
        assert (np.sign(field) == start).all()
        assert np.abs(field).min() > (0.3 if beta < 1 else 0.9)


def test_strong_data_beat_the_field_in_both():
    theta = (0.0, 0.02, 1.0, 0.1)
    y = np.where(np.arange(9).reshape(3, 3) % 2 == 0, 0.01, 0.98)  # a chequerboard
    sign = np.where(y < 0.5, 1, -1)
    for beta in (0.0, 0.5, 2.0):
        assert (np.sign(exact(y, theta, beta)) == sign).all()
        assert (np.sign(mean_field(y, theta, beta, 0.0)) == sign).all()
