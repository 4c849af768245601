"""Shares with intervals, deciles, ROC curves and reliability, against values known beforehand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmrf_icp.evaluate import protocol
from hmrf_icp.evaluate.report.statistics import (
    Share,
    area_under_roc,
    decile,
    decile_label,
    median,
    reliability,
    roc_curve,
    wilson,
)


@pytest.mark.parametrize(
    ("solved", "runs", "low", "high"),
    [
        # Newcombe (1998), table I: the score method without continuity correction
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0000, 0.1611),
        (1, 29, 0.0061, 0.1718),
        # the other end is the mirror image
        (20, 20, 0.8389, 1.0000),
    ],
)
def test_wilson_interval_is_that_of_the_literature(solved, runs, low, high):
    assert wilson(solved, runs) == pytest.approx((low, high), abs=5e-5)


def test_without_runs_a_share_is_unknown_and_may_be_anything():
    share = Share(0, 0)
    assert share.value is None
    assert share.interval == (0.0, 1.0)


@given(st.integers(1, 500).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_wilson_interval_holds_the_share_and_stays_in_the_unit_interval(counts):
    solved, runs = counts
    low, high = wilson(solved, runs)
    assert 0.0 <= low <= solved / runs <= high <= 1.0
    assert low < high


def test_deciles_are_those_of_the_protocol():
    overlaps = [0.0, 0.0999, 0.1, 0.25, 0.3, 0.6, 0.7, 0.99, 1.0]
    assert decile(overlaps).tolist() == [0, 0, 1, 2, 3, 6, 7, 9, 9]
    assert decile(overlaps).tolist() == [protocol.decile(overlap) for overlap in overlaps]
    assert decile_label(3) == "0.3–0.4"


def test_median_leaves_out_runs_without_a_number():
    assert median(np.array([3.0, math.nan, 1.0, 2.0])) == 2.0
    assert median(np.array([math.nan])) is None


def test_area_under_roc_counts_pairs_in_the_right_order():
    # successes 0.35 and 0.8, failures 0.1 and 0.4: three of four pairs are in order
    assert area_under_roc([0.1, 0.4, 0.35, 0.8], [False, False, True, True]) == 0.75


def test_ties_count_half():
    assert area_under_roc([0.5, 0.5, 0.5], [True, False, True]) == 0.5
    assert area_under_roc([0.2, 0.5, 0.5], [False, False, True]) == 0.75


def test_nothing_can_be_told_apart_without_failures():
    assert area_under_roc([0.1, 0.9], [True, True]) is None
    assert area_under_roc([], []) is None


def test_roc_curve_goes_through_known_points():
    false, true = roc_curve([0.9, 0.8, 0.8, 0.3], [True, True, False, False])
    assert false.tolist() == [0.0, 0.0, 0.5, 1.0]
    assert true.tolist() == [0.0, 0.5, 1.0, 1.0]


@settings(max_examples=60)
@given(st.lists(st.tuples(st.integers(0, 5), st.booleans()), min_size=2, max_size=40))
def test_area_is_that_under_the_curve(runs):
    score = np.array([value for value, _ in runs], dtype=float)
    success = np.array([outcome for _, outcome in runs])
    area = area_under_roc(score, success)
    if success.all() or not success.any():
        assert area is None
        return
    false, true = roc_curve(score, success)
    assert area == pytest.approx(float(np.sum(np.diff(false) * (true[1:] + true[:-1]) / 2)))


def test_reliability_of_a_score_that_is_right_on_average():
    confidence = np.array([0.25, 0.25, 0.25, 0.25, 0.75, 0.75, 0.75, 0.75])
    success = np.array([True, False, False, False, True, True, True, False])
    found = reliability(confidence, success)
    assert found.shares == (Share(1, 4), Share(3, 4))
    assert found.calibration_error == pytest.approx(0.0)
    assert found.brier == pytest.approx(0.25 * 0.75)


def test_reliability_of_a_score_that_boasts():
    found = reliability(np.array([1.0, 1.0, 0.0, 0.0]), np.array([True, False, False, False]))
    # the bin of 1: half right, off by 0.5 over half of the runs; the bin of 0 is right
    assert found.calibration_error == pytest.approx(0.25)
    assert found.brier == pytest.approx(0.25)
    assert found.confidence.tolist() == [0.0, 1.0]
