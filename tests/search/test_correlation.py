"""Shifts come out of where surfaces agree, and of where nothing can be."""

import numpy as np
import pytest

from hmrf_icp import se3
from hmrf_icp.kernels.correlation import vertex
from hmrf_icp.search.correlation import Correlator, Sampled, empty_cells, rarity

CELLS = 32
EYE = np.array([0.0, 0.0, -3.0])


def facing(points, normals, viewpoint):
    """Turn the normals towards the viewpoint."""
    towards = ((viewpoint - points) * normals).sum(axis=1)
    return normals * np.where(towards < 0.0, -1.0, 1.0)[:, None]


def corner(seed=0, count=800):
    """Three sides of a box that meet, each as large, seen from EYE."""
    rng = np.random.default_rng(seed)
    points, normals = [], []
    for axis in range(3):
        side = rng.uniform(-1.0, 1.0, (count, 3))
        side[:, axis] = 1.0
        points.append(side)
        normals.append(np.tile(np.eye(3)[axis], (count, 1)))
    points, normals = np.concatenate(points), np.concatenate(normals)
    return points, facing(points, normals, EYE)


def cloud(points, normals, viewpoint=EYE, signed=True):
    return Sampled(points, normals, signed, points, viewpoint)


def moved(one, pose):
    """The same cloud, moved by a pose with its viewpoint."""
    place = None if one.viewpoint is None else se3.transform(pose, one.viewpoint)
    points = se3.transform(pose, one.points)
    return Sampled(points, one.normals @ pose[:3, :3].T, one.signed, points, place)


@pytest.mark.parametrize("viewpoint", [EYE, None])
@pytest.mark.parametrize("unit", [1.0, 1000.0])
def test_the_shift_of_a_corner_is_found_in_any_unit(viewpoint, unit):
    points, normals = corner()
    known = viewpoint is not None
    source = cloud(unit * points, normals, unit * viewpoint if known else None, known)
    pose = se3.rigid(se3.rotation_exp([0.3, -0.8, 2.0]), unit * np.array([3.0, -7.0, 0.4]))
    correlator = Correlator(source, moved(source, pose), CELLS)
    shifts, scores = correlator.peaks(pose[:3, :3], 5)
    assert np.abs(shifts[0] - pose[:3, 3]).max() < correlator.cell
    assert (np.diff(scores) <= 0).all()


def test_backs_do_not_agree_with_fronts():
    points, normals = corner()
    source = cloud(points, normals, None)
    same = Correlator(source, source, CELLS).peaks(np.eye(3), 1)[1][0]
    turned = cloud(points, -normals, None)
    _, scores = Correlator(source, turned, CELLS).peaks(np.eye(3), 1)
    assert len(scores) == 0 or scores[0] < same - 1.0


def test_no_point_stands_in_a_cell_that_was_seen_to_be_empty():
    points, normals = corner()
    edge = 0.2
    empty = empty_cells(cloud(points, normals), edge)
    assert len(empty) > 50
    apart = np.abs(empty[:, None] - points[None]).max(axis=2).min(axis=1)
    assert apart.min() >= edge
    towards = (empty - EYE) @ np.array([0.0, 0.0, 1.0])
    assert (towards > 0).all()
    assert (empty < 1.0).all()


def test_nothing_is_empty_where_no_viewpoint_is_known():
    points, normals = corner()
    assert len(empty_cells(cloud(points, normals, None), 0.2)) == 0


def test_a_wall_is_not_put_where_the_other_sensor_saw_through():
    # Two parallel walls, one before the other beside it: the source saw the hind one alone.
    rng = np.random.default_rng(3)
    hind = np.column_stack([rng.uniform(-2, 2, (1500, 2)), np.full(1500, 1.0)])
    fore = np.column_stack([rng.uniform(2, 4, 700), rng.uniform(-2, 2, 700), np.zeros(700)])
    both = np.concatenate([hind, fore])
    normals = np.tile([0.0, 0.0, -1.0], (len(both), 1))
    target, source = cloud(both, normals), cloud(hind, normals[: len(hind)])
    shifts, _ = Correlator(source, target, CELLS).peaks(np.eye(3), 1)
    assert np.abs(shifts[0]).max() < 0.3


def test_the_few_that_face_elsewhere_are_rare():
    normals = np.repeat(np.eye(3), [1000, 100, 10], axis=0)
    rare = rarity(normals, True)
    assert rare[0] < rare[1000] < rare[1100]
    assert rare[1100] / rare[0] == pytest.approx(100.0, rel=0.05)


def test_a_few_points_far_off_do_not_make_the_cells_larger():
    points, normals = corner()
    far = np.arange(len(points)) % 100 == 0
    spoilt = cloud(np.where(far[:, None], 50.0 * points, points), normals)
    sound = cloud(points, normals)
    usual = Correlator(sound, sound, CELLS).cell
    assert Correlator(spoilt, spoilt, CELLS).cell < 1.5 * usual


@pytest.mark.parametrize("known", ["source", "target"])
def test_of_two_places_that_agree_alike_the_one_that_leaves_empty_space_empty_comes_first(known):
    """A niche on a wall, its back the largest part: then its sides stand in what was seen."""
    rng = np.random.default_rng(0)

    def patch(low, high, depth, count):
        sides = rng.uniform([low, -0.5], [high, 0.5], (count, 2))
        return np.column_stack([sides, np.full(count, depth)])

    # A side wall: what was seen to be empty is told as far as the points reach.
    aside = np.column_stack([np.full(900, -1.5), rng.uniform([-0.5, 0.0], [0.5, 2.0], (900, 2))])
    towards = np.repeat([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0]], [2100, 900], axis=0)
    sides = patch(-0.6, 0.0, 1.0, 420), patch(1.5, 2.1, 1.0, 420)
    niche = np.concatenate([*sides, patch(0.0, 1.5, 2.0, 1050)])
    niche = cloud(niche, np.tile([0.0, 0.0, -1.0], (1890, 1)), None)
    wall = np.concatenate([patch(-1.5, 1.5, 2.0, 2100), aside])
    seen = cloud(wall, towards)
    pair = (seen, niche) if known == "source" else (niche, seen)
    shifts, _ = Correlator(*pair, CELLS).peaks(np.eye(3), 1)
    # The back of the niche lies on it otherwise, a shift of none.
    assert shifts[0][2] == pytest.approx(-1.0 if known == "source" else 1.0, abs=0.2)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_sheet_does_not_agree_with_its_back(axis):
    sheet = np.random.default_rng(axis).uniform(-1.0, 1.0, (1500, 3))
    sheet[:, axis] = 0.0
    facing = np.tile(np.eye(3)[axis], (1500, 1))
    front, back = cloud(sheet, facing, None), cloud(sheet, -facing, None)
    (same,) = Correlator(front, front, CELLS).peaks(np.eye(3), 1)[1]
    other = Correlator(front, back, CELLS).peaks(np.eye(3), 1)[1]
    assert max(other, default=-np.inf) < same - 1.0


def test_surfaces_that_cross_have_nothing_in_common_where_sides_are_not_known():
    sheet = np.random.default_rng(0).uniform(-1.0, 1.0, (1500, 3)) * [1.0, 1.0, 0.0]
    across = np.array([np.sqrt(2.0 / 3.0), 0.0, np.sqrt(1.0 / 3.0)])
    one, other = (
        cloud(sheet, np.tile(normal, (1500, 1)), None, False) for normal in ([0, 0, 1.0], across)
    )
    (same,) = Correlator(one, one, CELLS).peaks(np.eye(3), 1)[1]
    crossing = Correlator(one, other, CELLS).peaks(np.eye(3), 1)[1]
    assert max(crossing, default=-np.inf) < same - 2.0


def parts():
    """The corner, and what of it is on one side, five times."""
    points, normals = corner()
    for way in np.random.default_rng(0).normal(size=(5, 3)):
        some = points @ way < 0.3
        yield cloud(points[some], normals[some]), cloud(points, normals)


def test_a_parabola_tells_where_between_cells_a_peak_is():
    assert vertex(1.0, 3.0, 1.0) == 0.0
    for at in (-0.4, 0.1, 0.3):
        before, here, after = (5.0 - 2.0 * (x - at) ** 2 for x in (-1.0, 0.0, 1.0))
        assert vertex(before, here, after) == pytest.approx(at)
    assert abs(vertex(3.0, 3.0, 1.0)) <= 0.5


def test_of_a_peak_the_highest_cell_alone_counts():
    part, whole = next(parts())
    correlator = Correlator(part, whole, CELLS)
    shifts, _ = correlator.peaks(np.eye(3), 8)
    apart = np.abs(shifts[:, None] - shifts[None]).max(axis=2)[np.triu_indices(len(shifts), 1)]
    assert apart.min() > 1.0 * correlator.cell
