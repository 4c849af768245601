"""A small pair of wavy surfaces and its registration, and one that is not to be believed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import plot, se3
from hmrf_icp.synthetic.render import render
from hmrf_icp.synthetic.scenes import CAMERA, desk, trajectory


@pytest.fixture(scope="session")
def filmed():
    """Source, target, start, result and recording of the paper's method on two small views."""
    poses = [trajectory("desk", 10)[k] for k in (3, 5)]
    source, target = (
        hmrf_icp.PointCloud.from_depth(render(desk(), CAMERA, pose), CAMERA).subsample(16)
        for pose in poses
    )
    truth = se3.inverse(poses[1]) @ poses[0]
    init = se3.rotation_about((0.0, 1.0, 0.0), 0.06, (0.0, 0.0, 1.5)) @ truth
    recording = plot.Recording()
    result = hmrf_icp.register(source, target, init, preset="paper", on_iteration=recording)
    return source, target, init, result, recording


@pytest.fixture(scope="session")
def result(filmed):
    return replace(filmed[3], confidence=0.93)


@pytest.fixture(scope="session")
def wrong(filmed):
    return replace(filmed[3], confidence=0.12)


@pytest.fixture
def ax():
    from matplotlib.figure import Figure

    return Figure(figsize=(5.0, 4.0)).add_subplot()


@pytest.fixture(scope="session")
def wavy():
    """(2500, 3) points of a surface without symmetry, metres."""
    points = np.random.default_rng(0).uniform(-1.0, 1.0, size=(2500, 3))
    points[:, 2] = 0.2 * np.sin(4.0 * points[:, 0]) + 0.3 * np.cos(3.0 * points[:, 1])
    return points
