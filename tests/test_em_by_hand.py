"""EM on grids of a few pixels, worked out on paper."""

from __future__ import annotations

import numpy as np
import pytest

from hmrf_icp.errors import InputError
from hmrf_icp.field.paper import Grid, HiddenMarkovRandomField, initial_labels, m_step

NAN = np.nan


def run(y, z, beta, steps, precision="double"):
    """Run EM on (H, W) lists; the field in the same shape."""
    y, z = np.array(y, float), np.array(z, float)
    seen = ~np.isnan(y)
    labels = Grid(seen, precision).em(y[seen], z[seen], beta, steps)
    field = np.full(y.shape, np.nan)
    field[seen] = labels.z
    return field, labels


# The grid of the worked example: five observed pixels and a hole.
#
#     y =  1   3   4        z =  +   +   -
#          2  nan  8             +  nan  -
Y = [[1.0, 3.0, 4.0], [2.0, NAN, 8.0]]
Z = [[1.0, 1.0, -1.0], [1.0, NAN, -1.0]]


def test_first_m_step_by_hand():
    # Inliers 1, 3, 2: mean 2, variance (1 + 1 + 0) / 3. Outliers 4, 8: mean 6, variance 4.
    y, z = np.array([1.0, 3.0, 4.0, 2.0, 8.0]), np.array([1.0, 1.0, -1.0, 1.0, -1.0])
    assert m_step(y, z) == pytest.approx((2.0, np.sqrt(2 / 3), 6.0, 2.0))


def test_first_e_step_by_hand():
    # With beta = 1/2 and S the sum over the neighbours, z = tanh(L / 2) where
    #   L = 2 beta S + ln(sigma_out / sigma_in) - (y - 2)^2 / (4/3) + (y - 6)^2 / 8
    # and ln(sigma_out / sigma_in) = ln sqrt(6) = 0.89588. The hole adds 0 to S.
    #   y = 1: S =  1 + 1     =  2    L =  2 + 0.89588 -  0.75 + 3.125 =   5.27088
    #   y = 3: S =  1 - 1 + 0 =  0    L =  0 + 0.89588 -  0.75 + 1.125 =   1.27088
    #   y = 4: S =  1 - 1     =  0    L =  0 + 0.89588 -  3.00 + 0.500 =  -1.60412
    #   y = 2: S =  1 + 0     =  1    L =  1 + 0.89588 -  0.00 + 2.000 =   3.89588
    #   y = 8: S = -1 + 0     = -1    L = -1 + 0.89588 - 27.00 + 0.500 = -26.60412
    field, labels = run(Y, Z, beta=0.5, steps=1)
    by_hand = np.tanh(0.5 * np.array([[5.27088, 1.27088, -1.60412], [3.89588, NAN, -26.60412]]))
    np.testing.assert_allclose(field, by_hand, atol=1e-5)
    np.testing.assert_allclose(
        field, [[0.98977, 0.56179, -0.66519], [0.96016, NAN, -1.0]], atol=1e-5
    )
    assert labels.em_iterations == 1


def test_second_m_step_by_hand():
    # The weights (1 + z) / 2 of the inliers above: 0.99489, 0.78089, 0.16741, 0.98008, 0.
    #   weight 2.92327   sum of w y = 0.99489 + 2.34268 + 0.66963 + 1.96016 = 5.96735
    #   mean 2.04133     sum of w (y - mean)^2 = 1.07882 + 0.71768 + 0.64224 + 0.00167 = 2.44041
    #   variance 2.44041 / 2.92327 = 0.83482, sigma 0.91369
    # The outliers have the rest of each weight: 0.00511, 0.21911, 0.83259, 0.01992, 1.
    #   weight 2.07673   sum of w y = 0.00511 + 0.65732 + 3.33037 + 0.03984 + 8 = 12.03265
    #   mean 5.79403     sum of w (y - mean)^2 = 0.11751 + 1.71047 + 2.67973 + 0.28675 + 4.86632
    #   variance 9.66078 / 2.07673 = 4.65191, sigma 2.15683
    field, _ = run(Y, Z, beta=0.5, steps=1)
    seen = ~np.isnan(field)
    theta = m_step(np.array(Y)[seen], field[seen])
    assert theta == pytest.approx((2.04133, 0.91369, 5.79403, 2.15683), abs=1e-5)


def test_the_pass_gathers_the_sums_of_the_m_step():
    # Two steps in one call, with the sums of the compiled pass in between, against the M-step
    # from the labels themselves. The pixel with y = 2 starts with the wrong sign, and changes it.
    wrong = [[1.0, 1.0, -1.0], [-1.0, NAN, -1.0]]
    field, once = run(Y, wrong, beta=0.5, steps=1)
    _, twice = run(Y, wrong, beta=0.5, steps=2)
    assert field[1, 0] > 0
    assert (once.em_iterations, twice.em_iterations) == (1, 2)
    seen = ~np.isnan(field)
    theta = m_step(np.array(Y)[seen], field[seen])
    assert list(twice.parameters.values()) == pytest.approx(theta, abs=1e-13)


def test_one_pixel_has_no_neighbours_and_two_agree():
    # Same Gaussians for both labels: only the field is left. A pair with z = (1, z2) becomes
    # (tanh(beta z2), tanh(beta)).
    y = np.array([[1.0, 1.0]])
    for beta in (0.0, 0.5, 2.0):
        field, _ = run(y, [[1.0, -1.0]], beta, 1)
        np.testing.assert_allclose(field, [[-np.tanh(beta), np.tanh(beta)]], atol=1e-12)


def test_two_pixels_that_swap_signs_for_ever_stop_after_the_second_step():
    # (+, -) becomes (-, +) becomes (+, -): no step repeats the one before, the second repeats
    # the signs of two steps before.
    _, labels = run([[1.0, 1.0]], [[1.0, -1.0]], 2.0, 600)
    assert labels.em_iterations == 2


def test_em_stops_at_the_first_step_that_moves_no_sign():
    _, labels = run(Y, Z, 0.5, 600)
    assert labels.em_iterations == 1


def test_no_steps_leave_the_labels_alone():
    field, labels = run(Y, Z, 0.5, 0)
    np.testing.assert_array_equal(field, Z)
    assert labels.em_iterations == 0
    assert labels.parameters["mu_in"] == pytest.approx(2.0)


@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("beta", [0.0, 2.0])
@pytest.mark.parametrize(
    "y",
    [
        np.zeros((3, 3)),  # two identical clouds
        np.full((3, 3), 0.7),
        np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1e-300], [0.0, 0.0, 5e-324]]),
        np.array([[0.0, 0.0, 0.0], [0.0, 1e9, 0.0], [0.0, 0.0, 0.0]]),
        np.array([[1e-12, NAN, 1e-9], [NAN, 1.0, NAN], [1e9, NAN, 0.0]]),
        np.array([[NAN, 1.0]]),
    ],
    ids=["zero", "equal", "denormal", "one far away", "many scales", "one pixel"],
)
def test_a_component_without_weight_or_spread_gives_no_nan(y, beta, precision):
    seen = ~np.isnan(y)
    z = initial_labels(y[seen], 0.1)
    laid = np.full(y.shape, np.nan)
    laid[seen] = z
    field, labels = run(y, laid, beta, 600, precision)
    assert np.isfinite(field[seen]).all()
    assert (np.abs(field[seen]) <= 1).all()
    assert all(np.isfinite(value) for value in labels.parameters.values())
    assert labels.parameters["sigma_in"] > 0
    assert labels.parameters["sigma_out"] > 0


def test_a_component_that_starts_empty_has_the_mean_and_spread_of_all():
    # 2, 4, 6 are all inliers: the outliers take mean 4, variance 8/3.
    theta = m_step(np.array([2.0, 4.0, 6.0]), np.ones(3))
    assert theta == pytest.approx((4.0, np.sqrt(8 / 3), 4.0, np.sqrt(8 / 3)))


@pytest.mark.parametrize(
    "wrong",
    [
        {"beta": -1.0},
        {"beta": NAN},
        {"beta": np.inf},
        {"outliers": 1.0},
        {"outliers": -0.1},
        {"outliers": NAN},
        {"steps": -1},
        {"first_steps": -1},
        {"precision": "half"},
    ],
)
def test_parameters_without_a_meaning_are_refused_by_name(wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        HiddenMarkovRandomField(**wrong)
