"""The renderer sees what geometry says it must, in the frames that it promises."""

import numpy as np
import pytest

from hmrf_icp import se3
from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.errors import InputError
from hmrf_icp.synthetic.primitives import Box, Frustum, Rectangle, Sphere, Torus
from hmrf_icp.synthetic.render import StructuredLight, render, render_lidar, sensor_noise
from hmrf_icp.synthetic.scenes import CAMERA, Scene, desk, look_at, trajectory

SMALL = CAMERA.subsampled(8)
ORIGIN = np.eye(4)


def scene(*primitives):
    return Scene("test", primitives)


def ahead(z):
    return se3.rigid(np.eye(3), (0.0, 0.0, z))


def wall(distance, size=20.0):
    return scene(Rectangle(ahead(distance), (size, size)))


def test_a_wall_square_to_the_camera_has_one_depth_everywhere():
    np.testing.assert_allclose(render(wall(1.7), SMALL, ORIGIN), 1.7, rtol=1e-13)


def test_a_slanted_plane_is_where_its_equation_says():
    pose = se3.rigid(se3.rotation_exp((0.5, -0.3, 0.2)), (0.1, 0.2, 2.0))
    depth = render(scene(Rectangle(pose, (50.0, 50.0))), SMALL, ORIGIN)
    points = SMALL.unproject(depth)
    np.testing.assert_allclose((points - pose[:3, 3]) @ pose[:3, 2], 0.0, atol=1e-12)


def test_a_spheres_silhouette_has_the_angle_of_its_tangent_cone():
    depth = render(scene(Sphere(ahead(2.0), 0.3)), CAMERA, ORIGIN)
    rays = CAMERA.unproject(np.ones((480, 640)))
    cosine = rays[..., 2] / np.linalg.norm(rays, axis=-1)
    tangent = np.cos(np.arcsin(0.3 / 2.0))
    np.testing.assert_array_equal(~np.isnan(depth), cosine >= tangent)
    points = CAMERA.unproject(depth)
    distance = np.linalg.norm(points - (0.0, 0.0, 2.0), axis=-1)
    np.testing.assert_allclose(distance[~np.isnan(depth)], 0.3, rtol=1e-12)
    assert np.nanmin(depth) == pytest.approx(1.7, abs=1e-5)


def on_box(p):
    return np.abs(np.abs(p) - (0.2, 0.15, 0.25)).min(axis=-1)


def on_frustum(p):
    radius = np.hypot(p[..., 0], p[..., 1])
    wall = np.abs(radius - (0.3 - 0.5 * p[..., 2]))
    return np.minimum.reduce([wall, np.abs(p[..., 2]), np.abs(p[..., 2] - 0.4)])


def on_torus(p):
    return np.abs(np.hypot(np.hypot(p[..., 0], p[..., 1]) - 0.3, p[..., 2]) - 0.08)


@pytest.mark.parametrize(
    ("make", "off_surface"),
    [
        (lambda pose: Box(pose, (0.4, 0.3, 0.5)), on_box),
        (lambda pose: Frustum(pose, 0.3, 0.1, 0.4), on_frustum),
        (lambda pose: Frustum(pose, 0.3, 0.1, 0.4, False, False), on_frustum),
        (lambda pose: Torus(pose, 0.3, 0.08), on_torus),
    ],
    ids=["box", "frustum", "open frustum", "torus"],
)
@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (0.7, -0.4, 0.3), (-2.0, 0.5, 1.0)])
def test_what_is_seen_of_a_shape_lies_on_its_surface_and_nothing_nearer_does(
    make, off_surface, turn
):
    pose = se3.rigid(se3.rotation_exp(turn), (0.1, -0.05, 1.2))
    depth = render(scene(make(pose)), SMALL, ORIGIN)
    seen = ~np.isnan(depth)
    assert 200 < seen.sum() < seen.size

    def local(depth):
        return se3.transform(se3.inverse(pose), SMALL.unproject(depth))

    assert off_surface(local(depth))[seen].max() < 1e-9
    nearer = depth - np.linspace(1e-4, 0.6, 200)[:, None, None]
    through = [inside(make(pose), local(d)[seen]).any() for d in nearer]
    assert not any(through), "a ray was inside of the shape before it was said to meet it"


def inside(shape, p):
    """Whether points are inside of a closed shape; an open one has no inside."""
    radius = np.hypot(p[..., 0], p[..., 1])
    if isinstance(shape, Box):
        return (np.abs(p) < np.array(shape.size) / 2).all(axis=-1)
    if isinstance(shape, Torus):
        return np.hypot(radius - shape.ring, p[..., 2]) < shape.tube
    if not shape.closed_top:
        return np.zeros(len(p), dtype=bool)
    within = (p[..., 2] > 0) & (p[..., 2] < shape.height)
    return within & (radius < shape.bottom + (shape.top - shape.bottom) * p[..., 2] / shape.height)


def test_an_open_mug_shows_its_inside_and_a_closed_one_its_lid():
    upright = se3.rigid(np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, 1.0))  # opens towards the camera
    centre = (SMALL.height // 2, SMALL.width // 2)
    open_mug = Frustum(upright, 0.2, 0.2, 0.3, closed_top=False)
    lid = Frustum(upright, 0.2, 0.2, 0.3)
    assert render(scene(open_mug), SMALL, ORIGIN)[centre] == pytest.approx(1.0)
    assert render(scene(lid), SMALL, ORIGIN)[centre] == pytest.approx(0.7)


def test_the_nearer_of_two_shapes_hides_the_other_whatever_their_order():
    near, far = Sphere(ahead(1.0), 0.1), Box(ahead(2.0), (2.0, 2.0, 0.2))
    depth = render(scene(near, far), SMALL, ORIGIN)
    np.testing.assert_array_equal(depth, render(scene(far, near), SMALL, ORIGIN))
    assert np.nanmin(depth) < 0.91
    assert np.nanmax(depth) == pytest.approx(1.9)


def test_what_is_behind_the_camera_is_not_seen():
    assert np.isnan(render(wall(-1.0), SMALL, ORIGIN)).all()
    assert np.isnan(render(scene(Sphere(ahead(-1.0), 0.3)), SMALL, ORIGIN)).all()


def test_the_bounds_of_a_shape_never_cut_into_it():
    pose = trajectory("desk", 3)[1]
    whole = render(desk(), SMALL, pose)
    rays = SMALL.unproject(np.ones(whole.shape)).reshape(-1, 3) @ pose[:3, :3].T
    every_ray = np.min([p.intersect(pose[:3, 3], rays) for p in desk().primitives], axis=0)
    np.testing.assert_allclose(whole.ravel(), every_ray, rtol=1e-12)


def test_x_is_to_the_right_y_is_down_and_the_pose_takes_the_camera_to_the_world():
    ball = scene(Sphere(se3.rigid(np.eye(3), (0.5, 3.0, 1.8)), 0.2))  # right of and above the axis
    pose = look_at((0.0, 0.0, 1.5), (0.0, 1.0, 1.5))
    rows, columns = np.nonzero(~np.isnan(render(ball, SMALL, pose)))
    assert columns.min() > SMALL.cx
    assert rows.max() < SMALL.cy
    np.testing.assert_allclose(pose[:3, 2], (0.0, 1.0, 0.0), atol=1e-15)
    np.testing.assert_allclose(pose[:3, 1], (0.0, 0.0, -1.0), atol=1e-15)


def test_two_views_of_a_scene_meet_in_the_world():
    poses = trajectory("tabletop", 12)
    ball = scene(Sphere(se3.rigid(np.eye(3), (0.0, 0.0, 0.8)), 0.15))
    for pose in (poses[2], poses[6]):
        points = PointCloud.from_depth(render(ball, SMALL, pose), SMALL).observed_points
        world = se3.transform(pose, points)
        np.testing.assert_allclose(np.linalg.norm(world - (0, 0, 0.8), axis=1), 0.15, rtol=1e-12)


def test_a_pose_that_is_not_rigid_is_refused():
    with pytest.raises(InputError, match="pose"):
        render(wall(1.0), SMALL, 2 * np.eye(4))


def test_a_lidar_sees_its_room_all_around_in_its_own_frame():
    room = scene(Box(se3.rigid(np.eye(3), (1.0, 2.0, 0.5)), (6.0, 4.0, 3.0)))
    pose = se3.rigid(se3.rotation_exp((0.0, 0.0, 0.6)), (0.5, 1.5, 0.7))
    cloud = render_lidar(room, pose, elevations=np.radians([10.0, 0.0, -10.0]), azimuths=90)
    assert cloud.shape == (3, 90)
    np.testing.assert_array_equal(cloud.viewpoint, np.zeros(3))
    world = se3.transform(pose, cloud.points) - (1.0, 2.0, 0.5)
    np.testing.assert_allclose(np.abs(np.abs(world) - (3.0, 2.0, 1.5)).min(axis=-1), 0, atol=1e-12)
    assert (cloud.points[0, :, 2] > 0).all()
    assert (cloud.points[2, :, 2] < 0).all()
    assert cloud.points[1, 22, 1] > 0, "the left comes before the right"
    assert cloud.points[1, 45, 0] > 0, "the front is in the middle"


def test_a_lidars_bounds_never_cut_into_a_shape():
    pose = se3.rigid(np.eye(3), (0.6, -0.6, 1.0))
    cloud = render_lidar(desk(), pose, np.radians(np.linspace(20, -40, 16)), 128)
    distance = np.linalg.norm(cloud.points, axis=-1)
    rays = (cloud.points / distance[..., None])[cloud.observed]
    every_ray = np.min([p.intersect(pose[:3, 3], rays) for p in desk().primitives], axis=0)
    np.testing.assert_allclose(distance[cloud.observed], every_ray, rtol=1e-9)


def test_a_lidar_loses_what_is_out_of_range():
    cloud = render_lidar(scene(Sphere(ahead(0.0), 10.0)), ORIGIN, max_range=5.0)
    assert len(cloud) == 0


# --- the sensor's noise


def noisy(depth, camera=CAMERA, seed=0, **changes):
    return sensor_noise(depth, camera, np.random.default_rng(seed), StructuredLight(**changes))


def test_depths_are_multiples_of_a_step_in_disparity():
    measured = noisy(render(wall(2.0), CAMERA, ORIGIN))
    assert measured.dtype == np.uint16
    levels = np.unique(measured[measured > 0])
    disparity = 585.0 * 0.075 / (levels / 1000.0)
    np.testing.assert_allclose(disparity * 8, np.rint(disparity * 8), atol=0.05)
    assert len(levels) >= 2
    assert np.abs(levels.astype(int) - 2000).max() < 25


def test_depth_noise_grows_with_the_square_of_depth():
    def spread(depth):
        measured = noisy(render(wall(depth), CAMERA, ORIGIN), disparity_step=1e-4)
        return measured[measured > 0].std() / 1000.0

    expected = (1 / 48) / (585.0 * 0.075)  # times depth squared, metres
    assert spread(2.0) == pytest.approx(4.0 * expected, rel=0.02)
    assert spread(4.0) == pytest.approx(16.0 * expected, rel=0.02)


def test_one_pixel_in_a_hundred_drops_out():
    lost = noisy(render(wall(1.5), CAMERA, ORIGIN)) == 0
    assert lost.mean() == pytest.approx(0.01, abs=0.001)


def test_lateral_jitter_keeps_on_a_slanted_plane_and_moves_edges():
    slanted = scene(Rectangle(se3.rigid(se3.rotation_exp((0.0, 0.9, 0.0)), (0, 0, 2.0)), (9, 9)))
    depth = render(slanted, CAMERA, ORIGIN)
    calm = {"disparity_step": 1e-5, "disparity_sigma": 0.0, "dropout": 0.0, "min_range": 0.1}
    measured = noisy(depth, lateral_sigma=0.5, max_range=60.0, **calm) / 1000.0
    per_pixel = np.abs(np.gradient(1 / depth, axis=1))
    moved = (1 / np.where(measured > 0, measured, np.nan) - 1 / depth) / per_pixel
    inner = np.abs(moved[5:-5, 5:-5][depth[5:-5, 5:-5] < 2.0])
    assert np.sqrt(np.nanmean(inner**2)) == pytest.approx(0.5, rel=0.05)

    half = scene(Rectangle(ahead(1.0), (0.5, 5.0)), Rectangle(ahead(1.2), (9.0, 9.0)))
    edges = noisy(
        render(half, CAMERA, ORIGIN),
        lateral_sigma=0.5,
        baseline=1e-4,
        **{**calm, "disparity_step": 1e-9},
    )
    right = 319.5 + 0.25 * 585.0
    columns = np.arange(int(right) - 2, int(right) + 4)
    near_share = (edges[:, columns] == 1000).mean(axis=0)
    assert near_share[0] > 0.99
    assert near_share[-1] < 0.01
    assert ((near_share > 0.02) & (near_share < 0.98)).any()
    assert set(np.unique(edges[edges > 0])) == {1000, 1200}, "no points float between surfaces"


def test_grazing_rays_are_lost():
    def share_lost(degrees):
        turn = se3.rotation_exp((np.radians(90.0 - degrees), 0.0, 0.0))
        plane = scene(Rectangle(se3.rigid(turn, (0.0, 0.0, 1.5)), (9.0, 9.0)))
        narrow = PinholeCamera(64, 48, 5850.0, 5850.0, 31.5, 23.5)
        depth = render(plane, narrow, ORIGIN)
        return (noisy(depth, narrow, dropout=0.0) == 0).mean()

    assert share_lost(8.0) == 1.0
    assert share_lost(12.0) == 0.0


def test_the_projectors_shadow_falls_to_the_left_of_an_object():
    scene_ = scene(Rectangle(ahead(1.0), (0.2, 5.0)), Rectangle(ahead(1.5), (9.0, 9.0)))
    lost = noisy(render(scene_, CAMERA, ORIGIN), dropout=0.0) == 0
    width = 585.0 * 0.075 * (1 / 1.0 - 1 / 1.5)
    left_edge, right_edge = 319.5 - 58.5, 319.5 + 58.5
    assert lost[:, int(left_edge - width) + 2 : int(left_edge) - 1].all()
    assert not lost[:, : int(left_edge - width) - 2].any()
    assert not lost[:, int(right_edge) + 3 :].any()


@pytest.mark.parametrize("distance", [0.3, 5.0])
def test_what_is_out_of_range_is_lost(distance):
    assert (noisy(render(wall(distance), SMALL, ORIGIN), SMALL) == 0).all()


def test_nothing_hit_is_nothing_observed():
    assert (noisy(np.full((60, 80), np.nan), SMALL) == 0).all()


def test_the_same_seed_gives_the_same_map_and_another_another():
    depth = render(desk(), SMALL, trajectory("desk", 1)[0])
    np.testing.assert_array_equal(noisy(depth, SMALL, 3), noisy(depth, SMALL, 3))
    assert (noisy(depth, SMALL, 3) != noisy(depth, SMALL, 4)).any()


def test_a_map_of_another_size_is_refused():
    with pytest.raises(InputError, match="80 x 60"):
        noisy(np.ones((3, 3)), SMALL)
