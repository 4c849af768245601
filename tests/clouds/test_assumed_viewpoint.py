"""A place to look from where nobody says where the sensor stood, and what it does not tell."""

from __future__ import annotations

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import PointCloud, prepare, se3
from hmrf_icp.clouds.assumed_viewpoint import assumed_viewpoint, in_camera_frame
from views import frame, off, truth


def fused(first, second, away=None):
    """Two views in the frame of the first, or moved on, as a list of points."""
    there = se3.transform(truth(second, first), frame(second).observed_points)
    points = np.concatenate([frame(first).observed_points, there])[::2]
    return points if away is None else se3.transform(away, points)


FAR = se3.exp([0.9, -1.7, 0.6, 4.0, -6.0, 2.5])


@pytest.mark.parametrize(("away", "place"), [(None, np.zeros(3)), (FAR, FAR[:3, 3])])
def test_hardly_more_is_hidden_from_the_place_assumed_than_from_where_a_sensor_stood(away, place):
    from hmrf_icp.kernels.hidden_points import hidden_shares

    cloud = prepare(fused(0, 4, away))
    assert cloud.seen_from.kind == "none"
    found, hidden = assumed_viewpoint(cloud.surface, np.full(3, 1e3))
    surface = cloud.surface
    stood = hidden_shares(
        surface.points, surface.normals, 3.0 * surface.spacing, place[None], np.array([0.03])
    )
    assert hidden < stood[0] + 0.03
    assert np.linalg.norm(found - surface.points.mean(axis=0)) < 3.0 * surface.size


def test_the_frame_of_the_first_view_is_where_it_stood():
    view = prepare(fused(0, 8)).viewed.seen_from
    assert view.kind == "assumed"
    assert view.at_origin
    assert not prepare(fused(0, 8, FAR)).viewed.seen_from.at_origin
    # A robot's frame, x ahead and z up, is no camera's, and its origin is where it stood.
    ahead = fused(0, 8)[:, [2, 0, 1]] * [1.0, -1.0, -1.0]
    assert not in_camera_frame(ahead)
    assert prepare(ahead).viewed.seen_from.at_origin


def test_the_origin_of_a_cameras_frame_is_where_the_first_view_was_whatever_later_ones_saw():
    # Eleven views all round: from many places less is hidden than from the first.
    views = [se3.transform(truth(k, 0), frame(k).observed_points) for k in range(0, 44, 4)]
    points = np.concatenate(views)[::6]
    assert in_camera_frame(points)
    assert prepare(points).viewed.seen_from.at_origin
    # OpenGL's cameras look against z; and a frame in which nothing stands before it is none.
    assert prepare(points * [1.0, -1.0, -1.0]).viewed.seen_from.at_origin
    assert not in_camera_frame(points[:, [2, 0, 1]])
    assert not in_camera_frame(points - points.mean(axis=0))


def test_an_assumed_place_gives_normals_no_sign_and_no_pose_its_free_space():
    source, target = prepare(fused(3, 13)), prepare(fused(0, 10))
    assert not source.viewed.surface.oriented
    assert source.viewed.range_image is None
    result = hmrf_icp.register(source, target, truth(3, 0))
    assert result.source_view.kind == result.target_view.kind == "assumed"
    assert not result.visibility.views
    assert off(result.transformation, truth(3, 0), PointCloud(fused(3, 13))) < 0.01
