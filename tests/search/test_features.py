"""Features, their matches and groups: statements by hand, beside those of the hypotheses."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from hmrf_icp import PreparedCloud, se3
from hmrf_icp.kernels import consistency, features
from hmrf_icp.search.consistent_groups import Oriented, motions
from hmrf_icp.search.feature_matches import match
from hmrf_icp.search.features import describe
from hmrf_icp.search.hypotheses import (
    ALIKE,
    Matched,
    _different,
    among,
    hypotheses,
    placed,
    spread,
)
from hmrf_icp.search.normal_signs import agreeing
from hmrf_icp.search.surface_agreement import Agreement
from views import frame, off, truth

FAR = se3.exp([2.0, -1.0, 0.5, 3.0, -2.0, 1.0])


@functools.cache
def sides():
    """Two views of the desk, the source in a frame of its own."""
    mine, theirs = (PreparedCloud(frame(k)).surface for k in (8, 0))
    return (
        se3.transform(FAR, mine.points),
        mine.normals @ FAR[:3, :3].T,
        theirs.points,
        theirs.normals,
    )


@functools.cache
def described(edge=0.04, oriented=True):
    one, facing, other, onto = sides()
    return describe(one, facing, edge, oriented), describe(other, onto, edge, oriented)


TRUE = truth(8, 0) @ se3.inverse(FAR)


def unit(rng, *shape):
    vectors = rng.normal(size=shape)
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def test_features_look_at_two_radii():
    one, _ = described()
    assert one.values.shape == (len(one.points), 66)
    assert not np.allclose(one.values[:, :33], one.values[:, 33:])


def test_the_features_of_a_place_are_nearest_to_its_own_seen_again_more_often_than_by_chance():
    source, target = described()
    pairs = match(source.values, target.values, 200)
    there = se3.transform(TRUE, source.points[pairs.source])
    right = np.linalg.norm(there - target.points[pairs.target], axis=1) < 3.0 * source.edge
    assert pairs.mutual.all()
    assert right.mean() > 0.25


def test_mutual_matches_come_first_and_of_each_kind_the_closest():
    source = np.array([[0.0], [1.0], [5.0], [5.3]], dtype=np.float32)
    target = np.array([[0.4], [1.1], [5.05]], dtype=np.float32)
    pairs = match(source, target, 10)
    assert [tuple(p) for p in zip(pairs.source, pairs.target, strict=True)] == [
        (2, 2),
        (1, 1),
        (0, 0),
        (3, 2),
    ]
    np.testing.assert_array_equal(pairs.mutual, [True, True, True, False])
    # The last is closer than the third, and still comes after it.
    assert pairs.distance[3] < pairs.distance[2]


def test_a_histogram_changes_little_where_the_third_angle_goes_round():
    """A point and one beside it, seen from behind: noise takes the angle from pi to minus pi."""
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    cells, span = np.zeros(2, dtype=np.int64), np.array([1, 1, 1])
    votes = []
    for tilt in (-0.02, 0.02):
        facing = np.array([[0.0, 0.0, 1.0], [np.sin(tilt), 0.0, -np.cos(tilt)]])
        votes.append(features.simple(points, facing, cells, span, 10.0, points[0])[0, 22:])
    np.testing.assert_allclose(votes[0], votes[1], atol=0.08)
    # Half a vote each for the first bin and the last.
    np.testing.assert_allclose(votes[0][[0, 10]], 0.5, atol=0.08)


def matched(count, seed=0):
    rng = np.random.default_rng(seed)
    points, normals = rng.uniform(size=(count, 3)), unit(rng, count, 3)
    return points, normals, se3.transform(FAR, points), normals @ FAR[:3, :3].T


def test_places_that_fit_make_no_group_where_their_normals_do_not():
    points, normals, onto, facing = matched(40)
    fits, _ = motions(Oriented(points, normals), Oriented(onto, facing), 0.01, 50)
    assert off_from_far(fits).min() < 0.01
    elsewhere = facing[np.random.default_rng(1).permutation(40)]
    none, explained = motions(Oriented(points, normals), Oriented(onto, elsewhere), 0.01, 50)
    assert len(none) == 0 or explained.max() < 12


def test_places_of_a_plan_of_another_scale_do_not_fit_though_all_normals_do():
    rng = np.random.default_rng(0)
    plan = np.column_stack([rng.uniform(size=(40, 2)), np.zeros(40)])
    up = np.tile([0.0, 0.0, 1.0], (40, 1))
    same, larger = (
        consistency.compatible(plan, up, scale * plan, up, 0.01, 0.1, 0.3) for scale in (1.0, 1.5)
    )
    assert same.any()
    assert not larger.any()


def off_from_far(poses):
    corners = np.concatenate([np.eye(3), -np.eye(3)])
    return np.abs(placed(poses, corners) - placed(FAR[None], corners)).max(axis=1)


def bits_of(edges, count):
    bits = np.zeros((count, 1), dtype=np.uint64)
    for i, j in edges:
        bits[i, 0] |= np.uint64(1) << np.uint64(j)
        bits[j, 0] |= np.uint64(1) << np.uint64(i)
    return bits


CLIQUE = [(i, j) for i in range(5) for j in range(i)]
STAR = [(10, j) for j in range(11, 30)]


def test_a_match_is_worth_its_triangles_and_not_its_edges():
    worth = consistency.support(bits_of(CLIQUE + STAR, 40))
    np.testing.assert_array_equal(worth[:5], 12.0)
    np.testing.assert_array_equal(worth[10:30], 0.0)


def test_the_members_of_a_group_all_fit_each_other_and_groups_spread():
    other = [(i, j) for i in range(20, 24) for j in range(20, i)]
    bits = bits_of([*CLIQUE, *other, (0, 20), (1, 30)], 40)
    found = consistency.groups(bits, np.array([0, 1, 2, 3, 4, 20, 21, 30]), 8, 1, 12)
    groups = [sorted(row[row >= 0]) for row in found]
    assert groups == [[0, 1, 2, 3, 4], [20, 21, 22, 23], [1, 30]]


def test_the_motion_of_a_group_is_that_of_all_it_explains():
    rng = np.random.default_rng(0)
    points, normals, onto, facing = matched(300)
    onto = onto + 0.004 * rng.standard_normal(onto.shape)
    members = np.full((1, 12), -1)
    members[0, :4] = np.arange(4)
    (pose,), (explained,) = consistency.motions(members, points, normals, onto, facing, 0.03)
    assert explained > 250
    assert off_from_far(pose[None])[0] < 0.004


def test_parts_that_are_apart_both_face_the_middle():
    rng = np.random.default_rng(0)
    line = np.linspace(-1.0, 1.0, 21)
    a, b = (grid.ravel() for grid in np.meshgrid(line, line))
    walls = [np.column_stack([a, b, np.full(a.size, z)]) for z in (-2.0, 2.0)]
    points = np.concatenate(walls) + 1e-3 * rng.standard_normal((2 * a.size, 3))
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1)) * rng.choice([-1.0, 1.0], (len(points), 1))
    facing = agreeing(points, normals, 0.1)
    assert (facing[:, 2] * points[:, 2] < 0.0).all()


def test_a_sign_is_handed_on_round_a_bend():
    """A tube, slit, and the middle of the cloud beside it: one half faces it from outside."""
    rng = np.random.default_rng(0)
    angle = np.linspace(0.0, 1.8 * np.pi, 120)
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(120)])
    points = np.concatenate(
        [*(ring + np.array([0.0, 0.0, z]) for z in (0.0, 0.05, 0.1)), *[[[9.0, 0, 0]]] * 360]
    )
    normals = np.concatenate([ring] * 3 + [[[1.0, 0.0, 0.0]]] * 360)
    facing = agreeing(points, normals * rng.choice([-1.0, 1.0], (len(points), 1)), 0.05)
    outward = (facing[:360] * normals[:360]).sum(axis=1)
    assert (outward > 0.0).all() or (outward < 0.0).all()


def test_most_of_a_part_faces_the_middle_whatever_its_farthest_corner_does():
    """A shelf over the middle of the cloud, its far end bent up, away from it."""
    long, bend, short = np.linspace(1.0, 3.0, 41), np.linspace(0.0, 0.5 * np.pi, 5), [0.65, 0.7]
    along = [(x, 0.5) for x in long[:-1]]
    along += [(3.0 + 0.1 * np.sin(a), 0.6 - 0.1 * np.cos(a)) for a in bend]
    along += [(3.1, z) for z in short]
    facing = [(0.0, 1.0)] * 40 + [(-np.sin(a), np.cos(a)) for a in bend] + [(-1.0, 0.0)] * 2
    width = 0.05 * np.arange(5)
    shelf = np.array([(x, y, z) for x, z in along for y in width])
    normals = np.array([(x, 0.0, z) for x, z in facing for _ in width])
    rest = np.tile([-2.2, 0.1, -0.5], (len(shelf), 1))
    turned = agreeing(
        np.concatenate([shelf, rest]),
        np.concatenate([normals, np.tile([1.0, 0, 0], rest[:, :1].shape)]),
        0.05,
    )[: len(shelf)]
    np.testing.assert_allclose(turned, -normals)


@pytest.fixture(scope="module")
def found():
    return hypotheses(*sides(), True, 30)


def test_ten_copies_of_a_hypothesis_are_one():
    points = sides()[0]
    _, size = spread(points)
    poses = np.array([TRUE] * 10 + [FAR] * 10)
    poses[:, 0, 3] += 0.1 * ALIKE * size * np.linspace(-1.0, 1.0, 20)
    assert _different(poses, np.arange(20.0)[::-1], points, 5).tolist() == [0, 10]


def test_the_likeliest_hypothesis_has_settled_on_the_surfaces(found):
    gap = se3.transform(found.poses[0], sides()[0]) - se3.transform(TRUE, sides()[0])
    assert np.sqrt((gap**2).sum(axis=1).mean()) < 0.002


def test_the_finer_places_lay_views_that_share_little_closely_on_each_other():
    source, target = (PreparedCloud(frame(index)).surface for index in (45, 20))
    poses = hypotheses(source.points, source.normals, target.points, target.normals, True, 30).poses
    apart = min(off(pose, truth(45, 20), frame(45)) for pose in poses)
    assert apart < 0.01 * source.size


def test_a_hypothesis_is_scored_by_how_surfaces_agree_and_by_how_many_matches_it_explains():
    agreement = Agreement(*described(), True)
    beside = TRUE.copy()
    beside[:3, 3] += [0.0, 0.6, 0.4]
    right, wrong = agreement.score(np.array([TRUE, beside]), np.array([10.0, 10.0]))
    assert right > wrong + 0.5
    few, many = agreement.score(np.array([TRUE, TRUE]), np.array([3.0, 300.0]))
    assert many > few + 1.0


def test_two_levels_find_what_either_finds():
    levels = [Matched.of(*described(edge)) for edge in (0.03, 0.05)]
    both = among(levels, True, 50).poses
    for level in levels:
        best = among([level], True, 50).poses[0]
        assert min(off(pose, best, frame(8)) for pose in both) < 0.5
