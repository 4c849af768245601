"""The default preset on rendered views of the desk: no option is given anywhere."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import hmrf_icp
import shapes
from hmrf_icp import presets, se3
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.clouds.surface import evenly
from hmrf_icp.loop.align import Step
from hmrf_icp.loop.match import NearestNeighbour
from hmrf_icp.loop.placed import Placed
from hmrf_icp.search.confidence import confidence
from hmrf_icp.search.visibility import VisibilityTest
from hmrf_icp.search.visible_match import VisibleMatch
from hmrf_icp.synthetic import render, scenes
from shapes import both
from views import loose

CAMERA = hmrf_icp.PinholeCamera(width=160, height=120, fx=146.25, fy=146.25, cx=79.75, cy=59.75)
POSES = scenes.trajectory("desk", 60)
FAR_START = (np.pi / 6, 0.3)


@cache
def frame(index, scale=1.0):
    depth = render.render(scenes.desk(), CAMERA, POSES[index])
    seen = render.sensor_noise(depth, CAMERA, np.random.default_rng(index))
    return hmrf_icp.PointCloud.from_depth(seen / (1000.0 / scale), CAMERA)


def true_motion(source, target):
    return se3.inverse(POSES[target]) @ POSES[source]


def perturbed(source, target, angle, shift, seed=0):
    truth = true_motion(source, target)
    axis, direction = np.random.default_rng(seed).normal(size=(2, 3))
    centre = se3.transform(truth, frame(source).observed_points).mean(axis=0)
    start = se3.rotation_about(axis, angle, centre) @ truth
    start[:3, 3] += shift * direction / np.linalg.norm(direction)
    return start


@pytest.mark.parametrize(("source", "target"), [(4, 0), (10, 2), (20, 12)])
def test_finds_the_pose_from_thirty_degrees_and_thirty_centimetres_off(source, target):
    result = hmrf_icp.register(frame(source), frame(target), perturbed(source, target, *FAR_START))
    metres, radians = se3.error(result.transformation, true_motion(source, target))
    assert metres < 0.02
    assert radians < 0.01
    assert result.converged
    assert result.confidence > 0.8


def test_the_default_is_the_robust_preset():
    assert presets.DEFAULT == "robust"
    assert presets.names()[0] == "robust"


@pytest.mark.parametrize(("factor", "allowed"), [(8.0, 1e-12), (10.0, 2e-4), (0.01, 2e-4)])
def test_a_scene_in_other_units_is_registered_in_the_same_way(factor, allowed):
    # By a power of two nothing is rounded; otherwise a match may flip, and the loop stop elsewhere.
    start = perturbed(6, 0, np.pi / 10, 0.1)
    here = hmrf_icp.register(frame(6), frame(0), start)
    start[:3, 3] *= factor
    there = hmrf_icp.register(frame(6, factor), frame(0, factor), start)
    back = there.transformation.copy()
    back[:3, 3] /= factor
    np.testing.assert_allclose(back, here.transformation, atol=allowed)
    assert there.overlap == pytest.approx(here.overlap, abs=1e-3)
    assert there.confidence == pytest.approx(here.confidence, abs=1e-3)


def test_two_runs_give_the_same_answer():
    start = perturbed(6, 0, np.pi / 10, 0.0)
    one, two = (hmrf_icp.register(frame(6), frame(0), start) for _ in range(2))
    np.testing.assert_array_equal(one.transformation, two.transformation)
    np.testing.assert_array_equal(one.inlier_probability, two.inlier_probability)


def test_clouds_without_a_grid_or_a_viewpoint_are_registered_too():
    source = hmrf_icp.PointCloud(loose(frame(3).observed_points))
    target = hmrf_icp.PointCloud(loose(frame(0).observed_points))
    result = hmrf_icp.register(source, target, perturbed(3, 0, np.pi / 30, 0.05))
    metres, radians = se3.error(result.transformation, true_motion(3, 0))
    assert metres < 0.02
    assert radians < 0.01
    assert result.inlier_probability.shape == source.shape
    assert result.visibility.views  # the origin is recovered as the viewpoint of both
    assert result.source_view.kind == result.target_view.kind == "recovered"
    assert "viewpoint" in result.source_view.text


def test_a_full_resolution_pair_has_a_label_at_every_observed_pixel():
    camera = replace(CAMERA, width=320, height=240, fx=292.5, fy=292.5, cx=159.5, cy=119.5)
    source, target = (
        hmrf_icp.PointCloud.from_depth(render.render(scenes.desk(), camera, POSES[i]), camera)
        for i in (4, 0)
    )
    result = hmrf_icp.register(source, target)
    assert result.inlier_probability.shape == (240, 320)
    np.testing.assert_array_equal(np.isnan(result.inlier_probability), ~source.observed)
    assert 0.0 < result.overlap < 1.0


def test_views_that_share_nothing_are_not_believed():
    turned = se3.rotation_about([0.0, 1.0, 0.0], np.pi, POSES[0][:3, 3]) @ POSES[0]
    depth = render.render(scenes.desk(), CAMERA, turned)
    if not np.isfinite(depth).any():
        pytest.skip("nothing stands behind the camera in this scene")
    source = hmrf_icp.PointCloud.from_depth(depth, CAMERA)
    assert hmrf_icp.register(source, frame(0)).confidence < 0.5


def test_the_true_pose_violates_no_free_space_and_a_wrong_one_does():
    judge = VisibilityTest(*both(frame(4), frame(0)), 2000)
    truth = true_motion(4, 0)
    off = truth.copy()
    off[2, 3] -= 0.3
    right, wrong = judge(truth), judge(off)
    assert right.front <= 0.01 * right.agree
    assert wrong.front > 10 * right.front + 10
    assert confidence(right) > confidence(wrong)


def test_a_view_tells_front_from_behind_from_outside():
    view = PreparedCloud(frame(0)).range_image
    surface = PreparedCloud(frame(0)).surface
    rows = evenly(surface, 500)
    points, normals = surface.points[rows], surface.normals[rows]
    ask = lambda scale: np.bincount(  # noqa: E731
        view.ask(points * scale, normals, np.eye(4)), minlength=5
    )
    same, nearer, farther = ask(1.0), ask(0.6), ask(1.5)
    assert same[0] == len(rows)
    assert nearer[1] > 0.9 * len(rows)
    assert farther[2] > 0.8 * len(rows)
    behind_the_camera = view.ask(-points, normals, np.eye(4))
    assert (behind_the_camera == 3).all()


def test_evidence_speaks_against_what_the_target_could_not_see():
    source, target = frame(8), frame(0)
    placed = Placed.at(true_motion(8, 0), source.observed_points)
    matches = VisibleMatch(NearestNeighbour()).prepare(
        PreparedCloud(source), PreparedCloud(target)
    )(placed)
    u, v, _ = CAMERA.project(placed.points)
    outside = ~((u > -2) & (u < 161) & (v > -2) & (v < 121))
    assert outside.any()
    assert (matches.label_log_odds[outside] < 0).mean() > 0.95


def test_a_label_forgives_what_a_bent_depth_map_is_off_by():
    noise = 0.003
    wall = 2.0 + np.random.default_rng(0).normal(0.0, noise, (120, 160))
    target = hmrf_icp.PointCloud.from_depth(wall, CAMERA)
    source = hmrf_icp.PointCloud.from_depth(wall - 8.0 * noise, CAMERA)
    placed = Placed.at(np.eye(4), source.observed_points)
    against = {
        band: (
            VisibleMatch(band=band).prepare(*both(source, target))(placed).label_log_odds < -4.0
        ).mean()
        for band in (4.0, 8.0)
    }
    assert against[4.0] > 0.7
    assert against[8.0] < 0.1


def test_evenly_takes_each_part_of_a_surface_by_its_area():
    surface = PreparedCloud(frame(0)).surface
    rows = evenly(surface, 1000)
    near = surface.points[:, 2] < np.median(surface.points[:, 2])
    share_of_area = surface.area[near].sum() / surface.area.sum()
    assert near[rows].mean() == pytest.approx(share_of_area, abs=0.1)


def test_a_downsampled_cloud_stands_for_all_points():
    cloud = frame(0)
    prepared = PreparedCloud(cloud)
    few, rows = prepared.downsampled(5000), prepared.representatives(5000)
    assert len(rows) == len(cloud)
    gap = np.linalg.norm(few.points[rows] - cloud.observed_points, axis=1)
    assert np.median(gap) < 3 * prepared.surface.spacing


def test_a_small_cloud_is_not_downsampled():
    cloud = PreparedCloud(frame(0))
    assert cloud.downsampled(50_000) is cloud
    np.testing.assert_array_equal(cloud.representatives(50_000), np.arange(len(cloud)))


def test_a_bare_wall_is_reported_as_free_to_slide():
    depth = np.full((120, 160), 2.0) + np.random.default_rng(0).normal(0, 0.002, (120, 160))
    source = hmrf_icp.PointCloud.from_depth(depth, CAMERA)
    target = hmrf_icp.PointCloud.from_depth(np.roll(depth, 7, axis=0), CAMERA)
    result = hmrf_icp.register(source, target)
    assert len(result.degenerate) >= 1


def test_a_bare_wall_is_not_slid_along():
    rng = np.random.default_rng(0)
    source, target = (shapes.seen(shapes.wall, rng, noise=2e-3) for _ in range(2))
    start = se3.exp([0.0, 0.0, 0.1, 0.1, 0.05, 0.0])
    result = hmrf_icp.register(source, target, start)
    centre = source.observed_points.mean(axis=0)
    went = se3.transform(result.transformation, centre) - se3.transform(start, centre)
    normal = PreparedCloud(target).surface.normals.mean(axis=0)
    normal /= np.linalg.norm(normal)
    assert np.linalg.norm(went - (went @ normal) * normal) < 0.01
    assert len(result.degenerate) == 3
    # Everything agrees, and yet nobody knows where along the wall it belongs.
    assert result.visibility.front == 0
    assert result.confidence < 0.5


def test_the_less_a_direction_is_known_the_less_is_believed():
    visibility = VisibilityTest(*both(frame(4), frame(0)), 2000)(true_motion(4, 0))
    found = [confidence(visibility, weakest) for weakest in (0.0, 0.1, 1.0, 3.0, 10.0, 30.0)]
    assert found == sorted(found)
    assert found[-1] == confidence(visibility) > 0.9
    assert found[1] < 0.5
    unseen = replace(visibility, views=False)
    assert 0.0 < confidence(unseen, 0.5) < confidence(unseen) < 1.0


class WalksOff:
    """An aligner that leads away from wherever it is."""

    def prepare(self, source, target):
        return lambda placed, matches, labels: Step(se3.rigid(np.eye(3), [0.0, 0.0, 0.05]))


def test_what_ends_less_likely_than_it_began_is_not_returned():
    truth = true_motion(4, 0)
    result = hmrf_icp.register(frame(4), frame(0), truth, aligner=WalksOff())
    assert se3.error(result.transformation, truth)[0] < 0.02
    assert not result.converged
    assert result.believed
