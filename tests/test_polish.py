"""The last steps: matches straight across that agree within the noise, and no others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hmrf_icp import PointCloud, PreparedCloud, presets, se3
from hmrf_icp.loop.placed import Placed
from hmrf_icp.loop.polish import Near, agreeing, polish
from hmrf_icp.loop.reject import Labels
from shapes import CAMERA
from views import frame, off, truth

NOISE = 0.02
METHOD = presets.ROBUST.method


@pytest.fixture(scope="module")
def walls():
    """Two noisy views of one wall."""
    rng = np.random.default_rng(0)
    shape = CAMERA.height, CAMERA.width
    return [
        PreparedCloud(PointCloud.from_depth(2.0 + NOISE * rng.standard_normal(shape), CAMERA, 1.0))
        for _ in range(2)
    ]


def told(source, target, pose):
    placed = Placed.at(pose, source.points)
    chance = np.ones(len(source))
    _, row = target.tree.query(placed.points)
    near = Near.of(placed, target, chance, row)
    matches, share = agreeing(placed, source, target, chance, near)
    return placed, matches, share


@pytest.mark.parametrize("organised", [True, False])
def test_the_match_is_the_point_across_and_not_the_one_whose_noise_leads_to_the_source(
    walls, organised
):
    source, target = walls
    if not organised:
        target = PreparedCloud(PointCloud(target.points, viewpoint=np.zeros(3)))
    placed, matches, _ = told(source, target, se3.rigid(np.eye(3), [0.007, 0.011, 0.02]))
    closest = target.tree.query(placed.points)[1]
    aside = [
        np.linalg.norm((placed.points - target.points[rows])[:, :2], axis=1)
        for rows in (matches.index, closest)
    ]
    assert aside[0].mean() < 0.9 * aside[1].mean()


def test_a_match_counts_less_the_farther_off_it_is(walls):
    source, target = walls
    # Half of the wall stays where it is: it says how far apart noise leaves them.
    left = source.points[:, 0] < 0.0
    shares = []
    for times in (0.0, 2.0, 4.0, 20.0):
        points = source.points.copy()
        points[~left, 2] -= times * NOISE
        placed = Placed(points, np.eye(4))
        chance = np.ones(len(source))
        near = Near.of(placed, target, chance, target.tree.query(points)[1])
        _, share = agreeing(placed, source, target, chance, near)
        shares.append(float(share[~left].mean()))
    assert shares == sorted(shares, reverse=True)
    assert shares[2] < shares[0] - 0.1
    assert shares[3] < 0.01


def test_surfaces_that_cross_do_not_count(walls):
    source, target = walls
    middle = source.points.mean(axis=0)
    across = se3.rotation_about([0.0, 1.0, 0.0], np.radians(60.0), middle)
    _placed, matches, share = told(source, target, across)
    near = matches.distance < 0.03
    assert near.sum() > 20
    assert share[near].mean() < 0.02


def test_the_last_steps_lead_closer_to_the_truth():
    before, after = [], []
    for index in (3, 6, 10, 14):
        source, target = frame(index), frame(0)
        clouds, true = (PreparedCloud(source), PreparedCloud(target)), truth(index, 0)
        loop = METHOD.run(*clouds, true)
        polished = polish(loop, *clouds, METHOD.align)
        assert len(polished.history) == len(loop.history) + 2
        before.append(off(loop.transformation, true, source))
        after.append(off(polished.transformation, true, source))
    assert np.mean(after) < 0.6 * np.mean(before)


def test_where_the_last_steps_would_leave_more_free_than_the_loop_did_they_are_not_taken(walls):
    source, target = walls
    loop = METHOD.run(source, target, np.eye(4))
    assert len(loop.last.degenerate) == 3
    surer = replace(loop, last=replace(loop.last, degenerate=loop.last.degenerate[:1]))
    assert polish(surer, source, target, METHOD.align).history == loop.history
    assert len(polish(loop, source, target, METHOD.align).history) == len(loop.history) + 2
    assert Labels(loop.labels.z).inlier.any()


def test_a_loop_that_ended_with_outliers_alone_stays_where_it_was(walls):
    source, target = walls
    ended = METHOD.run(source, target, np.eye(4))
    nothing = Labels(np.full(len(source), -1.0))
    after = polish(replace(ended, labels=nothing), source, target, METHOD.align)
    assert np.isfinite(after.transformation).all()
    assert np.allclose(after.transformation, ended.transformation, atol=1e-12)
