"""The story of a registration says what the registration did."""

from __future__ import annotations

import base64
import copy
import json
import zlib
from dataclasses import replace

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import InputError, Iteration, PointCloud, se3
from hmrf_icp.figures.states import follows
from hmrf_icp.search.visibility import AGREE, FRONT
from hmrf_icp.view import Recording, story
from hmrf_icp.view.packed import packed
from hmrf_icp.view.page import page
from hmrf_icp.view.steps import steps
from shapes import CAMERA


def iteration(number, turn, before=None):
    """An iteration that turned by so much from where another ended."""
    start = np.eye(4) if before is None else before.transformation
    pose = se3.rigid(se3.rotation_exp((0.0, 0.0, turn)), np.zeros(3)) @ start
    return Iteration(number, 1, 0.5, 0.0, turn, 0.1, {}, pose)


def chain(numbers, turn, before=None):
    made = []
    for number in numbers:
        before = iteration(number, turn, before)
        made.append(before)
    return made


# --- the timeline -----------------------------------------------------------------------------


def test_the_timeline_goes_from_the_start_to_the_result_and_the_true_pose(told, found, pair):
    moments = told.moments
    assert [moments[0].title, moments[told.result].title] == ["Start", "Result"]
    np.testing.assert_array_equal(moments[0].pose, np.eye(4))
    np.testing.assert_allclose(moments[told.result].pose, found.transformation)
    assert moments[-1].title == "True pose"
    np.testing.assert_allclose(moments[-1].pose, pair.truth)


def test_what_led_to_the_result_is_marked_and_so_is_what_did_not(told, found):
    middle = told.moments[1 : told.result]
    assert sum(moment.chosen for moment in middle) == found.iterations
    assert any(not moment.chosen for moment in middle)
    assert {m.run for m in middle} == set(range(1, max(m.run for m in middle) + 1))


def test_every_iteration_says_the_pose_that_it_led_to(found, recording):
    np.testing.assert_allclose(found.history[-1].transformation, found.transformation)
    assert all(one.transformation.shape == (4, 4) for one in recording.iterations)


def test_runs_are_told_apart_by_their_numbers_and_by_how_far_they_turned():
    first, second = chain([1, 2, 3], 0.1), chain([1, 2, 3], 0.2)
    refined = chain([4, 5], 0.05, first[-1])
    assert follows(first[0], first[1])
    assert not follows(second[-1], refined[0])
    told = steps(np.eye(4), refined[-1].transformation, first + refined, first + second + refined)
    assert [step.title for step in told[1:-1]] == [
        *(f"Candidate 1, iteration {n}" for n in (1, 2, 3)),
        *(f"Candidate 2, iteration {n}" for n in (1, 2, 3)),
        *(f"Candidate 1 refined, iteration {n}" for n in (4, 5)),
    ]
    assert [step.chosen for step in told] == [True] * 4 + [False] * 3 + [True] * 3


def test_where_there_is_too_much_to_tell_the_way_to_the_result_is_told_in_full():
    beside, path = chain(range(1, 201), 0.01), chain(range(1, 21), 0.02)
    told = steps(np.eye(4), path[-1].transformation, path, beside + path, most=50)
    assert len(told) == 50
    assert sum(step.chosen for step in told[1:-1]) == 20


def test_without_a_recording_the_way_to_the_result_is_told(found):
    told = story(found)
    assert len(told.moments) == found.iterations + 2
    assert all(moment.chosen for moment in told.moments)


# --- what is shown of the points --------------------------------------------------------------


def test_distances_and_labels_at_the_result_are_those_of_the_result(told, found):
    shown = told.moments[told.result].distance
    expected = found.distance[np.isfinite(found.distance)]
    np.testing.assert_allclose(shown, expected, rtol=1e-5, atol=1e-7)
    labels = found.inlier_probability[np.isfinite(found.inlier_probability)]
    np.testing.assert_allclose(told.probability, labels, atol=1e-6)
    assert all(abs(moment.histogram.sum() - 1.0) < 1e-9 for moment in told.moments)


def test_the_true_pose_violates_no_free_space_and_the_start_does(told):
    start, end = told.moments[0], told.moments[-1]
    assert told.views
    assert np.mean(end.of_source == FRONT) < 0.005
    assert np.mean(end.of_source == AGREE) > 0.3
    both = np.concatenate([start.of_source, start.of_target])
    assert np.mean(both == FRONT) > 0.2
    assert len(told.rays(start)) > 50


def test_rays_go_from_a_viewpoint_to_a_point_in_free_space(told):
    start = told.moments[0]
    rays = told.rays(start)
    sensors = np.array([told.target.viewpoint, start.pose[:3, 3]])
    assert (np.abs(rays[:, 0, None] - sensors).max(axis=2).min(axis=1) < 1e-9).all()
    points = np.concatenate(
        [
            se3.transform(start.pose, told.source.points[start.of_source == FRONT].astype(float)),
            told.target.points[start.of_target == FRONT],
        ]
    )
    away = np.linalg.norm(rays[:, 1, None] - points, axis=2).min(axis=1)
    assert (away < 1e-6).all()


def test_the_image_holds_every_observed_pixel(told, pair):
    assert told.image.shape == pair.source.shape
    np.testing.assert_array_equal(told.image >= 0, pair.source.observed)
    row = told.image[30, 40]
    np.testing.assert_allclose(told.source.points[row], pair.source.points[30, 40], atol=1e-6)


def test_large_clouds_are_thinned_and_it_is_said(found):
    told = story(found, points=500)
    assert len(told.source.points) <= 500
    assert told.source.count.endswith(f"of {told.source.total:,} points")
    assert told.image.max() < len(told.source.points)
    assert ((told.probability >= 0) & (told.probability <= 1)).all()


def test_far_from_the_origin_the_picture_is_the_same(pair):
    far = np.array([4.0e6, 5.0e6, 300.0])
    clouds = (pair.source.observed_points, pair.target.observed_points)
    near, moved = Recording(), Recording()
    one = story(hmrf_icp.register(*clouds, pair.truth, on_iteration=near), pair.truth, near)
    start = pair.truth.copy()
    start[:3, 3] += far - start[:3, :3] @ far
    result = hmrf_icp.register(*(cloud + far for cloud in clouds), start, on_iteration=moved)
    other = story(result, start, moved)
    assert np.abs(other.source.points).max() < 100.0
    where = [
        se3.transform(told.moments[told.result].pose, told.source.points.astype(float))
        + told.target.origin
        for told in (one, other)
    ]
    np.testing.assert_allclose(where[1].mean(axis=0) - far, where[0].mean(axis=0), atol=0.01)


def test_what_slides_is_drawn_through_the_clouds():
    rng = np.random.default_rng(0)
    flat = np.full((60, 80), 2.0)
    clouds = [
        PointCloud.from_depth(flat + off + 0.002 * rng.normal(size=flat.shape), CAMERA)
        for off in (0.0, 0.02)
    ]
    with pytest.warns(hmrf_icp.RegistrationWarning):
        result = hmrf_icp.register(*clouds, np.eye(4))
    told = story(result)
    assert sorted(one.rotation for one in told.said.free) == [False, False, True]
    for one in told.said.free:
        assert abs(one.through[2] - 2.0) < 0.1
    assert told.said.believed is False


def test_a_copy_of_a_result_has_nothing_to_show(found):
    with pytest.raises(InputError, match="a copy"):
        story(copy.deepcopy(found))


# --- the page ---------------------------------------------------------------------------------


def test_the_page_holds_the_points_as_they_are(told):
    head, block = packed(told)
    head, block = json.loads(head), zlib.decompress(base64.b64decode(block))
    place = head["source"]["points"]
    points = np.frombuffer(block, "<f4", place["count"], place["at"]).reshape(-1, 3)
    np.testing.assert_array_equal(points, told.source.points)
    place = head["moments"][head["result"]]["distance"]
    level = np.frombuffer(block, "u1", place["count"], place["at"]) / 255
    low, high = np.log(told.edges[[0, -1]])
    expected = np.clip(told.moments[told.result].distance, told.edges[0], told.edges[-1])
    np.testing.assert_allclose(np.exp(low + level * (high - low)), expected, rtol=0.02)


def test_names_of_files_are_text_whatever_is_in_them(told):
    evil = '</script><script>alert("{{ block }}")</script>'
    text = page(replace(told, source=replace(told.source, name=evil)))
    assert "<script>alert" not in text
    assert text.count("</script>") == 3


def test_the_page_is_small_enough_to_send(told):
    assert len(page(told)) < 2_000_000
