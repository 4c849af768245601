"""A list of the points of a depth map is that depth map, in whatever order it comes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import hmrf_icp
from hmrf_icp import PointCloud, prepare, se3
from hmrf_icp.clouds.depth_image import comb, depth_image
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.loop.reject import Labels, Reject
from hmrf_icp.synthetic import render, scenes
from views import CAMERA, frame, off, truth, turned

AXIS = np.array([0.2, 1.0, -0.1])
Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def points() -> Array:
    """A desk as a camera of 80 x 60 pixels sees it, 1 mm of noise in the depth, as a list."""
    return frame(7).observed_points


def shuffled(points: Array, seed: int = 0) -> tuple[Array, NDArray[np.intp]]:
    order = np.random.default_rng(seed).permutation(len(points))
    return points[order], order


def camera_of(points: Array) -> hmrf_icp.PinholeCamera:
    camera = prepare(points).viewed.cloud.camera
    assert camera is not None
    return camera


@pytest.mark.parametrize("decimals", [None, 4, 6])
def test_the_camera_of_a_list_is_recovered(points: Array, decimals: int | None) -> None:
    stored = points.astype(np.float32) if decimals is None else points.round(decimals)
    camera = camera_of(stored.astype(np.float64))
    assert camera.fx == pytest.approx(CAMERA.fx, rel=1e-3)
    assert camera.fy == pytest.approx(CAMERA.fy, rel=1e-3)


def test_its_points_stand_in_the_pixels_that_saw_them() -> None:
    view = frame(7)
    image = depth_image(view.observed_points)
    assert image is not None
    np.testing.assert_array_equal(image.points, view.points)
    assert image.order is None


def test_a_part_of_the_image_and_every_second_row_have_cameras_of_their_own(points: Array) -> None:
    whole = frame(7).points
    part = whole[10:50, 20:70].reshape(-1, 3)
    assert camera_of(part).fx == pytest.approx(CAMERA.fx)
    assert camera_of(part).cx == pytest.approx(CAMERA.cx - 20)
    fewer = whole[::2, ::2].reshape(-1, 3)
    assert camera_of(fewer).fx == pytest.approx(CAMERA.fx / 2)


def test_half_of_the_points_are_an_image_with_holes(points: Array) -> None:
    half = shuffled(points)[0][: len(points) // 2]
    assert camera_of(half).fx == pytest.approx(CAMERA.fx)


@pytest.mark.parametrize("width", [100, 128, 160])
def test_an_image_without_a_hole_is_found_whatever_its_width(width: int) -> None:
    camera = hmrf_icp.PinholeCamera(width, 96, 140.0, 140.0, width / 2 - 0.5, 47.5)
    depth = render.render(scenes.desk(), camera, scenes.trajectory("desk", 60)[7])
    assert np.isfinite(depth).all()
    assert camera_of(camera.unproject(depth).reshape(-1, 3)).width == width


def test_the_frame_of_graphics_is_a_camera_too(points: Array) -> None:
    image = depth_image(points * [1.0, -1.0, -1.0])
    assert image is not None
    assert image.order is None
    view = prepare(points * [1.0, -1.0, -1.0]).viewed.seen_from
    assert view.kind == "recovered"
    assert "pinhole" in view.text


@pytest.mark.parametrize("seed", [1, 2])
def test_a_list_is_registered_as_its_depth_map_in_any_order(seed: int) -> None:
    source, target = frame(20), frame(26)
    start = turned(truth(20, 26), source, AXIS, 12.0)
    image = hmrf_icp.register(source, target, start)
    assert off(image.transformation, truth(20, 26), source) < 0.01
    mixed, order = shuffled(source.observed_points, seed)
    onto, onto_order = shuffled(target.observed_points, seed + 10)
    listed = hmrf_icp.register(mixed, onto, start)
    np.testing.assert_array_equal(listed.transformation, image.transformation)
    assert listed.confidence == image.confidence
    assert listed.overlap == pytest.approx(image.overlap, abs=1e-12)
    told = image.inlier_probability[source.observed]
    np.testing.assert_allclose(listed.inlier_probability, told[order], atol=1e-12)
    rows = np.flatnonzero(target.observed)[onto_order]
    np.testing.assert_array_equal(
        rows[listed.correspondence_set[:, 1]][np.argsort(order[listed.correspondence_set[:, 0]])],
        image.correspondence_set[:, 1],
    )


class OfTheTargetsLeft:
    """A rejector that keeps what matches the left half of the target."""

    def prepare(self, source: PreparedCloud, target: PreparedCloud) -> Reject:
        """Look at the target's points."""
        left = target.points[:, 0] < np.median(target.points[:, 0])
        return lambda matches, before: Labels(np.where(left[matches.index], 1.0, -1.0))


def test_a_rejector_follows_the_matches_of_a_list_to_the_points_they_are_of() -> None:
    source, target = frame(20), frame(21)
    image = hmrf_icp.register(source, target, truth(20, 21), rejector=OfTheTargetsLeft())
    onto, _ = shuffled(target.observed_points)
    mixed, order = shuffled(source.observed_points, 1)
    listed = hmrf_icp.register(mixed, onto, truth(20, 21), rejector=OfTheTargetsLeft())
    told = image.inlier_probability[source.observed]
    np.testing.assert_array_equal(listed.inlier_probability, told[order])
    left = onto[listed.correspondence_set[:, 1], 0]
    assert left.max() < np.median(onto[:, 0])


def test_what_is_known_of_each_point_goes_to_its_pixel(points: Array) -> None:
    mixed, order = shuffled(points)
    tagged = PointCloud(mixed, attributes={"red": order.astype(np.int32)})
    laid = prepare(tagged).viewed.cloud
    image = prepare(points).viewed.cloud
    np.testing.assert_array_equal(laid.attributes["red"][laid.observed], np.arange(len(points)))
    np.testing.assert_array_equal(laid.points, image.points)


def test_unobserved_rows_of_a_list_are_in_no_pixel(points: Array) -> None:
    spoilt = np.insert(points, [0, 5, 900], np.nan, axis=0)
    assert len(prepare(spoilt).viewed) == len(points)
    assert camera_of(spoilt).fx == pytest.approx(CAMERA.fx)


def merged() -> Array:
    return np.vstack(
        [frame(7).observed_points, se3.transform(truth(10, 7), frame(10).observed_points)]
    )


def beside(points: Array) -> Array:
    """Move one point by four tenths of a pixel."""
    points = points.copy()
    points[1000, 0] += 0.4 * points[1000, 2] / CAMERA.fx
    return points


NO_IMAGE = {
    "moved by a step": lambda p: p + np.array([0.1, 0.0, 0.0]),
    "turned by a degree": lambda p: p @ se3.rotation_exp([0.0, 0.0, np.radians(1.0)]).T,
    "merged with another view": lambda p: merged(),
    "the same view twice": lambda p: np.vstack([p, p * 1.001]),
    "one point in twenty": lambda p: shuffled(p)[0][: len(p) // 20],
    "noise beside the rays": lambda p: p + np.random.default_rng(0).normal(0, 0.01, p.shape),
    "one point beside its ray": lambda p: beside(p),
    "behind and in front": lambda p: np.vstack([p, -p[:50]]),
    "random": lambda p: np.random.default_rng(0).uniform(1.0, 2.0, (4000, 3)),
    "a lattice": lambda p: np.stack(np.mgrid[1:13, 1:13, 1:13], axis=-1).reshape(-1, 3) * 1.0,
    "a wall that faces the frame": lambda p: CAMERA.unproject(np.full((60, 80), 2.0)).reshape(
        -1, 3
    ),
    "a bent line": lambda p: np.linspace(1.0, 2.0, 500)[:, None] ** [1.0, 2.0, 3.0],
}


@pytest.mark.filterwarnings("error:.*:RuntimeWarning")
@pytest.mark.parametrize("kind", NO_IMAGE)
def test_what_is_no_depth_map_has_no_camera(points: Array, kind: str) -> None:
    cloud = prepare(np.asarray(NO_IMAGE[kind](points), dtype=np.float64))
    assert not cloud.viewed.cloud.organised


@settings(deadline=None, max_examples=60)
@given(
    first=st.floats(-50.0, 50.0),
    pitch=st.floats(1e-3, 0.05),
    seed=st.integers(0, 1000),
)
def test_a_comb_is_found_wherever_it_begins(first: float, pitch: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    teeth = rng.integers(0, 60, 800)
    found = comb((teeth + first + rng.uniform(-0.05, 0.05, 800)) * pitch)
    assert found is not None
    assert found.pixels_a_slope * pitch == pytest.approx(1.0, rel=2e-3)


@pytest.mark.parametrize("seed", range(20))
def test_a_comb_is_found_where_most_stand_on_a_few_of_its_teeth(seed: int) -> None:
    rng = np.random.default_rng(seed)
    near = rng.integers(100, 100 + rng.integers(4, 30), 3000)
    teeth = np.concatenate([near, rng.integers(0, 400, 200)])
    found = comb(teeth * 0.002 - 0.4)
    assert found is not None
    assert found.pixels_a_slope == pytest.approx(500.0, rel=1e-3)


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 1000), count=st.integers(60, 4000))
def test_slopes_at_random_are_no_comb(seed: int, count: int) -> None:
    assert comb(np.random.default_rng(seed).normal(size=count)) is None


def test_a_scene_of_every_kind_is_found_from_its_list() -> None:
    for name in scenes.SCENES:
        assert camera_of(frame(3, name).observed_points).fx == pytest.approx(CAMERA.fx)
