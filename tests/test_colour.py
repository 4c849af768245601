"""Colour holds what surfaces leave free, in units of its own noise, and says so."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import Criteria, InputError, PointCloud, prepare, presets, se3
from hmrf_icp.clouds.shading import intensity
from hmrf_icp.loop.colour import Coloured
from hmrf_icp.loop.surface_metrics import PointToPlane, Symmetric

COUNT = 3000
SLIDE = np.array([0.03, -0.02, 0.0])

register = partial(
    hmrf_icp.register, preset="paper", rejector="all", criteria=Criteria(1e-6, 1e-6, 60)
)
"""The loop alone, with every match: what is left is the metric's."""


def texture(x, y):
    """Brightness of a wall, 0 to 1, in blobs of 0.2 m and more."""
    return 0.5 + 0.25 * np.sin(9.0 * x + 2.0 * y) + 0.2 * np.cos(11.0 * y - 3.0 * x)


def wall(seed, noise=0.002, grain=0.02, pattern=texture, bumps=0.0):
    """Points of a wall of 1.2 m x 1 m, 2 m in front of the sensor, with 8-bit colours."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-0.6, 0.6, COUNT), rng.uniform(-0.5, 0.5, COUNT)
    z = 2.0 + bumps * np.sin(6.0 * x) * np.cos(5.0 * y) + rng.normal(0.0, noise, COUNT)
    bright = np.clip(pattern(x, y) + rng.normal(0.0, grain, COUNT), 0.0, 1.0)
    value = np.rint(255.0 * bright).astype(np.uint8)
    return PointCloud(
        np.stack([x, y, z], axis=1),
        viewpoint=np.zeros(3),
        attributes={"red": value, "green": value, "blue": value},
    )


def slid(cloud, motion=SLIDE):
    """The cloud in a frame that lies ``motion`` off: registered, that is the pose."""
    points = cloud.points - motion
    return PointCloud(points, viewpoint=-motion, attributes=cloud.attributes)


def plain(x, y):
    return np.full_like(x, 0.5)


def test_a_textured_wall_slid_along_itself_is_brought_back():
    result = register(slid(wall(0)), wall(1), aligner="colour")
    assert result.transformation[:3, 3] == pytest.approx(SLIDE, abs=0.003)
    assert se3.rotation_angle(result.transformation) < 0.005
    assert result.degenerate == ()


def test_without_colour_it_stays_and_says_that_it_is_free():
    result = register(slid(wall(0)), wall(1), aligner="symmetric")
    assert np.linalg.norm(result.transformation[:2, 3]) < 0.005
    assert len(result.degenerate) == 3


@pytest.mark.parametrize("grain", [0.0, 0.1])
def test_a_wall_of_one_colour_is_as_free_as_one_without(grain):
    source, target = (wall(seed, grain=grain, pattern=plain) for seed in (0, 1))
    result = register(slid(source), target, aligner="colour")
    assert len(result.degenerate) == 3
    assert np.linalg.norm(result.transformation[:2, 3]) < 0.005


def test_stripes_hold_one_way_and_leave_the_other_free():
    source, target = (wall(s, pattern=lambda x, y: 0.5 + 0.4 * np.sin(9.0 * x)) for s in (0, 1))
    result = register(slid(source), target, aligner="colour")
    assert result.transformation[0, 3] == pytest.approx(SLIDE[0], abs=0.003)
    (free,) = result.degenerate
    assert not free.rotation
    assert abs(free.direction[1]) > 0.99


def test_textures_that_have_nothing_in_common_are_not_told_to_hold():
    def other(x, y):
        return texture(y + 0.3, 0.4 - 1.7 * x)

    result = register(wall(0), wall(1, pattern=other), aligner="colour")
    assert len(result.degenerate) >= 1


@pytest.mark.parametrize("metric", [Symmetric(), PointToPlane()])
def test_colours_that_are_the_same_everywhere_change_nothing(metric):
    source, target = (wall(s, grain=0.0, pattern=plain, bumps=0.1) for s in (0, 1))
    joint, alone = (
        register(slid(source), target, aligner=aligner)
        for aligner in (Coloured(geometric=metric), metric)
    )
    assert joint.transformation == pytest.approx(alone.transformation, abs=1e-9)
    assert joint.information == pytest.approx(alone.information, rel=1e-6)


def test_neither_metres_nor_the_range_of_the_colours_matter():
    def scaled(cloud, metres, factor):
        value = factor * cloud.attributes["red"].astype(float)
        return PointCloud(
            metres * cloud.points,
            viewpoint=metres * cloud.viewpoint,
            attributes={"Intensity": value},
        )

    source, target = slid(wall(0)), wall(1)
    once = register(source, target, aligner="colour", criteria=Criteria(0.0, 0.0, 15))
    large = register(
        scaled(source, 100.0, 7.0),
        scaled(target, 100.0, 7.0),
        aligner="colour",
        criteria=Criteria(0.0, 0.0, 15),
    )
    assert large.transformation[:3, :3] == pytest.approx(once.transformation[:3, :3], abs=1e-6)
    assert large.transformation[:3, 3] == pytest.approx(100 * once.transformation[:3, 3], abs=1e-3)


def test_the_information_says_how_far_off_it_is_along_the_wall():
    square = []
    for seed in range(12):
        result = register(wall(2 * seed), wall(2 * seed + 1), aligner="colour")
        covariance = np.linalg.inv(result.information)
        twist = se3.log(result.transformation)
        twist[3:] += np.cross(twist[:3], result.centre)
        off = twist[3:5]
        square.append(off @ np.linalg.solve(covariance[3:5, 3:5], off))
    assert 0.3 < np.mean(square) / 2.0 < 3.0


def test_the_default_takes_colour_too_and_thins_it_with_the_points():
    result = hmrf_icp.register(slid(wall(0)), wall(1), np.eye(4), aligner="colour")
    assert result.transformation[:3, 3] == pytest.approx(SLIDE, abs=0.005)
    few = prepare(wall(0)).downsampled(500)
    assert intensity(few.cloud).shape == (len(few),)
    near = prepare(wall(0)).tree.query(few.points, k=1)[1]
    assert np.array_equal(intensity(few.cloud), intensity(wall(0))[near.ravel()])


def test_a_cloud_without_colours_is_refused_with_what_it_has():
    bare = PointCloud(wall(1).points, attributes={"time": np.zeros(COUNT)})
    with pytest.raises(InputError, match=r"target: no colours: .*red, green and blue.*it has time"):
        register(wall(0), bare, aligner="colour")
    with pytest.raises(InputError, match="source: no colours"):
        register(wall(0).points, wall(1), aligner="colour")


def test_points_without_a_colour_are_left_to_the_surfaces():
    source, target = slid(wall(0)), wall(1)
    value = target.attributes["red"] / 255.0
    value[::5] = np.nan
    holed = PointCloud(target.points, viewpoint=target.viewpoint, attributes={"intensity": value})
    result = register(source, holed, aligner="colour")
    assert result.transformation[:3, 3] == pytest.approx(SLIDE, abs=0.004)
    nothing = PointCloud(target.points, attributes={"intensity": np.full(COUNT, np.nan)})
    with pytest.raises(InputError, match="none of its intensities is finite"):
        register(source, nothing, aligner="colour")


@pytest.mark.parametrize(
    ("names", "values"),
    [
        (("red", "green", "blue"), np.array([51, 102, 204], dtype=np.uint8)),
        (("Red", "Green", "Blue"), np.array([51, 102, 204], dtype=np.uint16) * 257),
        (("r", "g", "b"), np.array([0.2, 0.4, 0.8])),
    ],
)
def test_brightness_is_the_same_in_8_bits_16_bits_and_shares(names, values):
    points = np.random.default_rng(0).uniform(size=(5, 3))
    columns = {name: np.full(5, value) for name, value in zip(names, values, strict=True)}
    luma = 0.299 * 0.2 + 0.587 * 0.4 + 0.114 * 0.8
    assert intensity(PointCloud(points, attributes=columns)) == pytest.approx(np.full(5, luma))
    colours = np.tile(values, (5, 1))
    assert intensity(PointCloud(points, attributes={"colors": colours})) == pytest.approx(
        np.full(5, luma)
    )


def test_colour_is_put_beside_a_metric_that_looks_at_surfaces():
    assert presets.coloured("point-to-plane") == Coloured(geometric=PointToPlane())
    assert presets.coloured(None) == Coloured() == presets.coloured("colour")
    with pytest.raises(InputError, match="looks at surfaces"):
        presets.coloured("point-to-point")
