from __future__ import annotations

import time

import numpy as np
import pytest
from evaluation_fakes import CAMERA

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.datasets import Frame
from hmrf_icp.evaluate.prepared import Prepared, timed
from hmrf_icp.evaluate.work import CLOUDS_KEPT, Clouds, Recent


def cloud(seed: int = 0) -> PointCloud:
    return PointCloud(np.random.default_rng(seed).normal(size=(50, 3)))


def test_what_is_derived_from_a_cloud_is_built_once():
    prepared, built = Prepared(cloud()), []
    for _ in range(3):
        assert prepared.derived("tree", lambda: built.append(1) or "a tree") == "a tree"
    assert built == [1]


def test_a_run_is_charged_for_what_another_run_built():
    prepared = Prepared(cloud())

    def build() -> str:
        time.sleep(0.05)
        return "slow"

    _, first = timed(lambda: prepared.derived("slow", build))
    _, second = timed(lambda: prepared.derived("slow", build))
    _, neither = timed(lambda: None)
    assert first >= 0.05
    assert second >= 0.05
    assert neither < 0.05


def test_what_is_built_from_parts_is_charged_with_its_parts():
    prepared = Prepared(cloud())

    def part() -> str:
        time.sleep(0.05)
        return "part"

    timed(lambda: prepared.derived("part", part))
    timed(lambda: prepared.derived("whole", lambda: prepared.derived("part", part)))
    _, seconds = timed(lambda: prepared.derived("whole", str))
    assert seconds >= 0.05


def test_a_worker_keeps_the_clouds_it_used_last_and_no_more():
    kept, made = Recent(), []

    def get(number: int) -> Prepared:
        def make() -> Prepared:
            made.append(number)
            return Prepared(cloud(number), number)

        return kept.get(("session", 1, number), make, keep=3)

    for number in (0, 1, 2, 0, 3, 0, 3, 1):
        assert get(number).name == number
        assert len(kept) <= 3
    assert made == [0, 1, 2, 3, 1]


def test_a_thousand_frames_leave_a_few_clouds_in_a_worker():
    class Scan:
        def load(self) -> PointCloud:
            return PointCloud(np.ones((CAMERA.height, CAMERA.width, 3)), CAMERA)

    from hmrf_icp.evaluate import work

    clouds = Clouds("a session of this test", 2)
    for index in range(1000):
        prepared = clouds.prepared(Frame(index, np.eye(4), Scan()))
        assert prepared.cloud.shape == (18, 24)
    assert len(work._recent) == CLOUDS_KEPT
    assert prepared.centroid == pytest.approx(1.0)
