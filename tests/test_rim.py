"""Where a surface ends: points beside the overlap do not pull, and clouds may change roles."""

from __future__ import annotations

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import io, prepare, presets, se3


def box(rng, count, size, at):
    size = np.array(size)
    area = np.array([size[1] * size[2], size[0] * size[2], size[0] * size[1]])
    points = rng.uniform(size=(count, 3))
    points[np.arange(count), rng.choice(3, count, p=area / area.sum())] = rng.integers(0, 2, count)
    return points * size + at


def thing(rng, count):
    """A block with a tower, a post and a ball, 1 x 0.4 x 0.8 m, seen from all sides."""
    ball = rng.normal(size=(count // 8, 3))
    ball *= 0.12 / np.linalg.norm(ball, axis=1)[:, None]
    return np.vstack(
        [
            box(rng, count // 2, (1.0, 0.4, 0.2), 0.0),
            box(rng, count // 4, (0.3, 0.4, 0.8), 0.0),
            ball + np.array([0.8, 0.1, 0.25]),
            box(rng, count // 8, (0.1, 0.1, 0.5), (0.55, 0.25, 0.2)),
        ]
    )


@pytest.fixture(scope="module")
def whole_and_part():
    rng = np.random.default_rng(0)
    whole, scan = thing(rng, 8000), thing(rng, 8000)
    return whole, scan[(scan[:, 0] > 0.7) & (scan[:, 2] > 0.15)]


@pytest.mark.parametrize("degrees", [0.0, 10.0])
def test_a_whole_goes_onto_its_part_as_the_part_onto_the_whole(whole_and_part, degrees):
    whole, part = whole_and_part
    pose = se3.rotation_about([0.3, 1.0, 0.2], np.radians(degrees), part.mean(axis=0))
    moved = se3.transform(se3.inverse(pose), part)
    for source, target, truth in ((moved, whole, pose), (whole, moved, se3.inverse(pose))):
        result = hmrf_icp.register(source, target)
        metres, radians = se3.error(result.transformation, truth)
        assert metres < 0.01
        assert radians < 0.01


@pytest.mark.shared
@pytest.mark.parametrize(("first", "second"), [(1, 9), (3, 7), (2, 11)])
def test_fragments_that_share_a_seventh_stay_where_they_belong(shared, first, second):
    folder = shared / "data" / "fragments-exact"
    clouds = [
        prepare(io.read_cloud(folder / f"fragment-{i:02d}.ply")).viewed for i in (first, second)
    ]
    one, other = (np.loadtxt(folder / f"fragment-{i:02d}.pose.txt") for i in (first, second))
    truth = se3.inverse(other) @ one
    for source, target, pose in ((*clouds, truth), (*clouds[::-1], se3.inverse(truth))):
        method = presets.ROBUST.method
        few, many = source.downsampled(5000), target.downsampled(20_000)
        found = method.run(few, many, pose).transformation
        off = se3.transform(found, few.points) - se3.transform(pose, few.points)
        assert np.sqrt((off**2).sum(axis=1).mean()) < 0.02 * many.surface.size
