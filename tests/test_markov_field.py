"""The field in general: the paper's is one of its settings, and any cloud has one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hmrf_icp
import synthetic
from hmrf_icp import Criteria, PointCloud, PreparedCloud, presets, se3
from hmrf_icp.errors import InputError
from hmrf_icp.field.beta import Schedule
from hmrf_icp.field.general import MarkovField, neighbours_of
from hmrf_icp.field.graph import PixelGrid, grid_graph
from hmrf_icp.field.paper import HiddenMarkovRandomField
from hmrf_icp.field.residuals import Gaussian
from hmrf_icp.loop.match import Matches
from shapes import both

SEED = st.integers(0, 1000)
# Point-to-point creeps along a smooth surface: the paper's threshold on a step stops it early.
PATIENT = Criteria(translation=1e-4, rotation=1e-4, max_iterations=100)
PAPER = MarkovField(
    residuals=("gaussian", "gaussian"),
    neighbours="grid",
    beta=2.0,
    update="simultaneous",
    share=0.5,
    initial=0.9,
    first_steps=600,
    steps=20,
    scale_floor=0.0,
)
VARIANTS = {
    "default": MarkovField(),
    "auto": MarkovField(residuals="auto"),
    "estimate": MarkovField(beta="estimate"),
    "simultaneous": MarkovField(beta=1.0, update="simultaneous", share=0.5),
    "logistic": MarkovField(residuals=("log-normal", "logistic")),
    "instances": MarkovField(residuals=(Gaussian(0.0, 1.0), "gamma")),
    "nearest": MarkovField(neighbours="nearest"),
    "ring": MarkovField(neighbours="ring"),
}


def clouds(seed=0, height=24, width=30):
    source, target = synthetic.pair(seed, height, width)
    return PointCloud(source), PointCloud(target)


def matches(distance, evidence=None):
    distance = np.asarray(distance, float)
    return Matches(np.zeros(distance.size, np.intp), distance, evidence)


@given(SEED)
@settings(max_examples=10, deadline=None)
def test_the_papers_field_is_one_setting_of_the_general_one(seed):
    source, target = clouds(seed)
    paper = hmrf_icp.register(source, target, preset="paper")
    general = hmrf_icp.register(source, target, preset="paper", rejector=PAPER)
    assert general.iterations == paper.iterations
    assert general.em_iterations == paper.em_iterations
    np.testing.assert_allclose(general.transformation, paper.transformation, atol=1e-9)
    np.testing.assert_allclose(general.inlier_probability, paper.inlier_probability, atol=1e-9)
    theirs, ours = paper.history[-1].parameters, general.history[-1].parameters
    for key, name in (
        ("mu_in", "inlier_mu"),
        ("sigma_in", "inlier_sigma"),
        ("mu_out", "outlier_mu"),
        ("sigma_out", "outlier_sigma"),
    ):
        assert ours[name] == pytest.approx(theirs[key], abs=1e-9)


def test_the_papers_own_rule_still_asks_for_a_grid():
    assert presets.PAPER.reject == HiddenMarkovRandomField()
    with pytest.raises(InputError, match="organised"):
        hmrf_icp.register(*unorganised(*clouds()), preset="paper", rejector="hmrf")


def unorganised(*some):
    return [PointCloud(cloud.observed_points) for cloud in some]


@pytest.mark.parametrize("name", VARIANTS)
def test_every_variant_finds_the_motion(name):
    source, target = clouds(1, 36, 44)
    result = hmrf_icp.register(
        source, target, preset="paper", rejector=VARIANTS[name], criteria=PATIENT
    )
    translation, rotation = se3.error(result.transformation, synthetic.TRUTH)
    assert translation < 0.03
    assert rotation < 0.03
    assert result.fitness == pytest.approx(0.6, abs=0.07)


def test_clouds_without_a_grid_have_a_field_too():
    source, target = clouds(1, 36, 44)
    result = hmrf_icp.register(
        *unorganised(source, target), preset="paper", rejector=presets.FIELD, criteria=PATIENT
    )
    translation, rotation = se3.error(result.transformation, synthetic.TRUTH)
    assert translation < 0.03
    assert rotation < 0.03
    assert result.fitness == pytest.approx(0.6, abs=0.07)
    by_name = hmrf_icp.register(
        *unorganised(source, target), preset="paper", rejector="field", criteria=PATIENT
    )
    np.testing.assert_array_equal(by_name.transformation, result.transformation)


@given(SEED, st.sampled_from(["simultaneous", "sequential"]))
@settings(max_examples=6, deadline=None)
def test_the_grid_and_its_graph_register_alike(seed, update):
    source, target = clouds(seed, 14, 18)
    model = MarkovField(update=update)
    on_grid = hmrf_icp.register(source, target, preset="paper", rejector=model)
    graph = grid_graph(source.observed)
    on_graph = hmrf_icp.register(
        source, target, preset="paper", rejector=replace(model, neighbours=graph)
    )
    np.testing.assert_allclose(on_graph.transformation, on_grid.transformation, atol=1e-9)


@pytest.mark.parametrize("name", VARIANTS)
def test_scaling_both_clouds_changes_no_label(name):
    source, target = clouds(2, 16, 20)
    distance = np.random.default_rng(0).gamma(1.0, 0.05, len(source))
    large = [PreparedCloud(PointCloud(1000 * cloud.points)) for cloud in (source, target)]
    here = VARIANTS[name].prepare(*both(source, target))(matches(distance), None)
    there = VARIANTS[name].prepare(*large)(matches(1000 * distance), None)
    np.testing.assert_allclose(there.z, here.z, atol=1e-6)
    assert there.em_iterations == here.em_iterations


@pytest.mark.parametrize("name", VARIANTS)
@pytest.mark.parametrize(
    "distance",
    [np.zeros(12), np.full(12, 0.3), np.r_[np.zeros(11), 1.0], np.r_[1e-300, np.ones(11) * 1e9]],
    ids=["zero", "equal", "one", "far"],
)
def test_nothing_gives_nan(name, distance):
    cloud = PointCloud(np.random.default_rng(0).normal(size=(3, 4, 3)))
    reject = VARIANTS[name].prepare(*both(cloud, cloud))
    labels = None
    for _ in range(4):
        labels = reject(matches(distance), labels)
        assert np.isfinite(labels.z).all()
        assert np.isfinite(list(labels.parameters.values())).all()
        assert (abs(labels.z) <= 1).all()


def test_evidence_decides_where_distances_do_not():
    cloud = PointCloud(np.random.default_rng(0).normal(size=(20, 20, 3)))
    rng = np.random.default_rng(1)
    distance = np.where(rng.random(400) < 0.5, abs(rng.normal(0, 0.05, 400)), rng.random(400))
    against = np.zeros(400)
    against[:200] = -8.0
    reject = MarkovField(beta=0.0, share=0.5).prepare(*both(cloud, cloud))
    plain, told = reject(matches(distance), None), reject(matches(distance, against), None)
    assert plain.inlier[:200].mean() > 0.4
    assert not told.inlier[:200].any()
    assert told.inlier[200:].mean() > 0.3
    certain = np.full(400, -np.inf)
    assert not reject(matches(distance, certain), None).inlier.any()
    with pytest.raises(InputError, match="label_log_odds"):
        reject(matches(distance, np.full(400, np.nan)), None)


def test_the_field_fills_what_its_neighbours_surround():
    cloud = PointCloud(np.random.default_rng(0).normal(size=(20, 20, 3)))
    distance = np.full((20, 20), 0.01)
    distance[:, 10:] = 0.9
    distance[5, 5], distance[5, 15] = 0.06, 0.02
    labels = MarkovField(beta=2.0, share=0.5).prepare(*both(cloud, cloud))(
        matches(distance.ravel()), None
    )
    inlier = labels.inlier.reshape(20, 20)
    assert inlier[:, :10].all()
    assert not inlier[:, 10:].any()


def test_beta_follows_its_schedule_and_is_reported():
    source, target = clouds(3)
    model = MarkovField(beta=Schedule(end=1.0, start=0.2, iterations=4))
    history = hmrf_icp.register(source, target, preset="paper", rejector=model).history
    for iteration in history:
        expected = 0.2 + 0.8 * min(iteration.iteration / 4, 1)
        assert iteration.parameters["beta"] == pytest.approx(expected)
        assert 0 < iteration.parameters["share"] < 1
        assert iteration.parameters["inlier_sigma"] > 0


def test_an_estimate_of_beta_is_positive_where_labels_agree():
    source, target = clouds(4, 36, 44)
    result = hmrf_icp.register(source, target, preset="paper", rejector=VARIANTS["estimate"])
    assert result.history[-1].parameters["beta"] > 0.3


def test_neighbours_are_those_of_the_cloud():
    source, _ = clouds()
    assert isinstance(neighbours_of(PreparedCloud(source)), PixelGrid)
    assert not isinstance(neighbours_of(PreparedCloud(*unorganised(source))), PixelGrid)
    with pytest.raises(InputError, match="organised"):
        neighbours_of(PreparedCloud(*unorganised(source)), "grid")
    with pytest.raises(InputError, match="observed"):
        neighbours_of(PreparedCloud(source), grid_graph(np.ones((2, 2), bool)))


def test_the_spacing_is_that_of_the_points():
    x, y = np.meshgrid(np.arange(50.0), np.arange(60.0))
    points = 0.02 * np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    assert PreparedCloud(PointCloud(points)).neighbour_distance == pytest.approx(0.02)


@pytest.mark.parametrize(
    "wrong",
    [
        {"residuals": ("half-normal",)},
        {"residuals": "half-normal"},
        {"residuals": ("half-normal", "cauchy")},
        {"neighbours": "eight"},
        {"beta": -1.0},
        {"beta": "guess"},
        {"update": "random"},
        {"share": 1.0},
        {"share": "guess"},
        {"initial": 0.0},
        {"steps": -1},
        {"scale_floor": -1.0},
        {"share_floor": 0.5},
    ],
    ids=str,
)
def test_a_parameter_out_of_range_is_named(wrong):
    name = "residual" if "residuals" in wrong else next(iter(wrong))
    with pytest.raises(InputError, match=name):
        MarkovField(**wrong)
