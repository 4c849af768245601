"""A view's points hide each other from nowhere but its place; what was fused has no such place."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from hmrf_icp import InputError, PinholeCamera, se3
from hmrf_icp.clouds.viewpoint import viewpoint_of
from hmrf_icp.synthetic import render, scenes

CAMERA = PinholeCamera(width=120, height=90, fx=110.0, fy=110.0, cx=59.5, cy=44.5)


@pytest.fixture(scope="module")
def views() -> list[NDArray[np.float64]]:
    """A desk from two sides, points in the world's frame, with the places they were seen from."""
    poses = scenes.trajectory("desk", 60)
    found = []
    for pose in (poses[0], poses[25]):
        points = CAMERA.unproject(render.render(scenes.desk(), CAMERA, pose)).reshape(-1, 3)
        points = points[np.isfinite(points).all(axis=1)]
        found.append(np.vstack([pose[:3, 3], se3.transform(pose, points)]))
    return found


def test_the_origin_of_a_view_s_own_frame_is_where_it_was_seen_from(
    views: list[NDArray[np.float64]],
) -> None:
    place, points = views[0][0], views[0][1:]
    found = viewpoint_of(points - place)
    assert found.source == "origin"
    assert found.weight > 0.8
    assert found.evidence is not None
    assert found.evidence.hidden < 0.02 < found.evidence.beside


def test_it_does_not_depend_on_the_unit(views: list[NDArray[np.float64]]) -> None:
    points = views[0][1:] - views[0][0]
    metres, millimetres = viewpoint_of(points), viewpoint_of(1000.0 * points)
    assert metres.weight == pytest.approx(millimetres.weight, abs=0.02)


def test_any_other_origin_is_not(views: list[NDArray[np.float64]]) -> None:
    place, points = views[0][0], views[0][1:]
    size = np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean())
    for off in np.vstack([np.eye(3), -np.eye(3)]) * 0.5 * size:
        found = viewpoint_of(points - place + off, anywhere=False)
        assert found.source == "none"
        assert found.known is None


def test_two_views_fused_were_seen_from_neither(views: list[NDArray[np.float64]]) -> None:
    fused = np.vstack([view[1:] for view in views])
    for view in views:
        assert viewpoint_of(fused - view[0], anywhere=False).source == "none"


def test_closed_and_random_clouds_were_seen_from_nowhere() -> None:
    rng = np.random.default_rng(0)
    ball = rng.normal(size=(4000, 3))
    sphere = ball / np.linalg.norm(ball, axis=1)[:, None]
    aside, away = np.array([0.3, 0.1, 0.0]), np.array([0.0, 0.0, 3.0])
    for points in (ball, sphere, sphere + aside, sphere + away):
        assert viewpoint_of(points, anywhere=False).source == "none"


def test_what_is_given_is_taken_and_what_is_no_place_is_refused() -> None:
    points = np.random.default_rng(0).normal(size=(300, 3))
    given = viewpoint_of(points, (1.0, 2.0, 3.0))
    assert given.source == "given"
    assert given.weight == 1.0
    np.testing.assert_array_equal(given.known, [1.0, 2.0, 3.0])
    assert viewpoint_of(points, None).known is None
    assert viewpoint_of(points[:20]).text == "viewpoint: none (too few points)"
    with pytest.raises(InputError, match="three"):
        viewpoint_of(points, (1.0, 2.0))
    with pytest.raises(InputError, match="auto"):
        viewpoint_of(points, "somewhere")  # type: ignore[arg-type]
