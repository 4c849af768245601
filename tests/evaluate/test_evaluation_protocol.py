from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import spinning
from hmrf_icp import prepare, se3
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.errors import InputError
from hmrf_icp.evaluate.angles import parse_angle, parse_start
from hmrf_icp.evaluate.plan import RUNS_PER_TASK, Plan
from hmrf_icp.evaluate.protocol import (
    Axes,
    Pair,
    Start,
    decile,
    overlap,
    perturbed,
    select,
    spread_targets,
    surface_overlap,
    true_transformation,
)


def sheet(columns: int, rows: int = 20, spacing: float = 0.01, shift: float = 0.0) -> PointCloud:
    x, y = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1) * spacing
    return PointCloud(points + np.array([shift, 0.0, 1.0]))


def random_pose(seed: int) -> np.ndarray:
    return se3.exp(np.random.default_rng(seed).normal(size=6))


def test_a_cloud_overlaps_itself_wholly():
    assert overlap(sheet(30), sheet(30), np.eye(4)) == 1.0


def test_a_point_counts_while_the_target_is_nearer_than_six_times_its_own_neighbour():
    # Columns 1 cm apart, the target's last is 9: column 15 lies 0.9 mm beyond 6 cm, or within.
    assert overlap(sheet(30, shift=0.0009), sheet(10), np.eye(4)) == pytest.approx(15 / 30)
    assert overlap(sheet(30, shift=-0.0009), sheet(10), np.eye(4)) == pytest.approx(16 / 30)


def test_overlap_is_judged_under_the_true_pose():
    truth = random_pose(3)
    target = PointCloud(se3.transform(truth, sheet(10).points))
    assert overlap(sheet(30, shift=0.001), target, truth) == pytest.approx(0.5)
    assert overlap(sheet(30), target, np.eye(4)) == 0.0


@pytest.mark.parametrize("beams", [8, 16])
def test_the_next_ring_of_a_scanner_is_on_the_same_surface(beams):
    """Seven tenths of a metre on, along a bare corridor: nearly all of it is seen again."""
    source, target = (spinning.scan(spinning.corridor, k, beams, 0.005)[0] for k in (1, 2))
    ahead = se3.rigid(np.eye(3), [0.7, 0.0, 0.0])
    assert surface_overlap(prepare(source), prepare(target), ahead) > 0.95
    assert overlap(source, target, ahead) < 0.9


def test_surface_counts_by_its_area():
    """A quarter of it is sampled sixteen times as densely, and nobody else saw that."""
    coarse, fine = sheet(30, 40, 0.02).points, sheet(40, 160, 0.005).points
    aside = np.concatenate([coarse, fine - [0.6, 0.0, 0.0]])
    share = surface_overlap(prepare(aside), prepare(coarse), np.eye(4))
    assert share == pytest.approx(0.75, abs=0.05)


def test_overlap_depends_on_the_spacing_of_the_source_not_on_the_unit():
    source, target = sheet(30, spacing=1.0, shift=0.1), sheet(10, spacing=1.0)
    assert overlap(source, target, np.eye(4)) == pytest.approx(0.5)


def test_the_true_transformation_takes_the_source_into_the_frame_of_the_target():
    source, target = random_pose(1), random_pose(2)
    point = np.array([0.3, -0.2, 1.5])
    in_world = se3.transform(source, point)
    moved = se3.transform(true_transformation(source, target), point)
    assert se3.transform(target, moved) == pytest.approx(in_world)


@given(
    seed=st.integers(0, 10_000),
    angle=st.floats(0.0, 1.0),
    shift=st.floats(0.0, 2.0),
    axis=st.integers(0, 3),
)
def test_a_start_is_turned_by_its_angle_and_the_centroid_moves_by_its_translation(
    seed: int, angle: float, shift: float, axis: int
):
    truth, centroid = random_pose(seed), np.array([0.5, -1.0, 2.0])
    init = perturbed(truth, centroid, Axes.random(4, seed), axis, Start(angle, shift))
    assert se3.rotation_angle(init @ se3.inverse(truth)) == pytest.approx(angle, abs=1e-9)
    moved = se3.transform(init, centroid) - se3.transform(truth, centroid)
    assert np.linalg.norm(moved) == pytest.approx(shift, abs=1e-9)


def test_axes_are_unit_vectors_all_over_the_sphere():
    axes = Axes.random(2000, 0)
    for directions in (axes.rotation, axes.shift):
        assert np.linalg.norm(directions, axis=1) == pytest.approx(1.0)
        assert np.abs(directions.mean(axis=0)).max() < 0.05
        assert np.abs(np.cov(directions.T) - np.eye(3) / 3).max() < 0.03


def test_fewer_axes_are_the_first_of_more_and_another_seed_has_others():
    few, many, other = Axes.random(4, 0), Axes.random(16, 0), Axes.random(16, 1)
    assert np.array_equal(few.rotation, many.rotation[:4])
    assert np.array_equal(few.shift, many.shift[:4])
    assert not np.allclose(many.rotation, other.rotation)
    assert not np.allclose(many.rotation, many.shift)


OVERLAPS = {k: k / 200 for k in range(201)}


def test_a_selection_has_so_many_frames_of_each_decile_and_none_without_overlap():
    selection = select(7, OVERLAPS, 5, seed=0)
    tenths = [decile(pair.overlap) for pair in selection.pairs]
    assert [tenths.count(tenth) for tenth in range(10)] == [5] * 10
    assert selection.empty_deciles == ()
    assert all(pair.overlap > 0 and pair.source != 7 for pair in selection.pairs)
    assert all(pair.overlap == OVERLAPS[pair.source] for pair in selection.pairs)


def test_a_selection_depends_on_the_seed_and_on_nothing_else():
    again = select(7, dict(reversed(OVERLAPS.items())), 5, seed=0)
    assert again == select(7, OVERLAPS, 5, seed=0)
    assert again != select(7, OVERLAPS, 5, seed=1)


def test_a_decile_without_frames_is_said():
    present = {k: share for k, share in OVERLAPS.items() if not 0.2 <= share < 0.4}
    assert select(7, present, 5, seed=0).empty_deciles == (2, 3)


def test_pairs_below_the_minimum_are_left_out():
    pairs = select(7, OVERLAPS, 200, seed=0, minimum_overlap=0.03).pairs
    assert min(pair.overlap for pair in pairs) == 0.03


def test_targets_are_spread_evenly_where_nobody_chose():
    assert spread_targets(range(0, 500, 10)) == (120, 370)
    assert spread_targets([5, 9]) == (5, 9)
    assert spread_targets([5]) == (5,)


@pytest.mark.parametrize(
    ("text", "angle"),
    [
        ("pi/30", math.pi / 30),
        ("2pi/15", 2 * math.pi / 15),
        ("2*pi/15", 2 * math.pi / 15),
        (" π/6 ", math.pi / 6),
        ("pi", math.pi),
        ("0.1", 0.1),
        ("0", 0.0),
        ("5deg", math.radians(5)),
    ],
)
def test_angles_are_read_as_people_write_them(text: str, angle: float):
    assert parse_angle(text) == pytest.approx(angle)


def test_a_start_may_have_a_translation_of_its_own():
    assert parse_start("pi/6+0.3") == Start(math.pi / 6, 0.3)
    assert parse_start("pi/6", 0.2) == Start(math.pi / 6, 0.2)


@pytest.mark.parametrize("text", ["pi/0", "p/30", "", "-0.1", "nan", "pi/6+", "pi/6+x", "1/2"])
def test_what_is_no_angle_is_refused_with_what_would_be(text: str):
    with pytest.raises(InputError, match="expected"):
        parse_start(text)


def test_a_start_further_than_nowhere_is_refused():
    with pytest.raises(InputError, match="angle"):
        Start(-0.1)
    with pytest.raises(InputError, match="translation"):
        Start(0.1, math.inf)


PLAN = Plan(
    (Pair(0, 1, 0.5), Pair(0, 2, 0.25), Pair(9, 2, 1.0)),
    (Start(0.1), Start(0.2, 0.3)),
    4,
    ("a", "b", "c"),
)


def test_every_run_has_a_number_and_every_number_a_run():
    seen = set()
    for number in range(len(PLAN)):
        run = PLAN.run(number)
        assert run.number == number
        assert PLAN.number(run.pair.name, run.start, run.axis, run.method) == number
        seen.add((run.pair, run.start, run.axis, run.method))
    assert len(seen) == len(PLAN) == 3 * 2 * 4 * 3


def test_batches_hold_what_is_left_of_one_pair_and_not_much():
    done = bytearray(len(PLAN))
    done[5] = done[40] = 1
    batches = list(PLAN.batches(done))
    numbers = [run.number for batch in batches for run in batch]
    assert numbers == [n for n in range(len(PLAN)) if n not in (5, 40)]
    assert all(len({run.pair for run in batch}) == 1 for batch in batches)
    assert all(1 <= len(batch) <= RUNS_PER_TASK for batch in batches)
