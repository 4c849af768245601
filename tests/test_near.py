"""Without a viewpoint: what lies on a surface, a little off it, beside it, beyond its border."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import PointCloud
from hmrf_icp.confidence import log_odds
from hmrf_icp.evidence import Judge, Near, Verdict, border_of
from hmrf_icp.kernels.view import AGREE, FRONT, OTHER, OUTSIDE

STEP = 0.05


def sheet() -> NDArray[np.float64]:
    """A flat sheet of 2 x 2 m at z = 0, a point every five centimetres, shaken a little."""
    line = np.arange(-1.0, 1.0 + 1e-9, STEP)
    x, y = np.meshgrid(line, line)
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    return points + np.random.default_rng(0).normal(scale=[0.004, 0.004, 0.001], size=points.shape)


def test_the_border_of_a_sheet_is_its_rim() -> None:
    cloud = PointCloud(sheet())
    border = border_of(cloud)
    rim = np.abs(cloud.observed_points[:, :2]).max(axis=1)
    assert border[rim > 0.97].mean() > 0.95
    assert border[rim < 0.8].mean() < 0.02


def test_what_is_a_little_off_a_surface_contradicts_it_unless_the_surface_ends_there() -> None:
    near = Near(PointCloud(sheet()))
    up, across = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    points = np.array([[0, 0, 0.0], [0, 0, 0.0], [0, 0, 0.12], [1.1, 0, 0.0], [0, 0, 1.0]])
    normals = np.array([up, across, up, up, up])
    verdict = near.ask(points, normals, np.eye(4))
    np.testing.assert_array_equal(verdict, [AGREE, OTHER, FRONT, OUTSIDE, OUTSIDE])


def test_a_sheet_through_the_other_is_less_likely_than_one_beside_it() -> None:
    """More points agree in the wrong pose: the share that agrees tells nothing."""
    cloud = PointCloud(sheet())
    judge = Judge(cloud, PointCloud(sheet()), 1000)
    beside, through = np.eye(4), np.eye(4)
    beside[0, 3] = 1.5
    angle = 0.15
    through[:3, :3] = [
        [np.cos(angle), 0.0, np.sin(angle)],
        [0.0, 1.0, 0.0],
        [-np.sin(angle), 0.0, np.cos(angle)],
    ]
    assert not judge.seen
    assert judge(beside).agree < judge(through).agree
    assert log_odds(judge(beside)) > log_odds(judge(through)) + 2.0


def test_more_surface_off_the_other_is_less_likely() -> None:
    odds = [log_odds(Verdict(300, off, 0, 700 - off, 0, seen=False)) for off in (0, 10, 100, 400)]
    assert odds == sorted(odds, reverse=True)
