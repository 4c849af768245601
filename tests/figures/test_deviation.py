"""A deviation map measures along normals, knows its sign, and counts what is within a tolerance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import PointCloud, plot
from hmrf_icp.errors import InputError


def plate(normals=True, size=1.0):
    """A flat model, (1600, 3), whose normals point up."""
    grid = np.linspace(-size, size, 40)
    points = np.stack([*np.meshgrid(grid, grid), np.zeros((40, 40))], axis=-1).reshape(-1, 3)
    up = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    return PointCloud(points, normals=up if normals else None)


def scan(model, dent):
    """The model's points, those with x > 0 off it by ``dent`` along z."""
    points = model.points + np.array([0.003, 0.002, 0.0])
    points[points[:, 0] > 0.0, 2] += dent
    return PointCloud(points)


@pytest.fixture(scope="module")
def measured():
    """A result that leaves the scan where it is."""
    model = plate()
    moved = hmrf_icp.register(model, model, np.eye(4), preset="paper", rejector="all")
    return replace(moved, transformation=np.eye(4))


@pytest.mark.parametrize("dent", [0.02, -0.02])
def test_deviations_have_the_sign_of_the_side(measured, dent):
    model = plate()
    source = scan(model, dent)
    found = plot.deviations(measured, source, model, tolerance=0.005)
    right = source.observed_points[:, 0] > 0.0
    assert found.signed
    np.testing.assert_allclose(found.values[right & found.compared], dent, atol=1e-9)
    np.testing.assert_allclose(found.values[~right & found.compared], 0.0, atol=1e-9)


def test_without_normals_or_viewpoint_there_is_no_sign(measured):
    model = plate(normals=False)
    found = plot.deviations(measured, scan(model, -0.02), model, tolerance=0.005)
    assert not found.signed
    assert np.nanmin(found.values) >= 0.0
    assert np.nanmax(found.values) == pytest.approx(0.02, abs=1e-6)


def test_the_share_within_the_tolerance_is_the_counted_one_and_stands_in_the_title(measured, ax):
    model = plate()
    source = scan(model, 0.02)
    found = plot.deviations(measured, source, model, tolerance=0.005)
    counted = np.mean(np.abs(found.values[~np.isnan(found.values)]) <= 0.005)
    assert found.share_within == counted
    assert 0.4 < counted < 0.6
    assert plot.deviation(measured, source, model, ax, tolerance=0.005) is ax
    assert f"{counted:.1%} within 5 mm" in ax.get_title(loc="left")
    assert ax.child_axes[0].get_xlabel() == "deviation from the target, mm"


def test_past_the_border_there_is_nothing_to_compare_with(measured):
    model = plate(size=0.5)
    source = plate()
    result = replace(measured, transformation=np.eye(4))
    found = plot.deviations(result, source, model, tolerance=0.001)
    inside = (np.abs(source.observed_points[:, :2]) < 0.5).all(axis=1)
    beyond = (np.abs(source.observed_points[:, :2]) > 0.6).any(axis=1)
    assert found.compared[inside].all()
    assert not found.compared[beyond].any()


def test_a_reach_leaves_out_what_is_of_another_surface(measured):
    model = plate()
    source = scan(model, 0.3)
    assert plot.deviations(measured, source, model, tolerance=0.01).share_within < 0.6
    near = plot.deviations(measured, source, model, tolerance=0.01, reach=0.1)
    assert near.share_within == 1.0
    assert 0.4 < near.compared.mean() < 0.6


def test_a_tolerance_from_the_noise_holds_what_is_only_noise(wavy):
    rng = np.random.default_rng(3)
    noisy = wavy + rng.normal(0.0, 0.004, wavy.shape)
    result = hmrf_icp.register(noisy, wavy + rng.normal(0.0, 0.004, wavy.shape), np.eye(4))
    found = plot.deviations(result)
    assert found.chosen
    assert 0.004 < found.tolerance < 0.1
    assert found.share_within > 0.9
    assert plot.deviations(result, tolerance=found.tolerance / 100).share_within < 0.2


def test_units_that_nobody_knows_are_units(measured, ax):
    plot.deviation(measured, scan(plate(), 0.02), plate(), ax, tolerance=0.005, unit=None)
    assert "within 0.005 units" in ax.get_title(loc="left")
    assert ax.child_axes[0].get_xlabel() == "deviation from the target, units"


@pytest.mark.parametrize("bad", [{"tolerance": 0.0}, {"tolerance": np.nan}, {"reach": -1.0}])
def test_a_length_that_is_none_is_refused(measured, bad):
    with pytest.raises(InputError, match=next(iter(bad))):
        plot.deviations(measured, **bad)
