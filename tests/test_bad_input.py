"""Bad input gets an error that names the argument, what was found and what was expected."""

from __future__ import annotations

import warnings
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import hmrf_icp
import synthetic
from hmrf_icp import Criteria, InputError, PinholeCamera, PointCloud, RegistrationWarning, presets
from hmrf_icp.loop.reject import Labels

register = partial(hmrf_icp.register, preset="paper")
"""These are statements about the paper's method and its parts."""

CAMERA = PinholeCamera(width=24, height=18, fx=20.0, fy=20.0, cx=11.5, cy=8.5)


@pytest.fixture
def clouds():
    return synthetic.pair(0)


def few(count):
    points = np.full((4, 5, 3), np.nan)
    points.reshape(-1, 3)[:count] = np.random.default_rng(0).normal(size=(count, 3))
    return points


@pytest.mark.parametrize("name", ["source", "target"])
@pytest.mark.parametrize(
    ("cloud", "says"),
    [
        (few(9), "9 observed points of 20, expected at least 10"),
        (np.full((4, 5, 3), np.nan), "0 observed points of 20"),
        (np.empty((0, 3)), "0 observed points of 0"),
        (np.zeros((0, 0, 3)), "0 observed points of 0"),
        (np.ones((4, 5, 3)), "all 20 points are the same"),
        (np.full((4, 5, 3), 1e-3), "all 20 points are the same"),
        (np.full((4, 5, 3), 1e6) * [1, 2, 3], "all 20 points are the same"),
        (np.arange(20.0).reshape(4, 5, 1) * [1, 2, 3], "on one line"),
        (np.arange(20.0).reshape(4, 5, 1) * [0.1, 0.2, 0.3] + [1e2, 7, -3], "on one line"),
        (
            (np.arange(20).reshape(4, 5, 1) * [0.1, 0.2, 0.3]).astype(np.float32),
            "on one line",
        ),
        (few(20) * 1e200, "a coordinate of .*e\\+200"),
        (np.zeros((4, 5)), r"expected shape \(N, 3\) or \(H, W, 3\), got \(4, 5\)"),
        (np.zeros((4, 5, 4)), r"got \(4, 5, 4\)"),
        (np.zeros(30), r"got \(30,\)"),
        (5, "got int"),
        ("cloud.ply", "no such file"),
        (None, "source|target"),
        ([[1, 2, 3], [4, 5]], "expected a PointCloud"),
        (np.array([["a", "b", "c"]]), "expected a PointCloud"),
    ],
)
def test_a_cloud_that_cannot_be_registered(clouds, name, cloud, says):
    source, target = clouds
    arguments = {"source": source, "target": target, name: cloud}
    with pytest.raises(InputError, match=says) as error:
        register(**arguments)
    assert str(error.value).startswith(f"{name}: ")


@pytest.mark.parametrize("nothing", [np.nan, np.inf, -np.inf])
def test_points_that_are_not_finite_are_unobserved_and_no_error(clouds, nothing):
    source, target = clouds
    expected = register(source, target)
    holes = np.isnan(source[..., 0])
    one_coordinate = np.where(np.isnan(source), 0.3, source)
    one_coordinate[holes, 1] = nothing
    found = register(one_coordinate, np.where(np.isnan(target), nothing, target))
    np.testing.assert_array_equal(found.transformation, expected.transformation)
    assert np.isnan(found.inlier_probability[holes]).all()
    assert np.isnan(found.distance[holes]).all()
    assert np.isfinite(found.inlier_probability[~holes]).all()
    assert np.isfinite(found.distance[~holes]).all()


def test_ten_points_are_enough(clouds):
    # Whatever becomes of them, no NaN comes out.
    _, target = clouds
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RegistrationWarning)
        result = register(few(10), target)
    assert np.isfinite(result.transformation).all()
    assert np.isfinite(result.inlier_rmse)


@pytest.mark.parametrize(
    "init", [np.eye(3), np.diag([2.0, 2, 2, 1]), np.diag([1.0, 1, -1, 1]), np.full((4, 4), np.nan)]
)
def test_a_start_that_is_not_rigid(clouds, init):
    with pytest.raises(InputError, match=r"^init: "):
        register(*clouds, init=init)


def test_metres_and_millimetres_mixed_up_get_a_warning(clouds):
    source, target = clouds
    with pytest.warns(RegistrationWarning, match=r"millimetres.*metres") as caught:
        register(source, 1000.0 * target)
    assert caught[0].filename == __file__
    with pytest.warns(RegistrationWarning, match=r"millimetres.*metres"):
        register(1000.0 * source, target)


def test_clouds_of_the_same_units_get_none(clouds):
    source, target = clouds
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        register(source, target)
        register(source, 10.0 * target)


@pytest.mark.parametrize("rejector", [None, "hmrf"])
def test_the_paper_needs_an_organised_source_and_says_so(clouds, rejector):
    source, target = clouds
    with pytest.raises(InputError, match=r"source: .*organised.*\(H, W, 3\)"):
        register(source.reshape(-1, 3), target, preset="paper", rejector=rejector)


@pytest.mark.parametrize("rejector", ["all", "percent", "sigma", "x84", "dynamic"])
def test_the_other_rules_take_any_source(clouds, rejector):
    source, target = clouds
    grid = register(source, target, rejector=rejector)
    flat = register(source.reshape(-1, 3), target, rejector=rejector)
    np.testing.assert_array_equal(flat.transformation, grid.transformation)
    assert flat.inlier_probability.shape == (source.shape[0] * source.shape[1],)


@pytest.mark.parametrize(
    "wrong",
    [{"preset": "papr"}, {"preset": 5}, {"rejector": "ransac"}],
)
def test_an_unknown_name_lists_the_known_ones(clouds, wrong):
    known = "paper" if "preset" in wrong else "hmrf, all, percent, sigma, x84, dynamic"
    with pytest.raises(InputError, match=f"{next(iter(wrong))}: unknown .*{known}"):
        register(*clouds, **wrong)


@pytest.mark.parametrize(
    "wrong", [{"translation": -1.0}, {"rotation": np.nan}, {"max_iterations": -1}]
)
def test_criteria_that_nothing_meets_by_mistake(wrong):
    with pytest.raises(InputError, match=f"criteria: .*{next(iter(wrong))}"):
        Criteria(**wrong)


class NobodyIsAnInlier:
    def prepare(self, source, target):
        return lambda matches, before: Labels(np.full_like(matches.distance, -1.0))


def test_no_inliers_end_the_registration_with_a_warning_and_without_nan(clouds):
    source, target = clouds
    with pytest.warns(RegistrationWarning, match="0 inliers among .* do not determine a motion"):
        result = register(source, target, rejector=NobodyIsAnInlier())
    assert not result.converged
    assert result.iterations == 0
    assert result.fitness == 0.0
    assert result.correspondence_set.shape == (0, 2)
    assert result.inlier_rmse == 0.0
    np.testing.assert_array_equal(result.transformation, np.eye(4))


def test_no_iterations_return_the_start_and_the_first_field(clouds):
    source, target = clouds
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = register(source, target, init=synthetic.TRUTH, criteria=Criteria(max_iterations=0))
    assert (result.converged, result.iterations, result.history) == (False, 0, ())
    assert result.em_iterations > 0
    np.testing.assert_allclose(result.transformation, synthetic.TRUTH, atol=1e-14)
    assert 0 < result.overlap <= 1


def test_no_em_steps_leave_the_first_guess(clouds):
    source, target = clouds
    frozen = replace(presets.PAPER.reject, first_steps=0, steps=0)
    result = register(source, target, rejector=frozen)
    assert result.em_iterations == 0
    assert result.fitness == pytest.approx(0.9, abs=0.01)


# Depth maps and cameras ------------------------------------------------------------------------


def depth_map(dtype=np.uint16):
    return np.full((18, 24), 1500).astype(dtype)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"depth": np.zeros((18, 24, 3), np.uint16)}, "depth: expected one channel"),
        ({"depth": depth_map(np.uint8)}, "depth: uint8 holds 256 values"),
        ({"depth": depth_map(bool)}, "depth: expected integers or floating point, got bool"),
        ({"depth": depth_map(complex)}, "depth: .*complex128"),
        ({"depth": np.full((18, 24), "far")}, "depth: expected integers or floating point"),
        ({"depth": depth_map()[:, :20]}, "intrinsics are for 24 x 18 pixels.*20 x 18"),
        ({"depth_scale": 0.0}, "depth_scale: expected a positive.*got 0"),
        ({"depth_scale": -1000.0}, "depth_scale: expected a positive.*got -1000"),
        ({"depth_scale": np.nan}, "depth_scale: "),
        ({"depth_scale": np.inf}, "depth_scale: "),
        ({"max_depth": 0.0}, "max_depth: "),
        ({"max_depth": -1.0}, "max_depth: "),
        ({"max_depth": np.nan}, "max_depth: "),
    ],
)
def test_a_depth_map_that_is_none(arguments, says):
    with pytest.raises(InputError, match=says):
        PointCloud.from_depth(**{"depth": depth_map(), "camera": CAMERA, **arguments})


@pytest.mark.parametrize(
    "wrong",
    [
        {"fx": 0.0},
        {"fy": -1.0},
        {"fx": np.nan},
        {"cx": np.inf},
        {"width": 0},
        {"height": -3},
        {"cy": "middle"},
    ],
)
def test_a_camera_that_cannot_be_one(wrong):
    good = {"width": 24, "height": 18, "fx": 20.0, "fy": 20.0, "cx": 11.5, "cy": 8.5}
    with pytest.raises(InputError, match=r"^camera: "):
        PinholeCamera(**{**good, **wrong})


@pytest.mark.parametrize(
    "matrix",
    [
        np.eye(4),
        np.zeros((3, 3)),
        [[20, 1, 11], [0, 20, 8], [0, 0, 1]],
        [[20, 0, 11], [0, 20, 8], [0, 0, 2]],
        np.full((3, 3), np.nan),
        np.diag([0.0, 20.0, 1.0]),
    ],
)
def test_a_matrix_that_is_no_camera(matrix):
    with pytest.raises(InputError, match=r"^camera: "):
        PinholeCamera.from_matrix(matrix, 24, 18)


def test_a_camera_of_another_size_than_the_cloud():
    points = np.zeros((10, 12, 3))
    with pytest.raises(InputError, match="24 x 18 pixels, the cloud has 12 x 10"):
        PointCloud(points, CAMERA)
    with pytest.raises(InputError, match="not organised"):
        PointCloud(points.reshape(-1, 3), CAMERA)


@pytest.mark.parametrize("viewpoint", [[0.0, 1.0], [np.nan, 0.0, 0.0]])
def test_a_viewpoint_that_is_no_place(viewpoint):
    with pytest.raises(InputError, match="viewpoint: expected three finite numbers"):
        PointCloud(np.zeros((10, 3)), viewpoint=viewpoint)


def test_a_step_that_keeps_nothing():
    with pytest.raises(InputError, match="subsample: "):
        PointCloud(np.zeros((10, 3))).subsample(0)
