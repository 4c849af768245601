"""The embedded data set."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from dataset_writers import to_world
from scipy.spatial import cKDTree

from hmrf_icp.datasets import names, open_sequence


def test_the_default_is_the_desk() -> None:
    assert {"synthetic", "synthetic:desk", "synthetic:tabletop"} <= set(names())
    assert open_sequence("synthetic").name == open_sequence("synthetic:desk").name


@pytest.mark.parametrize("name", ["synthetic:desk", "synthetic:tabletop"])
def test_a_frame_is_the_same_every_time_and_noisy(name: str) -> None:
    sequence = open_sequence(name)
    frame = sequence.frames[7]
    once, again = frame.load(), open_sequence(name).frames[7].load()
    np.testing.assert_array_equal(once.points, again.points)
    assert once.camera == sequence.camera
    exact = dataclasses.replace(frame.scan, seed=None).load()  # type: ignore[type-var]
    both = once.observed & exact.observed
    off = np.abs(once.points[..., 2] - exact.points[..., 2])[both]
    assert 1e-4 < np.median(off) < 0.02
    assert 0.5 < both.mean() < 0.999


def test_noise_differs_between_frames() -> None:
    scan = open_sequence("synthetic:tabletop").frames[3].scan
    other = dataclasses.replace(scan, index=4)  # type: ignore[type-var]
    assert not np.array_equal(scan.load().points, other.load().points, equal_nan=True)


@pytest.mark.parametrize("name", ["synthetic:desk", "synthetic:tabletop"])
def test_neighbouring_frames_lie_on_one_surface(name: str) -> None:
    frames = open_sequence(name).frames[20:22]
    first, second = (to_world(f.load().subsample(4).points, f.pose) for f in frames)
    assert np.median(cKDTree(first).query(second)[0]) < 0.02
