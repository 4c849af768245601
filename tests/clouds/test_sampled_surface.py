"""Points on a mesh lie on it, are spread evenly, and are the same every time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from hmrf_icp import InputError
from hmrf_icp.clouds.sampled_surface import sampled_surface, vertices_suffice

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
HALVES = np.array([[0, 1, 2], [0, 2, 3]])


def grid(count):
    """A unit square of ``count`` x ``count`` vertices."""
    y, x = np.mgrid[0 : 1 : count * 1j, 0 : 1 : count * 1j]
    rows = np.arange(count * count).reshape(count, count)
    a, b, c, d = (
        part.ravel() for part in (rows[:-1, :-1], rows[:-1, 1:], rows[1:, :-1], rows[1:, 1:])
    )
    vertices = np.c_[x.ravel(), y.ravel(), np.zeros(count * count)]
    return vertices, np.r_[np.c_[a, b, c], np.c_[b, d, c]]


@pytest.mark.parametrize("mesh", [(SQUARE, HALVES), grid(10), grid(80)], ids=["2", "162", "12482"])
def test_samples_are_more_even_than_chance(mesh):
    points = sampled_surface(*mesh, 4000).points
    chance = np.random.default_rng(0).uniform(size=(4000, 2))
    asked = np.random.default_rng(1).uniform(0.05, 0.95, size=(5000, 2))

    def unevenness(each):
        nearest = cKDTree(each).query(each, 2)[0][:, 1]
        return nearest.std() / nearest.mean(), cKDTree(each).query(asked)[0].max()

    ours, theirs = unevenness(points[:, :2]), unevenness(chance)
    assert ours[0] < 0.85 * theirs[0]  # distances to the nearest vary less
    assert ours[1] < 0.85 * theirs[1]  # and the largest hole is smaller


def test_every_part_gets_what_its_area_is_worth():
    vertices = np.r_[SQUARE, 3.0 * SQUARE + [0.0, 0.0, 5.0]]
    points = sampled_surface(vertices, np.r_[HALVES, HALVES + 4], 1000).points
    assert np.count_nonzero(points[:, 2] == 5.0) == pytest.approx(900, abs=1)


def test_normals_are_those_of_the_faces_and_nothing_is_left_to_chance():
    first = sampled_surface(SQUARE, HALVES, 500)
    assert first == sampled_surface(SQUARE, HALVES, 500)
    np.testing.assert_array_equal(first.normals, [[0.0, 0.0, 1.0]] * 500)
    turned = sampled_surface(SQUARE, HALVES[:, ::-1], 500)
    np.testing.assert_array_equal(turned.normals, [[0.0, 0.0, -1.0]] * 500)


def test_columns_of_the_vertices_are_those_of_the_samples():
    columns = {
        "red": np.array([0, 255, 255, 0], np.uint8),
        "height": np.array([0.0, 1.0, 1.0, 0.0], np.float32),
        "label": np.array([7, 9, 9, 7]),
    }
    cloud = sampled_surface(SQUARE, HALVES, 500, columns)
    x = cloud.points[:, 0]
    np.testing.assert_allclose(cloud.attributes["red"], 255 * x, atol=0.51)
    np.testing.assert_allclose(cloud.attributes["height"], x, atol=1e-6)
    assert set(cloud.attributes["label"].tolist()) == {7, 9}
    assert (cloud.attributes["label"][x > 0.7] == 9).all()


def test_vertices_of_a_scan_suffice_and_those_of_a_drawing_do_not():
    assert vertices_suffice(*grid(80))
    assert not vertices_suffice(*grid(10))
    # A fine fillet beside a plane of two triangles: most of the surface has no vertices.
    fine, faces = grid(80)
    both = np.r_[0.01 * fine, SQUARE], np.r_[faces, HALVES + len(fine)]
    assert not vertices_suffice(*both)


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        ([[0, 1, 9]], "lists vertices that are not among the 4"),
        ([[0, 1, 1]], "without a face that has an area"),
        (np.empty((0, 3), int), "without a face that has an area"),
    ],
)
def test_what_is_no_surface(faces, message):
    with pytest.raises(InputError, match=message):
        sampled_surface(SQUARE, np.asarray(faces), 10)
