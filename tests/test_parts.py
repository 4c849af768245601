"""Match, reject and align are parts: each can be another one without touching the rest."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

import hmrf_icp
import synthetic
from hmrf_icp import PointCloud, presets, se3
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.loop.align import Step
from hmrf_icp.loop.match import Matches, NearestNeighbour
from hmrf_icp.loop.placed import Placed
from hmrf_icp.loop.reject import X84, Dynamic, KeepAll, KeepPercent, KeepSigma, Labels, first_valley
from shapes import both

register = partial(hmrf_icp.register, preset="paper")
"""These are statements about the paper's method and its parts."""


@dataclass(frozen=True)
class ScipyMatcher:
    """The same neighbours from another library."""

    def prepare(self, source, target):
        tree = cKDTree(target.points)

        def match(source):
            distance, index = tree.query(source.points)
            return Matches(index, distance)

        return match


@dataclass(frozen=True)
class KeepWithin:
    """A fixed threshold, which nobody knows how to choose."""

    metres: float

    def prepare(self, source, target):
        return lambda matches, before: Labels(np.where(matches.distance < self.metres, 1.0, -1.0))


@dataclass(frozen=True)
class TranslationOnly:
    """No rotation: the mean of the differences."""

    def prepare(self, source, target):
        closest = target.points

        def align(source, matches, labels):
            difference = (closest[matches.index] - source.points)[labels.inlier]
            return Step(se3.rigid(np.eye(3), difference.mean(axis=0)))

        return align


@pytest.fixture
def clouds():
    return synthetic.pair(1)


def test_another_matcher_gives_the_same_result(clouds):
    own = register(*clouds)
    other = register(*clouds, preset=replace(presets.PAPER, match=ScipyMatcher()))
    assert other.iterations == own.iterations
    np.testing.assert_allclose(other.transformation, own.transformation, atol=1e-9)


def test_another_rejector_decides_who_is_an_inlier(clouds):
    source, target = clouds
    result = register(source, target, rejector=KeepWithin(0.05))
    assert result.em_iterations == 0
    assert 0 < result.overlap < 1
    assert set(np.unique(result.inlier_probability[~np.isnan(result.inlier_probability)])) == {0, 1}


def test_another_aligner_finds_another_motion(clouds):
    result = register(*clouds, preset=replace(presets.PAPER, align=TranslationOnly()))
    np.testing.assert_allclose(result.transformation[:3, :3], np.eye(3), atol=1e-12)
    assert result.iterations > 1


def test_a_rejector_sees_its_own_labels_of_the_iteration_before(clouds):
    seen = []

    class Remembering:
        def prepare(self, source, target):
            def reject(matches, before):
                seen.append(before)
                return Labels(np.ones_like(matches.distance), em_iterations=len(seen))

            return reject

    result = register(*clouds, rejector=Remembering())
    assert seen[0] is None
    assert [labels.em_iterations for labels in seen[1:]] == list(range(1, len(seen)))
    assert result.em_iterations == sum(range(1, len(seen) + 1))


def test_the_parts_of_the_paper_are_named_and_its_numbers_are_the_defaults():
    field = presets.PAPER.reject
    assert (field.beta, field.outliers) == (2.0, 0.1)
    assert (field.first_steps, field.steps) == (600, 20)
    assert field.precision == "double"
    criteria = presets.PAPER.criteria
    assert (criteria.translation, criteria.rotation) == (0.01, 0.001)
    assert criteria.max_iterations == 50
    assert "paper" in presets.names()
    assert presets.rejector_names()[0] == "hmrf"


def label(rejector, distance, before=None):
    cloud = PointCloud(np.random.default_rng(0).normal(size=(len(distance), 3)))
    matches = Matches(np.zeros(len(distance), dtype=int), np.asarray(distance, float))
    return rejector.prepare(*both(cloud, cloud))(matches, before)


def test_rules_by_hand():
    # 0 .. 10: mean 5, deviation sqrt(10), median 5, median deviation 3, 90th percentile 9.
    distance = np.arange(11.0)
    assert label(KeepAll(), distance).inlier.all()
    np.testing.assert_array_equal(label(KeepPercent(), distance).inlier, distance <= 9)
    np.testing.assert_array_equal(label(KeepPercent(50), distance).inlier, distance <= 5)
    assert label(KeepSigma(), distance).parameters["threshold"] == pytest.approx(
        5 + 2.5 * np.sqrt(10)
    )
    assert label(X84(), distance).parameters["threshold"] == pytest.approx(5 + 5.2 * 3)
    np.testing.assert_array_equal(label(X84(), [1, 1, 1, 1, 9]).inlier, [1, 1, 1, 1, 0])


@pytest.mark.parametrize(
    ("scale", "threshold"),
    [
        # Kept are 1, 2 and 3 (below the threshold of before, 5): mean 2, deviation sqrt(2/3).
        (2.5, 2 + 3 * np.sqrt(2 / 3)),  # mean below D
        (1.0, 2 + 2 * np.sqrt(2 / 3)),  # below 3 D
        (0.5, 2 + np.sqrt(2 / 3)),  # below 6 D
    ],
)
def test_dynamic_threshold_by_hand(scale, threshold):
    rule = Dynamic(scale)
    before = Labels(np.ones(4), parameters={"threshold": 5.0})
    labels = label(rule, [1.0, 2.0, 3.0, 40.0], before)
    assert labels.parameters["threshold"] == pytest.approx(threshold)
    assert label(rule, [1.0, 2.0, 3.0, 40.0]).parameters["threshold"] == pytest.approx(20 * scale)


def test_dynamic_takes_the_valley_where_the_registration_is_bad():
    # Two heaps: 60 around 1, 30 around 9, nothing between. The valley is between them.
    distance = np.concatenate([np.linspace(0.5, 2.0, 60), np.linspace(8.5, 10.0, 30)])
    before = Labels(np.ones(90), parameters={"threshold": 100.0})
    threshold = label(Dynamic(0.01), distance, before).parameters["threshold"]
    assert threshold == first_valley(distance)
    assert 2.0 < threshold < 8.5


def test_a_gap_before_the_highest_peak_is_no_valley():
    # Bins a metre wide: a few good matches, a gap, most of them, and a valley at 6.5 m.
    count = [3, 0, 5, 20, 6, 1, 0, 4, 2, 2]
    distance = np.concatenate([np.repeat(np.arange(10) + 0.5, count), [0.0, 10.0]])
    assert first_valley(distance) == pytest.approx(6.5)


def test_a_histogram_without_a_valley_keeps_everything():
    assert first_valley(np.full(20, 3.0)) >= 3.0
    falling = np.repeat(np.arange(10.0), np.arange(20, 0, -2))
    assert first_valley(falling) == falling.max()


def test_dynamic_goes_on_where_the_last_threshold_kept_nothing():
    before = Labels(-np.ones(4), parameters={"threshold": 0.1})
    labels = label(Dynamic(2.5), [1.0, 2.0, 3.0, 4.0], before)
    assert labels.inlier.any()


def test_nearest_neighbours_skip_the_holes_of_the_target():
    target = np.random.default_rng(0).normal(size=(6, 7, 3))
    target[1:4, 2:5] = np.nan
    cloud = PointCloud(target)
    moved = np.random.default_rng(1).normal(size=(30, 3))
    matches = NearestNeighbour().prepare(*both(cloud, cloud))(Placed(moved, np.eye(4)))
    distance = np.linalg.norm(moved[:, None] - cloud.observed_points[None], axis=2)
    np.testing.assert_array_equal(matches.index, distance.argmin(axis=1))
    np.testing.assert_allclose(matches.distance, distance.min(axis=1), atol=1e-15)


@pytest.mark.parametrize("tolerance", [0.1, 0.5])
def test_nearest_neighbours_with_tolerance_are_almost_the_nearest(tolerance):
    random = np.random.default_rng(2)
    cloud, moved = PointCloud(random.normal(size=(500, 3))), random.normal(size=(2000, 3))
    placed = Placed(moved, np.eye(4))
    exact = NearestNeighbour().prepare(*both(cloud, cloud))(placed)
    loose = NearestNeighbour(tolerance=tolerance).prepare(
        PreparedCloud(cloud), PreparedCloud(cloud)
    )(placed)
    apart = np.linalg.norm(moved - cloud.points[loose.index], axis=1)
    np.testing.assert_allclose(loose.distance, apart, atol=1e-15)
    assert (loose.distance <= (1 + tolerance) * exact.distance).all()
    assert (loose.distance > exact.distance).any()


@pytest.mark.parametrize("tolerance", [-0.1, np.nan, np.inf])
def test_tolerance_is_a_share(tolerance):
    with pytest.raises(hmrf_icp.InputError, match="tolerance"):
        NearestNeighbour(tolerance=tolerance)


@given(
    seed=st.integers(0, 1000),
    steps=st.lists(st.floats(1e-6, 0.3), min_size=1, max_size=6),
    tolerance=st.sampled_from([0.02, 0.1, 0.3, 0.5]),
)
# As a registration steps: far at first, less and less, and far again.
@example(seed=0, steps=[0.1, 0.03, 0.01, 0.003, 0.001, 0.05], tolerance=0.3)
@settings(max_examples=25, deadline=None)
def test_matches_kept_from_one_pose_to_the_next_are_as_close_as_new_ones(seed, steps, tolerance):
    rng = np.random.default_rng(seed)
    source, target = (PreparedCloud(PointCloud(rng.normal(size=(800, 3)))) for _ in range(2))
    kept = NearestNeighbour(tolerance=tolerance).prepare(source, target)
    exact = NearestNeighbour().prepare(source, target)
    placed = Placed(source.points, np.eye(4))
    before = kept(placed)
    held = before.index.copy()
    for length in steps:
        placed = placed.moved(se3.exp(length * rng.normal(size=6)))
        found, closest = kept(placed), exact(placed)
        there = np.linalg.norm(placed.points - target.points[found.index], axis=1)
        np.testing.assert_allclose(found.distance, there, atol=1e-12)
        assert (found.distance <= (1.0 + tolerance) * closest.distance + 1e-12).all()
    np.testing.assert_array_equal(before.index, held)  # what was handed out does not change
