"""The metrics: right derivatives, exact on exact surfaces, honest about what they know."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

import hmrf_icp
import shapes
import synthetic
from hmrf_icp import Criteria, InputError, PointCloud, presets, se3
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.clouds.surface import Surface
from hmrf_icp.kernels.normal_equations import COST, GRADIENT
from hmrf_icp.loop.match import Matches, NearestNeighbour
from hmrf_icp.loop.placed import Placed
from hmrf_icp.loop.reject import Labels
from hmrf_icp.loop.surface_metrics import (
    Frame,
    Pairing,
    PlaneToPlane,
    PointToPlane,
    Symmetric,
    extent,
    matrix,
)
from shapes import both

register = partial(hmrf_icp.register, preset="paper")
"""These are statements about the paper's method and its parts."""

METRICS = [PointToPlane, Symmetric, PlaneToPlane]
NAMES = ("point-to-plane", "symmetric", "plane-to-plane")
TIGHT = Criteria(1e-9, 1e-9, 40)


def bumpy(rng, count=300, noise=0.002):
    """Points on the hilly surface with their exact normals, which have a sign."""
    x, y = rng.uniform(-0.8, 0.8, (2, count))
    step = 1e-6
    points = synthetic.surface(x, y)
    normals = np.cross(
        synthetic.surface(x + step, y) - synthetic.surface(x - step, y),
        synthetic.surface(x, y + step) - synthetic.surface(x, y - step),
    )
    normals *= -1.0 / np.linalg.norm(normals, axis=1, keepdims=True)
    return surface(points, normals, noise)


def surface(points, normals, noise=0.002, oriented=True):
    count = len(points)
    return Surface(
        points=points,
        normals=normals,
        noise=np.full(count, noise),
        area=np.full(count, 0.01),
        oriented=oriented,
        support=np.full(count, 25.0),
        residual=np.full(count, noise),
        width=np.full(count, 0.1),
        patch=np.full(count, 0.01),
    )


def moved_surface(motion, s):
    return surface(
        se3.transform(motion, s.points), s.normals @ motion[:3, :3].T, s.noise[0], s.oriented
    )


def here(s):
    """The points of a surface, moved nowhere."""
    return Placed(s.points, np.eye(4))


def matches_of(count):
    return Matches(np.arange(count), np.zeros(count))


def some_motion(rng, size):
    return se3.exp(rng.normal(0, size, 6))


def numerical_rows(residual, count):
    """(R, 6) derivative of a residual (R,) by the twist, at zero."""
    step = 1e-6
    columns = [
        (residual(step * e).ravel() - residual(-step * e).ravel()) / (2 * step) for e in np.eye(6)
    ]
    return np.stack(columns, axis=1).reshape(count, 6)


@pytest.fixture
def crossed():
    """Matches off by a good deal, seen from some pose, and where they are measured from."""
    rng = np.random.default_rng(3)
    source, target = bumpy(rng, 40), bumpy(rng, 40)
    source = moved_surface(some_motion(rng, 0.2), source)
    chance = rng.uniform(0, 1, 40)
    m = Pairing(source, target).matched(here(source), rng.permutation(40), chance)
    return m, some_motion(rng, 0.1), np.array([0.3, -0.2, 1.0])


def placed(m, pose, centre):
    """The source's points and normals under ``pose``, all points measured from ``centre``."""
    x = se3.transform(pose, m.points - centre)
    return x, m.normals @ pose[:3, :3].T, m.onto[m.row] - centre, m.onto_normals[m.row]


def check(sums, rows, residual, weight):
    """``weight`` is (R,) or, for residuals in blocks of three, (R / 3, 3, 3)."""
    full = np.zeros((residual.size, residual.size))
    for i, block in enumerate(weight):
        size = np.atleast_2d(block).shape[0]
        full[i * size : (i + 1) * size, i * size : (i + 1) * size] = block
    hessian, gradient = rows.T @ full @ rows, rows.T @ full @ residual
    np.testing.assert_allclose(matrix(sums), hessian, rtol=1e-6, atol=1e-6 * hessian.max())
    np.testing.assert_allclose(sums[GRADIENT:COST], gradient, atol=1e-6 * np.abs(gradient).max())
    assert sums[COST] == pytest.approx(residual @ full @ residual)


def test_point_to_plane_has_the_derivatives_of_its_residual(crossed):
    m, pose, centre = crossed
    x, _, y, n = placed(m, pose, centre)

    def residual(twist):
        return ((se3.transform(se3.exp(twist), x) - y) * n).sum(axis=1)

    sums = PointToPlane().sums(m, pose, centre)
    check(sums, numerical_rows(residual, 40), residual(np.zeros(6)), m.weight)


def test_symmetric_has_the_derivatives_of_its_residual(crossed):
    m, pose, centre = crossed
    x, source_normal, y, n = placed(m, pose, centre)
    mean = 0.5 * (n + source_normal)

    def residual(twist):
        forth, back = se3.exp(0.5 * twist), se3.exp(-0.5 * twist)
        return ((se3.transform(forth, x) - se3.transform(back, y)) * mean).sum(axis=1)

    sums = Symmetric().sums(m, pose, centre)
    agree = m.weight > 0
    signed = np.einsum("ij,ij->i", source_normal, n)[agree] > 0
    assert signed.all(), "the fixture turns normals against each other"
    check(sums, numerical_rows(residual, 40), residual(np.zeros(6)), m.weight)


def test_plane_to_plane_has_the_derivatives_of_its_residual(crossed):
    m, pose, centre = crossed
    x, source_normal, y, n = placed(m, pose, centre)
    wide = 1e3

    def covariance(normal, variance):
        outer = normal[:, :, None] * normal[:, None, :]
        return variance[:, None, None] * (wide * np.eye(3) - (wide - 1) * outer)

    total = covariance(source_normal, m.variance) + covariance(n, m.onto_variance)
    weight = m.chance[:, None, None] * np.linalg.inv(total)

    def residual(twist):
        return (se3.transform(se3.exp(twist), x) - y).ravel()

    sums = PlaneToPlane().sums(m, pose, centre)
    check(sums, numerical_rows(residual, 120), residual(np.zeros(6)), weight)


@pytest.mark.parametrize("metric", METRICS)
@pytest.mark.parametrize("seed", range(5))
def test_known_matches_give_the_motion_at_once(metric, seed):
    rng = np.random.default_rng(seed)
    target = bumpy(rng)
    truth = some_motion(rng, 0.15)
    source = moved_surface(se3.inverse(truth), target)
    align = metric().between(source, target)
    step = align(here(source), matches_of(300), Labels(np.ones(300)))
    np.testing.assert_allclose(step.motion, truth, atol=1e-9)
    assert step.degenerate.shape == (0, 6)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", range(3))
def test_a_small_motion_of_an_exact_surface_is_found_exactly(name, seed):
    rng = np.random.default_rng(seed)
    target = synthetic.patch(40, 50, -0.9, 0.9, rng, noise=0.0)
    truth = some_motion(rng, 0.02)
    source = se3.transform(se3.inverse(truth), target)
    result = register(source, target, rejector="all", aligner=name, criteria=TIGHT)
    assert result.converged
    assert result.degenerate == ()
    np.testing.assert_allclose(result.transformation, truth, atol=1e-8)


@pytest.mark.parametrize("name", NAMES)
def test_where_the_frame_is_does_not_matter(name):
    rng = np.random.default_rng(5)
    clouds = synthetic.pair(2, height=30, width=36, holes=0.0)

    def registered(frame):
        here = [PointCloud(se3.transform(frame, c), viewpoint=frame[:3, 3]) for c in clouds]
        return register(*here, rejector="x84", aligner=name)

    frame = some_motion(rng, 1.0)
    plain, result = registered(np.eye(4)), registered(frame)
    expected = frame @ plain.transformation @ se3.inverse(frame)
    np.testing.assert_allclose(result.transformation, expected, atol=1e-7)
    # The information of a twist goes with the frame: a twist there is a twist here, moved.
    twist = rng.normal(size=6)
    there = np.concatenate([frame[:3, :3] @ twist[:3], frame[:3, :3] @ twist[3:]])
    np.testing.assert_allclose(
        there @ result.information @ there, twist @ plain.information @ twist, rtol=1e-4
    )
    np.testing.assert_allclose(result.centre, se3.transform(frame, plain.centre), atol=1e-7)


@pytest.mark.parametrize("name", NAMES)
def test_a_scene_ten_times_as_large_is_registered_alike(name):
    source, target = synthetic.pair(2, height=30, width=36, holes=0.0)
    criteria = Criteria(1e-6, 1e-6, 15)
    small = register(source, target, rejector="x84", aligner=name, criteria=criteria)
    large = register(
        10 * source,
        10 * target,
        rejector="x84",
        aligner=name,
        criteria=Criteria(1e-5, 1e-6, 15),
    )
    assert large.iterations == small.iterations
    expected = small.transformation.copy()
    expected[:3, 3] *= 10
    np.testing.assert_allclose(large.transformation, expected, atol=1e-6)
    units = np.array([1.0] * 3 + [10.0] * 3)
    np.testing.assert_allclose(
        large.information * np.outer(units, units),
        small.information,
        rtol=1e-4,
        atol=1e-6 * np.abs(small.information).max(),
    )


@pytest.mark.parametrize("metric", METRICS)
@pytest.mark.parametrize("weights", ["soft", "hard"])
def test_a_match_without_weight_is_as_good_as_absent(metric, weights):
    rng = np.random.default_rng(8)
    target = bumpy(rng)
    source = moved_surface(some_motion(rng, 0.05), target)
    wrong = np.arange(300) >= 200
    row = np.where(wrong, rng.integers(0, 200, 300), np.arange(300))
    labels = Labels(np.where(wrong, -1.0, 1.0))
    align = metric(weights=weights).between(source, target)
    some = align(here(source), Matches(row, np.zeros(300)), labels)
    first = surface(source.points[:200], source.normals[:200])
    alone = metric(weights=weights).between(first, target)
    none = alone(here(first), Matches(row[:200], np.zeros(200)), Labels(np.ones(200)))
    np.testing.assert_allclose(some.motion, none.motion, atol=1e-10)
    np.testing.assert_allclose(some.information, none.information, rtol=1e-8, atol=1e-3)


def test_soft_weights_count_by_probability_and_hard_ones_by_sign():
    rng = np.random.default_rng(9)
    target = bumpy(rng)
    source = moved_surface(some_motion(rng, 0.05), target)
    row = np.where(np.arange(300) < 150, np.arange(300), rng.permutation(300))
    z = np.where(np.arange(300) < 150, 0.9, 0.1)

    def step(weights):
        align = PointToPlane(weights=weights).between(source, target)
        return align(here(source), Matches(row, np.zeros(300)), Labels(z)).motion

    assert not np.allclose(step("soft"), step("hard"), atol=1e-4)
    everything = PointToPlane().between(source, target)(
        here(source), Matches(row, np.zeros(300)), Labels(np.ones(300))
    )
    np.testing.assert_allclose(step("hard"), everything.motion, atol=1e-10)
    with pytest.raises(InputError, match="soft"):
        PointToPlane(weights="maybe")
    with pytest.raises(InputError, match="flatness"):
        PlaneToPlane(flatness=0.0)


@pytest.mark.parametrize("metric", METRICS)
def test_normals_without_a_sign_may_point_either_way(metric):
    rng = np.random.default_rng(10)
    target = bumpy(rng)
    normals = target.normals * rng.choice([-1.0, 1.0], (300, 1))
    motion = some_motion(rng, 0.05)
    alike, shuffled = (
        moved_surface(motion, surface(target.points, facing, oriented=False))
        for facing in (target.normals, normals)
    )
    align = [metric().between(source, target) for source in (alike, shuffled)]
    one, other = (
        to(here(source), matches_of(300), Labels(np.ones(300)))
        for to, source in zip(align, (alike, shuffled), strict=True)
    )
    np.testing.assert_allclose(other.motion, one.motion, atol=1e-10)
    np.testing.assert_allclose(other.information, one.information, rtol=1e-8, atol=1e-3)
    assert other.weakest == pytest.approx(one.weakest)


def test_wrong_matches_are_no_noise_that_frees_a_motion():
    rng = np.random.default_rng(0)
    target = bumpy(rng)
    unit = np.ones(6)

    def weakest(wrong):
        row = np.arange(300)
        row[:wrong] = rng.integers(0, 300, wrong)
        m = Pairing(target, target).matched(here(target), row, np.ones(300))
        return PointToPlane().told(m, Frame(*extent(m.points, m.weight), unit)).weakest

    assert weakest(150) > 0.5 * weakest(0)


def test_near_points_count_for_more_than_far_ones():
    rng = np.random.default_rng(0)
    cloud = shapes.seen(shapes.corridor, rng, noise=2e-3)
    s = PreparedCloud(cloud).surface
    m = Pairing(s, s).matched(here(s), np.arange(len(s.points)), np.ones(len(s.points)))
    depth = s.points[:, 2]
    near, far = m.weight[depth < 2.2].mean(), m.weight[depth > 3.8].mean()
    # Noise goes with the square of the depth, the weight with its fourth power: (3.8 / 2.2)^4 = 9.
    assert near > 4 * far


def test_a_point_without_a_normal_or_seen_from_behind_is_left_out():
    rng = np.random.default_rng(1)
    target = bumpy(rng, 20)
    normals = target.normals.copy()
    normals[:3] = 0.0
    normals[3:5] *= -1.0
    source = surface(target.points, normals)
    m = Pairing(source, target).matched(here(source), np.arange(20), np.ones(20))
    np.testing.assert_array_equal(m.weight > 0, np.arange(20) >= 5)
    # Without a viewpoint the sign says nothing.
    unknown = surface(target.points, normals, oriented=False)
    m = Pairing(unknown, target).matched(here(source), np.arange(20), np.ones(20))
    np.testing.assert_array_equal(m.weight > 0, np.arange(20) >= 3)


def test_a_target_point_matched_often_is_one_measurement():
    rng = np.random.default_rng(2)
    target = bumpy(rng, 10)
    source = surface(target.points[np.zeros(8, int)], target.normals[np.zeros(8, int)], noise=1e-6)
    m = Pairing(source, target).matched(here(source), np.zeros(8, int), np.ones(8))
    assert m.weight.sum() == pytest.approx(1 / target.noise[0] ** 2, rel=1e-3)


@pytest.mark.parametrize("metric", METRICS)
def test_too_few_matches_determine_nothing(metric):
    rng = np.random.default_rng(4)
    target = bumpy(rng, 30)
    z = np.where(np.arange(30) < 5, 1.0, -1.0)
    align = metric().between(target, target)
    assert align(here(target), matches_of(30), Labels(z)) is None


@pytest.mark.parametrize("name", NAMES)
def test_the_information_is_the_inverse_covariance_of_the_pose(name):
    # Thirty noisy pairs of views of a corner: squared errors, in units of what was promised.
    truth, errors, deviations = np.eye(4), [], []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        source, target = (shapes.seen(shapes.corner, rng, noise=1.5e-3) for _ in range(2))
        start = some_motion(rng, 0.01)
        result = register(
            source, target, start, rejector="all", aligner=name, criteria=Criteria(1e-4, 1e-4, 10)
        )
        assert result.degenerate == ()
        off = truth @ se3.inverse(result.transformation)
        there = se3.rigid(np.eye(3), result.centre)
        twist = se3.log(se3.inverse(there) @ off @ there)
        errors.append(twist @ result.information @ twist / 6)
        deviations.append(np.sqrt(np.diag(np.linalg.inv(result.information))))
    assert 1 / 1.5 < np.mean(errors) < 1.5
    # Half a millimetre or so from 4,800 points of 2 to 4 mm: neither boasting nor useless.
    assert np.mean(deviations, axis=0)[3:].max() < 2e-3


def test_more_noise_than_the_clouds_tell_of_is_noticed():
    rng = np.random.default_rng(6)
    target = bumpy(rng, noise=1e-4)
    bent = surface(
        target.points + 0.003 * target.normals * np.sin(9 * target.points[:, :1]),
        target.normals,
        noise=1e-4,
    )
    quiet = PointToPlane().between(target, target)
    loud = PointToPlane().between(bent, target)
    labels = Labels(np.ones(300))
    promised = quiet(here(target), matches_of(300), labels).information
    admitted = loud(here(bent), matches_of(300), labels).information
    assert np.trace(admitted) < 0.05 * np.trace(promised)


def test_metrics_have_names():
    assert presets.aligner_names()[0] == "point-to-point"
    assert set(NAMES) < set(presets.aligner_names())
    source, target = synthetic.pair(1)
    with pytest.raises(InputError, match=r"aligner: unknown 'chamfer'.*symmetric"):
        register(source, target, aligner="chamfer")
    by_name = register(source, target, rejector="x84", aligner="symmetric")
    by_hand = register(source, target, rejector="x84", aligner=Symmetric())
    np.testing.assert_array_equal(by_name.transformation, by_hand.transformation)
    assert by_name.information.shape == (6, 6)


def test_the_paper_is_point_to_point_and_says_nothing_of_its_information():
    source, target = synthetic.pair(1)
    own = register(source, target, preset="paper")
    named = register(source, target, preset="paper", aligner="point-to-point")
    np.testing.assert_array_equal(own.transformation, named.transformation)
    assert own.information is None
    assert own.degenerate == ()


def test_points_are_centred_by_weight():
    points = np.array([[0.0, 0, 0], [2.0, 0, 0], [100.0, 0, 0]])
    centre, length = extent(points, np.array([1.0, 1.0, 0.0]))
    np.testing.assert_allclose(centre, [1, 0, 0])
    assert length == pytest.approx(1.0)


def test_a_cloud_may_turn_any_way():
    rng = np.random.default_rng(7)
    target = bumpy(rng)
    for _ in range(5):
        motion = some_motion(rng, 2.0)
        source = moved_surface(se3.inverse(motion), target)
        m = Pairing(source, target).matched(
            Placed.at(motion, source.points), np.arange(300), np.ones(300)
        )
        np.testing.assert_allclose(m.normals, target.normals, atol=1e-9)


def test_unorganised_clouds_have_surfaces_too():
    rng = np.random.default_rng(11)
    points = synthetic.patch(40, 50, -0.9, 0.9, rng, noise=0.0).reshape(-1, 3)
    truth = some_motion(rng, 0.02)
    source = PointCloud(se3.transform(se3.inverse(truth), rng.permutation(points)))
    target = PointCloud(points)
    assert NearestNeighbour().prepare(*both(source, target)) is not None
    result = register(source, target, rejector="all", aligner="plane-to-plane", criteria=TIGHT)
    np.testing.assert_allclose(result.transformation, truth, atol=1e-8)
