"""Normals that came with the points: the side that they tell is evidence, and nonsense is not."""

from __future__ import annotations

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import PointCloud, prepare, se3
from hmrf_icp.clouds.given_normals import facing, sides
from views import frame, off, truth

TRUE = se3.exp([0.05, -0.08, 0.06, 0.03, 0.04, -0.02])
THICK = 0.05


def block(rng, count, size, at, turn):
    """Points (N, 3) of the faces of a block, and the normals out of it."""
    size = np.array(size)
    area = np.array([size[1] * size[2], size[0] * size[2], size[0] * size[1]])
    axis, side = rng.choice(3, count, p=area / area.sum()), rng.integers(0, 2, count)
    points, normals = rng.uniform(size=(count, 3)), np.zeros((count, 3))
    points[np.arange(count), axis], normals[np.arange(count), axis] = side, 2.0 * side - 1.0
    rotation = se3.rotation_exp([0.0, 0.0, turn])
    return (points - 0.5) * size @ rotation.T + at, normals @ rotation.T


def sheet(rng, count, side):
    """Points and normals of the front (1) or the back (-1) of a bent sheet of even thickness."""
    x, y = rng.uniform(-0.6, 0.6, count), rng.uniform(-0.45, 0.45, count)
    bump = 0.12 * np.exp(-12.0 * ((x - 0.2) ** 2 + (y + 0.15) ** 2))
    z = 0.05 * np.sin(5.0 * x + 0.3) * np.cos(6.0 * y) + 0.04 * x + bump
    along_x = 0.25 * np.cos(5.0 * x + 0.3) * np.cos(6.0 * y) + 0.04 - 24.0 * bump * (x - 0.2)
    along_y = -0.3 * np.sin(5.0 * x + 0.3) * np.sin(6.0 * y) - 24.0 * bump * (y + 0.15)
    normals = side * np.stack([-along_x, -along_y, np.ones(count)], axis=1)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return np.stack([x, y, z + 0.5 * side * THICK], axis=1), normals


def board(side, seed, count=3000):
    """One face of the sheet, and three blocks beside it that are seen from either side."""
    rng = np.random.default_rng(seed)
    parts = [
        sheet(rng, count, side),
        block(rng, count // 3, (0.25, 0.2, 0.3), (0.75, -0.2, 0.05), 0.3),
        block(rng, count // 3, (0.2, 0.3, 0.15), (-0.75, 0.3, -0.1), 1.0),
        block(rng, count // 4, (0.12, 0.15, 0.4), (-0.8, -0.35, 0.1), 0.7),
    ]
    points, normals = (np.concatenate(each) for each in zip(*parts, strict=True))
    return points + rng.normal(0.0, 0.001, points.shape), normals


def pair():
    """Front and back: points and normals of both, the first ``TRUE`` away from the second."""
    (front, out), back = board(1.0, 0), board(-1.0, 10)
    inverse = se3.inverse(TRUE)
    return se3.transform(inverse, front), out @ inverse[:3, :3].T, *back


def registered(source, source_normals, target, target_normals, init=None):
    return hmrf_icp.register(
        PointCloud(source, normals=source_normals),
        PointCloud(target, normals=target_normals),
        np.eye(4) if init is None else init,
    )


@pytest.fixture(scope="module")
def plain():
    source, _, target, _ = pair()
    return registered(source, None, target, None)


@pytest.fixture(scope="module")
def with_sides():
    return registered(*pair())


def test_a_face_is_not_laid_on_the_back_of_it_where_normals_tell_them_apart(plain, with_sides):
    # Laid on each other the faces agree better than the blocks, which are fewer.
    assert se3.error(plain.transformation, TRUE)[0] == pytest.approx(THICK, abs=0.005)
    metres, radians = se3.error(with_sides.transformation, TRUE)
    assert metres < 0.001
    assert radians < 0.003
    assert with_sides.believed
    for view in (with_sides.source_view, with_sides.target_view):
        assert view.sides
        assert "sides by its normals" in view.text


def judged(points, normals):
    surface = prepare(PointCloud(points, normals=normals)).surface
    return sides(surface, normals)


def rows_of(count):
    return np.random.default_rng(3).permutation(count)


def test_normals_of_nonsense_are_told_and_change_nothing(plain):
    source, out, target, back = pair()
    rng = np.random.default_rng(7)
    nonsense = {
        "noise": (rng.normal(size=out.shape), rng.normal(size=back.shape)),
        "none": (np.full(out.shape, np.nan), np.full(back.shape, np.inf)),
        "zero": (np.zeros(out.shape), np.zeros(back.shape)),
        "constant": (np.tile([1.0, 0.0, 0.0], (len(out), 1)),) * 2,
        "another frame": (out[:, [1, 2, 0]], back[:, [1, 2, 0]]),
        "random signs": tuple(n * rng.choice([-1.0, 1.0], len(n))[:, None] for n in (out, back)),
    }
    for mine, theirs in nonsense.values():
        assert not judged(source, mine).known
        assert not judged(target, theirs).known
    result = registered(source, nonsense["noise"][0], target, nonsense["random signs"][1])
    np.testing.assert_array_equal(result.transformation, plain.transformation)
    assert result.confidence == plain.confidence
    assert "normals not used: they are not those of its surface" in result.source_view.text
    assert "normals not used: neighbours face opposite ways" in result.target_view.text


def test_one_cloud_inside_out_is_registered_as_without_normals():
    # The same side of both: that is where the right pose is, whatever the signs say.
    source, out = board(1.0, 0)
    target, same = board(1.0, 5)
    source, out = se3.transform(se3.inverse(TRUE), source), out @ TRUE[:3, :3]
    bare, mixed = (registered(source, n, target, m) for n, m in ((None, None), (-out, same)))
    np.testing.assert_array_equal(mixed.transformation, bare.transformation)
    assert se3.error(mixed.transformation, TRUE)[0] < 0.001
    assert mixed.believed
    assert "normals not used" in mixed.target_view.text
    # Both inside out contradict each other nowhere.
    both = registered(source, -out, target, -same)
    assert both.source_view.sides
    assert se3.error(both.transformation, TRUE)[0] < 0.001


def test_normals_of_any_length_tell_the_same(with_sides):
    source, out, target, back = pair()
    rng = np.random.default_rng(0)
    lengths = 10.0 ** rng.uniform(-250.0, 250.0, len(out))
    result = registered(source, lengths[:, None] * out, target, 3.0 * back)
    np.testing.assert_array_equal(result.transformation, with_sides.transformation)
    assert result.confidence == with_sides.confidence


def test_clouds_that_are_moved_and_in_another_order_are_registered_as_before(with_sides):
    source, out, target, back = pair()
    one, other = (
        se3.exp([0.9, -0.4, 1.7, 3.0, -2.0, 1.0]),
        se3.exp([-1.2, 0.3, 0.8, -1.0, 4.0, 2.0]),
    )
    mine, theirs = rows_of(len(source)), rows_of(len(target))
    result = registered(
        se3.transform(one, source)[mine],
        (out @ one[:3, :3].T)[mine],
        se3.transform(other, target)[theirs],
        (back @ other[:3, :3].T)[theirs],
        other @ se3.inverse(one),
    )
    assert result.source_view.sides
    pose = se3.inverse(other) @ result.transformation @ one
    assert se3.error(pose, with_sides.transformation)[0] < 0.001
    assert result.believed


def test_where_it_is_known_where_both_were_seen_from_normals_have_no_say():
    bare = hmrf_icp.register(frame(8), frame(0), truth(8, 0))
    given = []
    for one, sign in ((frame(8), 1.0), (frame(0), -1.0)):
        normals = one.on_grid(sign * prepare(one).surface.normals)
        given.append(PointCloud(one.points, one.camera, normals=normals))
        cloud = prepare(given[-1])
        assert cloud.sided is cloud
    result = hmrf_icp.register(*given, truth(8, 0))
    np.testing.assert_array_equal(result.transformation, bare.transformation)
    assert result.source_view == bare.source_view


def fused_with_sides(first, second):
    """Two views in the frame of the first with normals towards the camera of each point."""
    there = truth(second, first)
    parts = [(frame(first), np.eye(4)), (frame(second), there)]
    points = np.concatenate([se3.transform(p, one.observed_points) for one, p in parts])[::2]
    normals = [prepare(one).surface.normals @ pose[:3, :3].T for one, pose in parts]
    return points, np.concatenate(normals)[::2]


def test_fused_views_have_sides_and_are_registered_by_them():
    (source, out), (target, back) = fused_with_sides(3, 13), fused_with_sides(0, 10)
    result = registered(source, out, target, back, truth(3, 0))
    assert result.source_view.sides
    assert not result.visibility.views
    assert off(result.transformation, truth(3, 0), PointCloud(source)) < 0.01


def test_signs_are_believed_that_go_on_round_bends():
    points, out = board(1.0, 0)
    assert judged(points, out).known
    assert judged(points, -out).known
    noisy = out + np.random.default_rng(1).normal(0.0, 0.12, out.shape)
    assert judged(points, noisy).known
    # Turned into one half space: blocks have opposite faces that get the same sign.
    half = out * np.where(out @ [0.3, 0.9, 0.1] < 0.0, -1.0, 1.0)[:, None]
    assert judged(points, half).text == "neighbours face opposite ways"
    # Coherent patch by patch, as an eigenvector's sign is.
    patch = (np.floor(points * [7.0, 5.0, 6.0]).sum(axis=1) % 2.0)[:, None]
    assert not judged(points, out * (2.0 * patch - 1.0)).known
    # One in eight of the sheet is the wrong way round, and all goes on round the blocks' edges.
    dotted = out.copy()
    dotted[:3000:8] *= -1.0
    assert not judged(points, dotted).known
    # A seam across the sheet: hardly a neighbour notices.
    halves = out.copy()
    halves[:3000][points[:3000, 0] < 0.0] *= -1.0
    assert judged(points, halves).text == "a seam divides its surface"
    plane = points * [1.0, 1.0, 0.0] + [0.0, 0.0, 1.0]
    up = np.tile([0.0, 0.0, 1.0], (len(plane), 1))
    assert "nothing bends" in judged(plane, up).text


def test_points_without_a_usable_normal_get_the_side_of_the_nearest_that_has_one():
    points, out = board(1.0, 0)
    some = out.copy()
    some[::5], some[1::5] = np.nan, out[1::5]
    surface = prepare(PointCloud(points)).surface
    turned = facing(surface, some)
    assert turned.oriented
    clear = np.abs((surface.normals * out).sum(axis=1)) > 0.8
    assert ((turned.normals * out).sum(axis=1)[clear] > 0.0).mean() > 0.99
    np.testing.assert_array_equal(np.abs(turned.normals), np.abs(surface.normals))


@pytest.mark.parametrize("organised", [False, True])
def test_normals_stay_with_their_points_however_these_are_thinned_or_shifted(organised):
    rng = np.random.default_rng(0)
    points = rng.uniform(0.5, 2.0, size=(30, 40, 3) if organised else (1200, 3))
    points[::7, ...] = np.nan
    far = np.array([5e5, 4e5, 0.0])
    cloud = prepare(PointCloud(points + far, normals=points))  # each names its point
    shift = cloud.origin - far
    assert shift.any()
    for one in (cloud, cloud.viewed, cloud.downsampled(200), cloud.viewed.downsampled(200)):
        assert one.cloud.normals.shape == one.cloud.points.shape
        named = one.cloud.normals[one.cloud.observed] - shift
        np.testing.assert_allclose(one.points, named, atol=1e-9)
    assert len(cloud.downsampled(200)) <= 200


def test_normals_of_a_list_that_is_a_depth_map_are_laid_out_with_it():
    points = frame(0, noise=0.0).observed_points
    points = points[rows_of(len(points))]
    viewed = prepare(PointCloud(points, normals=points)).viewed
    assert viewed.cloud.organised
    np.testing.assert_allclose(viewed.cloud.normals, viewed.cloud.points, atol=1e-9)
