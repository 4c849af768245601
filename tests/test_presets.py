"""The default's field: what its labels start from, and what they listen to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hmrf_icp import PointCloud, PreparedCloud, presets, register
from hmrf_icp.field.general import MarkovField, initial_labels
from hmrf_icp.field.residuals import HalfNormal, Uniform
from hmrf_icp.loop.match import Matches
from hmrf_icp.loop.reject import Labels
from views import frame, truth

SIDE = 20


@pytest.fixture(scope="module")
def clouds():
    """An image of 20 x 20 points, and a target with a point every millimetre."""
    line = np.linspace(-1.0, 1.0, SIDE)
    x, y = np.meshgrid(line, line)
    target = 1e-3 * np.stack(np.meshgrid(np.arange(20.0), np.arange(20.0), [0.0]), axis=-1)
    image = PointCloud(np.stack([x, y, np.full(x.shape, 2.0)], axis=-1))
    return PreparedCloud(image), PreparedCloud(PointCloud(target.reshape(-1, 3)))


def decided(clouds, distance, field=presets.FIELD, evidence=None, before=None):
    index = np.zeros(distance.size, dtype=np.intp)
    told = None if evidence is None else evidence.ravel()
    labels = field.prepare(*clouds)(Matches(index, distance.ravel(), told), before)
    return labels, labels.probability.reshape(distance.shape)


def halves(inside, outside):
    """Distances of an image whose left half has a counterpart, and whose right half has none."""
    rng = np.random.default_rng(0)
    near, far = inside(rng, (SIDE, SIDE // 2)), outside(rng, (SIDE, SIDE // 2))
    return np.hstack([near, far])


def spread(rng, shape):
    return rng.uniform(0.2, 1.0, shape)


def test_a_distance_that_may_be_either_is_what_its_neighbours_are(clouds):
    distance = halves(lambda rng, shape: np.abs(rng.normal(0.0, 0.01, shape)), spread)
    distance[10, 5] = distance[10, 15] = 0.032
    _, alone = decided(clouds, distance, replace(presets.FIELD, beta=0.0))
    _, probability = decided(clouds, distance)
    assert alone[10, 5] == pytest.approx(alone[10, 15])
    assert probability[10, 5] > 0.9
    assert probability[10, 15] < 0.1


def test_no_distance_is_too_small_for_an_inlier(clouds):
    distance = halves(lambda rng, shape: rng.uniform(0.049, 0.051, shape), spread)
    distance[10, 5] = 0.0
    assert decided(clouds, distance)[1][10, 5] > 0.9


def test_a_third_of_inliers_is_found_from_half(clouds):
    distance = np.random.default_rng(0).uniform(0.2, 1.0, (SIDE, SIDE))
    distance[:, :7] = np.abs(np.random.default_rng(1).normal(0.0, 0.01, (SIDE, 7)))
    _, probability = decided(clouds, distance)
    np.testing.assert_array_equal(probability > 0.5, np.arange(SIDE)[None] < [[7]] * SIDE)


def test_who_was_looked_through_does_not_start_inside():
    distance = np.linspace(0.0, 1.0, 100)
    against = np.where(np.arange(100) < 40, -8.0, 0.0)
    z = initial_labels(Matches(np.zeros(100, dtype=np.intp), distance, against), 0.5)
    np.testing.assert_array_equal(np.flatnonzero(z > 0), np.arange(40, 70))


def test_evidence_against_all_but_a_few_is_not_asked_who_starts():
    distance = np.linspace(0.0, 1.0, 100)
    against = np.where(np.arange(100) < 95, -8.0, 0.0)
    z = initial_labels(Matches(np.zeros(100, dtype=np.intp), distance, against), 0.5)
    np.testing.assert_array_equal(np.flatnonzero(z > 0), np.arange(50))


def test_labels_are_told_by_distances_and_by_the_share_that_was_learnt(clouds):
    rng = np.random.default_rng(0)
    near = np.abs(rng.normal(0.0, 0.05, (SIDE, SIDE)))
    distance = np.where(rng.random((SIDE, SIDE)) < 0.15, near, rng.uniform(0.0, 1.0, near.shape))
    labels, probability = decided(clouds, distance, MarkovField(beta=0.0, share="learn"))
    learnt = labels.parameters
    assert learnt["share"] < 0.4
    inlier = HalfNormal(learnt["inlier_sigma"]).log_density(distance)
    odds = np.exp(inlier - Uniform(learnt["outlier_maximum"]).log_density(distance))
    odds *= learnt["share"] / (1.0 - learnt["share"])
    np.testing.assert_allclose(probability, odds / (1.0 + odds), atol=1e-6)


def test_em_goes_on_until_no_label_changes(clouds):
    distance = halves(lambda rng, shape: np.abs(rng.normal(0.0, 0.05, shape)), spread)
    field = replace(presets.FIELD, initial=0.95, first_steps=100)
    first, _ = decided(clouds, distance, field)
    again, _ = decided(clouds, distance, field, before=first)
    assert first.em_iterations > 1
    np.testing.assert_array_equal(first.inlier, again.inlier)


def test_a_decision_starts_from_the_one_before(clouds):
    distance = halves(lambda rng, shape: np.abs(rng.normal(0.0, 0.01, shape)), spread)
    before = Labels(np.where(np.arange(SIDE * SIDE) % 3 == 0, 0.8, -0.6))
    after, _ = decided(clouds, distance, replace(presets.FIELD, steps=0), before=before)
    np.testing.assert_array_equal(after.z, before.z)


def test_points_that_were_thinned_out_have_the_label_of_the_one_that_stands_for_them():
    still = replace(presets.FIELD, steps=0)
    plan = replace(presets.ROBUST, points=1500).with_parts(reject=still)
    result = register(frame(26), frame(8), truth(26, 8), preset=plan)
    everywhere = result.inlier_probability
    near = result.distance < 0.01
    assert np.nanmean(everywhere[near]) > 0.7
    assert np.nanmean(everywhere[result.distance > 0.1]) < 0.1
