"""What register() says: whether to believe it, what to try, and what it left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import Criteria, PointCloud, se3
from hmrf_icp.field.paper import HiddenMarkovRandomField
from views import CAMERA, frame, heard, off, truth


@pytest.fixture(scope="module")
def right():
    return heard(frame(8), frame(0), truth(8, 0))


@pytest.fixture(scope="module")
def doubtful():
    """The desk on the corner of the room, which share nothing; near a start."""
    return heard(frame(58), frame(0), np.eye(4))


def test_a_pose_is_believed_from_a_half_on(right):
    result, said = right
    assert result.believed
    assert not said
    for confidence, believed in ((0.5, True), (0.49, False), (0.2, False)):
        other = replace(result, confidence=confidence)
        assert other.believed is believed
        assert ("NOT" in other.verdict) is not believed
        assert (other.advice is None) is believed


def test_who_is_more_likely_wrong_than_right_says_so_and_what_to_try(doubtful):
    result, said = doubtful
    assert not result.believed
    assert "more likely wrong than right" in said
    # Both cameras are known: there is no place to ask for.
    assert "stood" not in result.advice
    unknown = replace(result, target_view=hmrf_icp.PreparedCloud(PointCloud(np.eye(3))).seen_from)
    assert "sensor of target stood" in unknown.advice


def test_iterations_end_where_they_are_told_to():
    result, _ = heard(
        frame(8), frame(0), truth(8, 0), preset="paper", criteria=Criteria(0.0, 0.0, 3)
    )
    assert result.iterations == 3
    assert not result.converged


def test_em_that_ran_out_of_steps_is_said_to():
    hasty = HiddenMarkovRandomField(first_steps=1, steps=1)
    loose = Criteria(10.0, 10.0, 5)
    _, said = heard(frame(8), frame(0), preset="paper", rejector=hasty, criteria=loose)
    assert "before its labels settled" in said
    patient = HiddenMarkovRandomField(first_steps=600, steps=600)
    _, said = heard(frame(8), frame(0), preset="paper", rejector=patient, criteria=loose)
    assert "labels settled" not in said


class Nobody:
    """A rule under which nobody is an inlier."""

    def prepare(self, source, target):
        from hmrf_icp.loop.reject import Labels

        return lambda matches, before: Labels(np.full(matches.distance.shape, -1.0))


def test_too_few_inliers_to_go_on_are_said_to_be():
    _, said = heard(frame(8), frame(0), preset="paper", rejector=Nobody())
    assert "do not determine a motion" in said


def test_millimetres_beside_metres_are_said_to_be():
    away = np.random.default_rng(0).uniform(size=(300, 3))
    _, said = heard(away, 1000.0 * away, preset="paper", rejector="all")
    assert "millimetres" in said
    _, said = heard(away, 5.0 * away, preset="paper", rejector="all")
    assert "millimetres" not in said


@pytest.mark.parametrize("times", [39.37, 1000.0, 0.001])
def test_a_cloud_in_another_unit_is_not_believed(times):
    """Far off, views agree by chance with not a point on the other cloud; a speck always does."""
    result, said = heard(times * frame(8).observed_points, frame(0).observed_points)
    assert not result.believed
    assert "more likely wrong than right" in said
    assert "same unit" in said


def test_a_grid_of_points_tells_its_camera():
    points = CAMERA.unproject(frame(8).points[..., 2])
    result = hmrf_icp.register(points, frame(0), truth(8, 0))
    assert result.source_view.kind == "recovered"
    assert "pinhole 80 x 60, fx 73.0" in str(result.source_view)
    assert result.visibility.views
    assert off(result.transformation, truth(8, 0), frame(8)) < 0.005


def test_the_start_and_the_pose_are_between_the_frames_given():
    away = np.array([3e4, -2e4, 5e3])
    clouds = [
        PointCloud(frame(k).observed_points + shift, viewpoint=shift)
        for k, shift in ((8, away), (0, -0.5 * away))
    ]
    there, back = se3.rigid(np.eye(3), -0.5 * away), se3.rigid(np.eye(3), -away)
    true = there @ truth(8, 0) @ back
    result, _ = heard(*clouds, true)
    assert off(result.transformation, true, clouds[0]) < 0.005
    assert result.iterations == len(result.history)
    np.testing.assert_array_equal(
        [one.iteration for one in result.history], np.arange(1, result.iterations + 1)
    )


def test_correspondences_are_rows_of_the_clouds_given_and_the_closest_there_are():
    """Holes have rows too."""
    clouds = [frame(k).points.copy() for k in (8, 0)]
    clouds[0][:7, ::3] = clouds[1][5:20, 10:30] = np.nan
    result, _ = heard(*(PointCloud(c, camera=CAMERA) for c in clouds), truth(8, 0))
    source, target = (points.reshape(-1, 3) for points in clouds)
    rows, onto = result.correspondence_set.T
    gap = se3.transform(result.transformation, source[rows]) - target[onto]
    distance = np.linalg.norm(gap, axis=1)
    np.testing.assert_allclose(distance, result.distance.ravel()[rows], atol=1e-12)
    some = np.arange(0, len(rows), 97)
    moved = se3.transform(result.transformation, source[rows[some]])
    apart = np.linalg.norm(moved[:, None] - target[None], axis=2)
    np.testing.assert_allclose(distance[some], np.nanmin(apart, axis=1), atol=1e-12)
