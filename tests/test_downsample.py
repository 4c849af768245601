"""Fewer points that stand for all: which stay, and who stands for whom."""

from __future__ import annotations

import numpy as np
import pytest

from hmrf_icp import PointCloud, prepare
from hmrf_icp.clouds.downsample import downsample, thinned


def box(count, seed=0):
    """Points on the sides of a box."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(size=(count, 3))
    points[np.arange(count), rng.integers(0, 3, count)] = rng.integers(0, 2, count)
    return points * (1.0, 0.6, 0.3)


def first_of_each_by_sorting(points, edge):
    cells = np.floor((points - points.min(axis=0)) / edge).astype(np.int64)
    return np.sort(np.unique(cells, axis=0, return_index=True)[1])


@pytest.mark.parametrize("edge", [0.01, 0.07, 0.3, 2.0])
def test_the_first_point_of_every_cell_stays(edge):
    points = box(5000)
    expected = first_of_each_by_sorting(points, edge)
    np.testing.assert_array_equal(thinned(points, edge), expected)
    np.testing.assert_array_equal(thinned(points - 50.0, edge), thinned(points - 50.0, edge))


def test_no_edge_keeps_one_of_those_that_coincide():
    points = np.repeat(box(50), 3, axis=0)
    np.testing.assert_array_equal(thinned(points, 0.0), np.arange(0, 150, 3))
    np.testing.assert_array_equal(thinned(np.ones((5, 3)), 0.0), [0])


@pytest.mark.parametrize("count", [900, 3000, 40_000])
def test_about_as_many_stay_as_were_asked_for(count):
    thinned = downsample(PointCloud(box(count)), 800)
    few, representative = thinned.cloud, thinned.representative
    assert 0.85 * 800 <= len(few) <= 800
    assert representative.shape == (count,)
    np.testing.assert_array_equal(np.unique(representative), np.arange(len(few)))


def test_a_point_is_stood_for_by_one_close_to_it():
    cloud = PointCloud(box(20_000))
    thinned = downsample(cloud, 1000)
    few, representative = thinned.cloud, thinned.representative
    away = np.linalg.norm(cloud.points - few.points[representative], axis=1)
    # 1.08 + 0.36 + 0.96 square metres of surface for a thousand cells, at most a diagonal across.
    assert away.max() < 3 * np.sqrt(2.16 / 1000) * np.sqrt(3)
    stays = (away == 0).nonzero()[0]
    assert len(stays) == len(few)


def test_one_point_far_off_leaves_enough_of_the_others():
    points = np.r_[box(5000), [[1e9, 0.0, 0.0]]]
    assert len(downsample(PointCloud(points), 1000).cloud) > 800


def test_a_cloud_of_no_more_is_itself():
    cloud = PointCloud(box(800))
    thinned = downsample(cloud, 800)
    few, representative = thinned.cloud, thinned.representative
    assert few is cloud
    np.testing.assert_array_equal(representative, np.arange(800))


@pytest.mark.parametrize("row", [1, 2, 3])
def test_pixels_between_the_rows_that_stay_are_not_lost(row):
    points = np.full((64, 64, 3), np.nan)
    points[row::4] = np.random.default_rng(0).normal(size=(16, 64, 3))
    thinned = downsample(PointCloud(points), 100)
    few, representative = thinned.cloud, thinned.representative
    assert len(few) >= 25
    assert representative.max() < len(few)


def test_an_image_with_few_pixels_left_keeps_them():
    points = np.full((100, 100, 3), np.nan)
    points[np.random.default_rng(0).random((100, 100)) < 0.02] = 1.0
    points *= np.random.default_rng(1).normal(size=points.shape)
    assert len(prepare(points).downsampled(300)) == np.count_nonzero(~np.isnan(points[..., 0]))
