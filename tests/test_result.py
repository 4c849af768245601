"""What a registration says of itself is so: of the points given and of the pose returned."""

import copy
import dataclasses
import pickle
import warnings
from functools import cache

import numpy as np
import pytest
from scipy.spatial import cKDTree

import hmrf_icp
import synthetic
from hmrf_icp import FreeMotion, PinholeCamera, PointCloud, RegistrationWarning, se3
from hmrf_icp.clouds.sensor_view import SensorView
from hmrf_icp.frozen import FrozenDict
from hmrf_icp.loop.reject import Labels
from hmrf_icp.synthetic import render, scenes

CAMERA = PinholeCamera(160, 120, 146.0, 146.0, 79.5, 59.5)
LARGE = PinholeCamera(320, 240, 292.0, 292.0, 159.5, 119.5)
POSES = scenes.trajectory("desk", 60)
TURNED = se3.rotation_about([0.3, 1.0, 0.2], np.radians(12.0), [0.0, 0.0, 1.5])


@cache
def depth(index, camera=CAMERA):
    return render.render(scenes.desk(), camera, POSES[index])


@cache
def cloud(index, noise=0.0, camera=CAMERA):
    seen = depth(index, camera)
    seen = seen + np.random.default_rng(index).normal(0.0, noise, seen.shape)
    return PointCloud.from_depth(seen, camera, depth_scale=1.0)


@cache
def pair():
    """Views of a desk of more points than the search looks at."""
    return hmrf_icp.register(cloud(4, 1e-3, LARGE), cloud(0, 1e-3, LARGE))


def alike(change):
    points = cloud(0).observed_points
    return change(se3.transform(se3.inverse(TURNED), points)), change(points)


# Overlap -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "change",
    [lambda p: p, lambda p: p.astype(np.float32), lambda p: p.round(4)],
    ids=["float64", "float32", "four decimals"],
)
@pytest.mark.parametrize("rejector", [None, "field"])
def test_a_moved_copy_overlaps_altogether(change, rejector):
    source, target = alike(change)
    result = hmrf_icp.register(source, target, rejector=rejector)
    assert result.believed
    assert result.overlap > 0.995
    assert result.fitness > 0.95
    assert result.inlier_rmse < 1e-4


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_a_view_overlaps_itself_altogether(noise):
    result = hmrf_icp.register(cloud(0, noise), cloud(0))
    assert result.overlap > 0.995
    assert result.fitness > 0.95


@pytest.mark.parametrize("sparse", ["source", "target"])
def test_how_dense_a_cloud_is_does_not_matter_to_overlap(sparse):
    from hmrf_icp.clouds.overlap import overlap

    many = cloud(0, 0.0, LARGE).observed_points
    few = many[np.random.default_rng(0).choice(len(many), 400, replace=False)]
    source, target = (few, many) if sparse == "source" else (many, few)
    assert overlap(hmrf_icp.prepare(source), hmrf_icp.prepare(target), np.eye(4)) > 0.95


def test_half_of_a_wavy_sheet_overlaps_half():
    u, v = np.random.default_rng(0).uniform(size=(2, 20_000))
    sheet = np.stack([u, v, 0.1 * np.sin(7 * u) * np.cos(5 * v)], axis=-1)
    half = sheet[sheet[:, 0] < 0.5]
    prepared = hmrf_icp.prepare(sheet), hmrf_icp.prepare(half[::3])
    from hmrf_icp.clouds.overlap import overlap

    # A counterpart is within two spacings of the target's points and the noise, 0.028 here, also
    # at its edge; 4,000 points are asked, of whose share 0.01 is a deviation.
    assert overlap(*prepared, np.eye(4)) == pytest.approx(0.528, abs=0.03)
    assert overlap(*prepared[::-1], np.eye(4)) > 0.99


def test_what_is_hidden_or_faces_the_other_way_is_no_overlap():
    from hmrf_icp.clouds.overlap import overlap

    v, u = np.mgrid[:60, :80] / 40.0
    front = np.stack([u, v, np.full(u.shape, 2.0)], axis=-1)
    back = front + np.array([0.0, 0.0, 0.03])
    one = PointCloud(front, viewpoint=np.zeros(3))
    other = PointCloud(back, viewpoint=np.array([0.0, 0.0, 4.0]))
    assert overlap(hmrf_icp.prepare(one), hmrf_icp.prepare(other), np.eye(4)) < 0.01
    wall = PointCloud(front + np.array([0.0, 0.0, 0.5]), viewpoint=np.zeros(3))
    assert overlap(hmrf_icp.prepare(one), hmrf_icp.prepare(wall), np.eye(4)) == 0.0


# Points ------------------------------------------------------------------------------------------


def test_distances_are_exact_at_every_point_and_of_the_pose_returned():
    result, source, target = pair(), cloud(4, 1e-3, LARGE), cloud(0, 1e-3, LARGE)
    assert result.distance.shape == result.inlier_probability.shape == source.shape
    np.testing.assert_array_equal(np.isnan(result.distance), ~source.observed)
    moved = se3.transform(result.transformation, source.observed_points)
    closest, _ = cKDTree(target.observed_points).query(moved)
    np.testing.assert_allclose(result.distance[source.observed], closest, atol=1e-12)
    kept = result.distance[result.inlier_probability > 0.5]
    assert result.inlier_rmse == pytest.approx(np.sqrt(np.mean(kept**2)))
    assert result.fitness == pytest.approx(len(kept) / len(source))


def test_correspondences_are_rows_of_the_clouds_as_given():
    result, source, target = pair(), cloud(4, 1e-3, LARGE), cloud(0, 1e-3, LARGE)
    rows, onto = result.correspondence_set.T
    assert len(rows) == np.count_nonzero(result.inlier_probability > 0.5)
    moved = se3.transform(result.transformation, source.points.reshape(-1, 3)[rows])
    gap = np.linalg.norm(moved - target.points.reshape(-1, 3)[onto], axis=1)
    np.testing.assert_allclose(gap, result.distance.ravel()[rows], atol=1e-12)


# Values ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("again", [lambda x: pickle.loads(pickle.dumps(x)), copy.deepcopy])
def test_a_result_pickles_copies_and_compares(again):
    result = pair()
    other = again(result)
    assert other == result
    assert hash(other) == hash(result)
    assert repr(other) == repr(result)
    np.testing.assert_array_equal(other.distance, result.distance)
    np.testing.assert_array_equal(other.correspondence_set, result.correspondence_set)
    assert other != dataclasses.replace(result, centre=result.centre + 1.0)
    assert len(pickle.dumps(result)) < 40 * result.distance.size, "no cloud goes along"


@pytest.mark.parametrize(
    "value",
    [
        Labels(np.ones(3), parameters={"sigma": 0.5}).parameters,
        FreeMotion(np.arange(6.0)),
        hmrf_icp.presets.ROBUST,
        hmrf_icp.presets.PAPER,
        hmrf_icp.Visibility(1, 2, 3, 4, 5),
        hmrf_icp.Iteration(1, 2, 0.5, 0.1, 0.1, 0.2, {"threshold": 1.0}),
    ],
    ids=lambda value: type(value).__name__,
)
def test_every_value_pickles_copies_and_compares(value):
    assert pickle.loads(pickle.dumps(value)) == copy.deepcopy(value) == value


def test_parameters_cannot_be_changed():
    parameters = FrozenDict({"sigma": 0.5})
    assert parameters == {"sigma": 0.5}
    with pytest.raises(TypeError):
        parameters["sigma"] = 1.0


# What is said ------------------------------------------------------------------------------------


def test_what_is_believed_is_said_first():
    result = pair()
    assert result.believed
    assert str(result).startswith("Registration: to be believed, confidence 0.9")
    assert repr(result).startswith("RegistrationResult(to be believed, confidence 0.9")
    assert result.advice is None


def test_what_is_not_believed_warns_and_says_what_to_try():
    rng = np.random.default_rng(0)
    source, target = (PointCloud(rng.normal(size=(2000, 3))) for _ in range(2))
    with pytest.warns(RegistrationWarning, match=r"confidence 0\.\d\d.*likely wrong") as caught:
        result = hmrf_icp.register(source, target)
    assert caught[0].filename == __file__
    assert not result.believed
    assert "NOT convincing" in str(result).splitlines()[0]
    assert "viewpoint" in result.advice
    known = dataclasses.replace(result, source_view=SensorView("given", ""))
    assert "of target stood" in known.advice


def test_a_method_without_a_confidence_says_so():
    source, target = synthetic.pair(3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RegistrationWarning)
        result = hmrf_icp.register(source, target, preset="paper")
    assert result.believed == result.converged
    assert "no confidence" in str(result)


class NeverSettles:
    def prepare(self, source, target):
        return lambda matches, before: Labels(np.ones(matches.distance.size), 3, {}, False)


def test_em_that_stopped_early_is_told_of():
    source, target = synthetic.pair(3)
    with pytest.warns(RegistrationWarning, match="EM of the last decision stopped after 3 steps"):
        hmrf_icp.register(source, target, preset="paper", rejector=NeverSettles())


def test_history_counts_the_iterations_that_led_to_the_pose():
    seen = []
    result = hmrf_icp.register(cloud(4, 1e-3), cloud(0, 1e-3), on_iteration=seen.append)
    assert [one.iteration for one in result.history] == list(range(1, result.iterations + 1))
    assert sum(one.em_iterations for one in result.history) == result.em_iterations
    told = iter(seen)
    assert all(one in told for one in result.history), "each was told of, in this order"
