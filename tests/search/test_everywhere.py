"""From nowhere: every kind of hypothesis has the pose, and what is in no order is found too."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import PointCloud, PreparedCloud, presets, se3
from hmrf_icp.clouds.sensor_view import SensorView
from hmrf_icp.search.everywhere import everywhere
from hmrf_icp.search.search import Search, Starts
from views import frame, off, truth, turned

MOVED = se3.exp([0.9, -1.7, 0.6, 1.0, -2.0, 0.5])


def moved(index):
    """A view in a frame that has nothing to do with the other's, its place known."""
    return PointCloud(se3.transform(MOVED, frame(index).points), viewpoint=MOVED[:3, 3])


def nearest(poses, true, cloud):
    return min(off(pose, true, cloud) for pose in poses)


@pytest.mark.parametrize("kind", ["given", "assumed"])
def test_each_kind_of_hypothesis_has_one_near_the_truth(kind):
    view = None if kind == "given" else SensorView("assumed", "")
    source, target = (PreparedCloud(one, view=view) for one in (moved(8), frame(0)))
    true = truth(8, 0) @ se3.inverse(MOVED)
    likeliest, others, *features = everywhere(source, target)
    # Features once more without a side, where the side is a guess.
    assert len(features) == (1 if kind == "given" else 2)
    kinds = [np.concatenate([likeliest, others]), *features]
    for poses in kinds:
        assert nearest(poses, true, source.cloud) < 0.2 * target.surface.size
    assert not np.array_equal(kinds[0][:5], kinds[1][:5])


def test_a_view_from_anywhere_is_registered_without_a_start():
    result = hmrf_icp.register(moved(8), frame(0))
    assert off(result.transformation, truth(8, 0) @ se3.inverse(MOVED), moved(8)) < 0.005
    assert result.believed


def test_near_a_start_the_pose_is_not_looked_for_elsewhere():
    source, target, true = frame(8), frame(0), truth(8, 0)
    wrong = turned(true, source, [0.3, 1.0, 0.2], 130.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", hmrf_icp.RegistrationWarning)
        near = hmrf_icp.register(source, target, wrong)
    assert not near.believed
    everywhere_else = hmrf_icp.register(source, target, wrong, search="everywhere")
    assert everywhere_else.believed
    assert off(everywhere_else.transformation, true, source) < 0.005


def test_a_hypothesis_that_comes_first_is_tried_whatever_a_thousand_points_say():
    clouds = PreparedCloud(frame(8)), PreparedCloud(frame(0))
    search = Search(presets.ROBUST, *clouds, np.eye(4), False, None)
    true = truth(8, 0)
    # Around the truth, nineteen that the test likes; first, one that stands in free space.
    first = se3.rigid(np.eye(3), [0.0, 0.0, -0.5]) @ true
    rng = np.random.default_rng(0)
    good = [se3.exp(0.06 * rng.standard_normal(6)) @ true for _ in range(19)]
    search._coarse = lambda poses, scale: poses
    search._gone_on = lambda candidates: candidates
    candidates = search.among(Starts(np.array([first, *good]), 1, 6, True))
    tried = [candidate.pose for candidate in candidates]
    assert len(tried) == 6
    assert any(np.array_equal(pose, first) for pose in tried)
