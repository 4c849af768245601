"""A table and a desk are found from nowhere: no start, no features."""

import math
from functools import lru_cache

import numpy as np
import pytest

from hmrf_icp import se3
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.evaluate.protocol import overlap, true_transformation
from hmrf_icp.search.plane_hypotheses import FIRST, evenly, plane_hypotheses, sampled
from hmrf_icp.synthetic.render import render, sensor_noise
from hmrf_icp.synthetic.scenes import CAMERA, SCENES, trajectory

FRAME = se3.rigid(se3.rotation_exp([1.0, 2.0, -0.5]), [5.0, -3.0, 8.0])


@lru_cache(maxsize=2)
def walk(name):
    """The frames of a scene's walk as the sensor sees them, every fourth pixel, and poses."""
    scene, rng = SCENES[name](), np.random.default_rng(0)
    poses = trajectory(name, 10)
    return poses, [
        PointCloud.from_depth(
            sensor_noise(render(scene, CAMERA, pose), CAMERA, rng), CAMERA
        ).subsample(4)
        for pose in poses
    ]


def pair(name, source, target):
    poses, clouds = walk(name)
    return clouds[source], clouds[target], true_transformation(poses[source], poses[target])


def seen(cloud, unit=1.0, bare=False, frame=None):
    """A cloud as the generator takes it, in other units or in another frame if need be."""
    surface = PreparedCloud(cloud).surface
    frame = np.eye(4) if frame is None else frame
    return sampled(
        unit * se3.transform(frame, surface.points),
        surface.normals @ frame[:3, :3].T,
        unit**2 * surface.area,
        surface.oriented and not bare,
        None if bare else unit * se3.transform(frame, np.zeros(3)),
    )


def together(source, target, most):
    """All poses and their scores, the likeliest first."""
    batches = list(plane_hypotheses(source, target, most))
    poses, scores = (np.concatenate(each) for each in zip(*batches, strict=True))
    order = np.argsort(-scores, kind="stable")
    return poses[order], scores[order]


def near(poses, truth, source, size):
    """Tell which poses lead to the truth: a turn about the table moves the far wall."""
    middle = source.points.mean(axis=0)
    apart = [
        np.linalg.norm(se3.transform(one, middle) - se3.transform(truth, middle)) for one in poses
    ]
    angle = [se3.rotation_angle(se3.inverse(truth) @ one) for one in poses]
    return (np.array(angle) < 0.2) & (np.array(apart) < 0.25 * size)


@pytest.mark.parametrize(
    ("name", "source", "target"),
    [("tabletop", 3, 0), ("tabletop", 6, 3), ("tabletop", 9, 5), ("desk", 3, 0), ("desk", 8, 5)],
)
def test_a_pose_near_the_truth_is_among_a_hundred(name, source, target):
    free, fixed, truth = pair(name, source, target)
    assert overlap(free, fixed, truth) < 0.8
    moving = seen(free)
    poses, _ = together(moving, seen(fixed), 100)
    assert near(poses[:100], truth, moving, PreparedCloud(fixed).surface.size).any()


def test_what_the_likeliest_rotations_give_comes_first_and_each_time_the_best_of_it():
    free, fixed, _ = pair("desk", 3, 0)
    first, others = plane_hypotheses(seen(free), seen(fixed), 50)
    for poses, scores in (first, others):
        assert poses.shape == (50, 4, 4)
        assert (np.diff(scores) <= 0).all()
    turns = [{one[:3, :3].tobytes() for one in poses} for poses, _ in (first, others)]
    assert len(turns[0]) <= FIRST
    assert not turns[0] & turns[1]


def test_a_cloud_seen_from_nowhere_in_particular_has_hypotheses_too():
    free, fixed, truth = pair("desk", 2, 0)
    moving = seen(free, bare=True)
    poses, _ = together(moving, seen(fixed, bare=True), 100)
    assert near(poses, truth, moving, PreparedCloud(fixed).surface.size).any()


def test_the_frame_of_the_source_tells_nothing():
    free, fixed, truth = pair("tabletop", 3, 0)
    moving = seen(free, frame=FRAME)
    poses, _ = together(moving, seen(fixed), 100)
    assert near(poses, truth @ se3.inverse(FRAME), moving, PreparedCloud(fixed).surface.size).any()


def test_millimetres_give_what_metres_do():
    free, fixed, _ = pair("tabletop", 3, 0)
    metres, scores = together(seen(free), seen(fixed), 20)
    thousandths, same = together(seen(free, 1024.0), seen(fixed, 1024.0), 20)
    thousandths[:, :3, 3] /= 1024.0
    np.testing.assert_allclose(thousandths, metres, atol=1e-6)
    np.testing.assert_allclose(same, scores, atol=1e-6)


def test_the_same_clouds_give_the_same_poses():
    free, fixed, _ = pair("desk", 3, 0)
    once, again = (together(seen(free), seen(fixed), 30)[0] for _ in range(2))
    np.testing.assert_array_equal(once, again)


def test_poses_are_rigid():
    free, fixed, _ = pair("tabletop", 6, 3)
    for pose in together(seen(free), seen(fixed), 20)[0]:
        np.testing.assert_allclose(se3.as_rigid(pose), pose, atol=1e-9)


def test_points_are_chosen_by_the_area_they_stand_for():
    area = np.repeat([1.0, 4.0], 5000)
    rows = evenly(area, 1000)
    assert len(rows) == pytest.approx(1000, abs=2)
    assert np.mean(rows >= 5000) == pytest.approx(0.8, abs=0.01)
    assert math.isclose(len(evenly(np.ones(10), 100)), 10)
