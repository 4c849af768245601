"""What is worked out of a cloud is worked out once, counted, and gone with the cloud."""

import gc
import time
import weakref

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import PointCloud, RelativeCriteria, kept
from hmrf_icp.clouds.downsample import reduced
from hmrf_icp.clouds.surface import surface_of
from hmrf_icp.loop.match import tree_of


def cloud(count=500, seed=0):
    return PointCloud(np.random.default_rng(seed).normal(size=(count, 3)), viewpoint=(0, 0, -5))


def test_a_cloud_has_one_surface_one_tree_and_one_reduction():
    one = cloud()
    assert surface_of(one) is surface_of(one)
    assert tree_of(one) is tree_of(one)
    assert reduced(one, 100) is reduced(one, 100)
    assert reduced(one, 100) is not reduced(one, 200)
    assert surface_of(one) is not surface_of(cloud())


def test_what_is_kept_goes_with_the_cloud():
    source, target = cloud(), cloud(seed=1)
    hmrf_icp.register(source, target)
    gone = [weakref.ref(source), weakref.ref(target), weakref.ref(reduced(source, 100))]
    del source, target
    gc.collect()
    assert [reference() for reference in gone] == [None] * 3


def test_what_was_built_before_counts_with_its_time():
    one, built = cloud(), []

    def build():
        time.sleep(0.05)
        return built.append("slow")

    _, first = kept.timed(lambda: kept.once(one, "slow", build))
    _, second = kept.timed(lambda: kept.once(one, "slow", build))
    assert built == ["slow"]
    assert first >= 0.05
    assert second >= 0.05


def test_relative_criteria_grow_with_the_target():
    points = np.random.default_rng(0).normal(size=(500, 3))
    small, large = (RelativeCriteria(1e-3).on(PointCloud(k * points)) for k in (1.0, 10.0))
    assert large.translation == pytest.approx(10.0 * small.translation)
    assert large.rotation == small.rotation == 1e-3
    same = hmrf_icp.Criteria(0.1, 0.2, 3)
    assert same.on(PointCloud(points)) is same
