"""A viewpoint that is a little off does no harm, and one that was left behind is not used."""

from __future__ import annotations

import numpy as np
import pytest

from hmrf_icp import PointCloud, prepare, se3
from views import frame, heard, off, truth, turned

MOVED = se3.exp([0.9, -1.7, 0.6, 4.0, -6.0, 2.5])
ELSEWHERE = se3.exp([-0.4, 0.8, 1.1, 2.0, 3.0, -1.0])
PAIRS = [("desk", 8, 0), ("desk", 3, 13), ("tabletop", 20, 26), ("tabletop", 3, 13)]
AXIS = np.array([0.2, 1.0, -0.1])


def beside(points, seed):
    """A place a tenth of the size of a cloud from its viewpoint."""
    way = np.random.default_rng(seed).normal(size=3)
    size = np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean())
    return 0.1 * size * way / np.linalg.norm(way)


@pytest.mark.parametrize("degrees", [None, 15])
@pytest.mark.parametrize(("scene", "first", "second"), PAIRS)
def test_a_viewpoint_a_tenth_of_the_size_off_does_no_harm(scene, first, second, degrees):
    source, target = (frame(k, scene).observed_points for k in (first, second))
    clouds = [PointCloud(p, viewpoint=beside(p, k)) for k, p in enumerate((source, target))]
    true = truth(first, second, scene)
    start = None if degrees is None else turned(true, clouds[0], AXIS, degrees)
    result, _ = heard(*clouds, start)
    assert off(result.transformation, true, clouds[0]) < 0.005
    assert result.believed


@pytest.mark.parametrize("degrees", [None, 15])
@pytest.mark.parametrize(("scene", "first", "second"), PAIRS)
def test_a_viewpoint_that_was_left_behind_is_not_used_and_that_is_said(
    scene, first, second, degrees
):
    source, target = (frame(k, scene).observed_points for k in (first, second))
    clouds = [
        PointCloud(se3.transform(MOVED, source), viewpoint=np.zeros(3)),
        PointCloud(se3.transform(ELSEWHERE, target), viewpoint=np.zeros(3)),
    ]
    true = ELSEWHERE @ truth(first, second, scene) @ se3.inverse(MOVED)
    start = None if degrees is None else turned(true, clouds[0], AXIS, degrees)
    result, said = heard(*clouds, start)
    assert off(result.transformation, true, clouds[0]) < 0.005
    assert result.believed
    assert "source: " in said
    assert "target: " in said
    assert "hidden from the viewpoint given, (0, 0, 0)" in said
    assert result.source_view.kind != "given"


def test_a_viewpoint_that_was_moved_along_is_used():
    source, target = frame(8).observed_points, frame(0)
    moved = PointCloud(se3.transform(MOVED, source), viewpoint=MOVED[:3, 3])
    result, said = heard(moved, target, None)
    assert result.source_view.kind == "given"
    assert not said
    assert result.believed


def test_where_hardly_a_point_is_hidden_nothing_speaks_against_a_place():
    u, v = np.random.default_rng(0).uniform(-1.0, 1.0, (2, 3000))
    sheet = np.stack([u, v, 2.0 + 0.05 * np.sin(3.0 * u)], axis=-1)
    assert prepare(PointCloud(sheet, viewpoint=np.array([0.3, -0.8, 0.2]))).doubt is None
