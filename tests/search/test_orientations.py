"""Rotations come out of how surfaces face, in whatever frame they stand."""

import math

import numpy as np
import pytest

from hmrf_icp import se3
from hmrf_icp.kernels.orientations import rate
from hmrf_icp.search.orientations import (
    APART,
    COVERING,
    Orientations,
    covering,
    likely_rotations,
    sphere,
)

TURN = se3.rotation_exp([0.4, -1.9, 1.2])


def angles(rotations, truth):
    """Angle of each rotation (K, 3, 3) from the true one, radians."""
    trace = np.einsum("kij,ij->k", rotations, truth)
    return np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0))


def around(directions, counts, spread=0.05, seed=0):
    """Unit normals about some directions, so many of each."""
    rng = np.random.default_rng(seed)
    normals = np.repeat(np.asarray(directions, dtype=float), counts, axis=0)
    normals += rng.normal(0.0, spread, normals.shape)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def test_no_rotation_is_far_from_the_covering():
    cover = covering(COVERING)
    rng = np.random.default_rng(1)
    for vector in rng.normal(size=(200, 3)) * 2.0:
        assert angles(cover, se3.rotation_exp(vector)).min() < math.radians(13.0)
    np.testing.assert_allclose(cover @ cover.transpose(0, 2, 1) - np.eye(3), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(cover), 1.0)


def test_directions_are_unit_and_favour_no_side():
    directions = sphere(400)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    np.testing.assert_allclose(directions.mean(axis=0), 0.0, atol=1e-2)
    np.testing.assert_allclose(directions.T @ directions / 400, np.eye(3) / 3.0, atol=1e-2)


def test_three_walls_seen_from_inside_leave_one_rotation():
    room = around([[1, 0, 0], [0, 1, 0], [0, 0, 1]], [900, 500, 300])
    source, target = (Orientations.of(n, True) for n in (room, room @ TURN.T))
    rotations, alike = likely_rotations(source, target, 10)
    assert angles(rotations, TURN)[0] < math.radians(3.0)
    assert (np.diff(alike) <= 0).all()


def test_parts_that_only_one_cloud_saw_do_not_hide_the_rotation():
    shared = np.eye(3).tolist()
    source = around([*shared, [0.58, 0.58, -0.58]], [300, 300, 300, 600])
    target = around([*shared, [-0.8, 0.0, 0.6]], [400, 300, 200, 600], seed=1) @ TURN.T
    found, _ = likely_rotations(Orientations.of(source, True), Orientations.of(target, True), 20)
    assert angles(found, TURN).min() < math.radians(6.0)


def test_where_no_viewpoint_is_known_signs_mean_nothing():
    room = around([[1, 0, 0], [0, 1, 0], [0.3, 0.2, 0.9]], [900, 500, 300])
    signs = np.random.default_rng(2).choice([-1.0, 1.0], len(room))[:, None]
    plain, mixed = (Orientations.of(normals, False) for normals in (room, signs * room))
    np.testing.assert_allclose(plain.table, mixed.table, atol=1e-9)
    found, _ = likely_rotations(mixed, Orientations.of(room @ TURN.T, False), 20)
    assert angles(found, TURN).min() < math.radians(4.0)


@pytest.mark.parametrize("signed", [True, False])
def test_one_plane_leaves_its_turns_apart_from_each_other(signed):
    plane = around([[0, 0, 1]], [2000], spread=0.02)
    image = Orientations.of(plane, signed)
    found, alike = likely_rotations(image, image, 20)
    assert len(found) == 20
    tilt = found[:, 2, 2] if signed else np.abs(found[:, 2, 2])
    good = alike > 0.9 * alike[0]
    assert good.sum() >= 10
    assert (tilt[good] > math.cos(math.radians(6.0))).all()
    for k in range(20):
        assert (angles(np.delete(found, k, axis=0), found[k]) >= APART - 1e-6).all()


@pytest.mark.parametrize("signed", [True, False])
def test_a_surface_turned_over_is_alike_where_sides_are_not_known_and_only_there(signed):
    image = Orientations.of(around([[0.3, 0.2, 0.9], [0.9, -0.1, 0.2]], [900, 500]), signed)
    over = np.array([np.eye(3), -np.eye(3)])  # both normals reversed
    same, turned = rate(over, image.directions, image.weight, image.table)
    if signed:
        assert turned < 0.1 * same
    else:
        assert turned == pytest.approx(same, rel=0.05)


def test_a_wall_without_a_side_faces_both_ways_however_sharply():
    """Sharper than the directions that are counted: of these, one or its opposite holds it all."""
    for facing in np.random.default_rng(0).normal(size=(5, 3)):
        image = Orientations.of(around([facing], [300], spread=0.0), False)
        both = np.array([np.eye(3), -np.eye(3)])
        same, turned = rate(both, image.directions, image.weight, image.table)
        assert turned == pytest.approx(same, rel=0.05)
