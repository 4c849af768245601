"""The default on scans of rooms, a table and a street: little overlap, far starts, no option."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import datasets, io, se3
from hmrf_icp.evaluate import protocol

pytestmark = pytest.mark.shared

AXES = protocol.Axes.random(4, seed=0)
NEAR = protocol.Start(math.pi / 30)
MIDDLING = protocol.Start(math.pi / 10)
FAR = protocol.Start(math.pi / 6, 0.3)


def views(folder, target, source):
    """Source and target of a sequence, and the pose that takes the first onto the second."""
    sequence = datasets.open_sequence(folder)
    fixed, free = sequence.frame(target), sequence.frame(source)
    truth = protocol.true_transformation(free.pose, fixed.pose)
    return free.load().subsample(4), fixed.load().subsample(4), truth


def error_from(start, source, target, truth, axis=0):
    centroid = source.observed_points.mean(axis=0)
    init = protocol.perturbed(truth, centroid, AXES, axis, start)
    result = hmrf_icp.register(source, target, init)
    return result, se3.error(result.transformation, truth)


@pytest.mark.parametrize(("target", "source"), [(190, 380), (310, 160)])
@pytest.mark.parametrize("start", [NEAR, MIDDLING])
def test_a_tenth_of_overlap_is_enough_in_a_kitchen(shared, target, source, start):
    pair = views(shared / "data" / "kitchen-exact", target, source)
    assert protocol.overlap(*pair) < 0.15
    _, (metres, radians) = error_from(start, *pair)
    assert metres < 0.05
    assert radians < 0.05


@pytest.mark.parametrize(("target", "source"), [(0, 18), (12, 39), (27, 14)])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_third_of_overlap_is_enough_on_a_table_from_far(shared, target, source, axis):
    pair = views(shared / "data" / "tabletop-exact", target, source)
    assert protocol.overlap(*pair) < 0.4
    result, (metres, radians) = error_from(FAR, *pair, axis=axis)
    assert metres < 0.01
    assert radians < 0.01
    assert result.confidence > 0.5


@pytest.mark.parametrize(("target", "source"), [(60, 210), (310, 380), (310, 440)])
def test_half_the_overlap_is_enough_for_a_real_camera_from_far(shared, target, source):
    pair = views(shared / "data" / "kitchen-real", target, source)
    assert protocol.overlap(*pair) < 0.55
    result, (metres, radians) = error_from(FAR, *pair)
    assert metres < 0.075  # the poses are a tracker's, good to about 3 cm
    assert radians < 0.1
    assert result.confidence > 0.5


@pytest.mark.parametrize(("target", "source"), [(60, 410), (80, 400), (60, 440)])
def test_views_that_share_nothing_are_told_apart(shared, target, source):
    pair = views(shared / "data" / "kitchen-exact", target, source)
    assert protocol.overlap(*pair) < 0.01
    result, _ = error_from(MIDDLING, *pair)
    assert result.confidence < 0.5


@pytest.mark.parametrize("viewpoint", [None, (0.0, 0.0, 0.0)])
@pytest.mark.parametrize("degrees", [0.0, 5.0])
def test_a_lidar_scan_has_no_grid_and_needs_none(shared, viewpoint, degrees):
    folder = shared / "data" / "lidar"
    truth = np.loadtxt(folder / "T_target_source.txt")
    source, target = (
        hmrf_icp.PointCloud(io.read_cloud(folder / name).points, viewpoint=viewpoint)
        for name in ("source.ply", "target.ply")
    )
    turn = se3.rotation_exp(math.radians(degrees) * np.array([0.0, 0.6, 0.8]))
    init = se3.rigid(turn, np.array([0.06, 0.08, 0.0]) * degrees)
    result = hmrf_icp.register(source, target, init)
    metres, radians = se3.error(result.transformation, truth)
    assert metres < 0.05
    assert radians < 0.005
