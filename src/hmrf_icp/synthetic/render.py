"""Depth maps and LiDAR scans of analytic scenes, with poses known to the last digit."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.depth import SATURATED
from hmrf_icp.errors import InputError
from hmrf_icp.se3 import Array, as_rigid, inverse, transform
from hmrf_icp.synthetic.primitives import Primitive
from hmrf_icp.synthetic.scenes import Scene

MILLIMETRES = 1000.0
"""Units of a 16-bit depth map per metre, as structured-light sensors write them."""


def render(scene: Scene, camera: PinholeCamera, pose: ArrayLike) -> Array:
    """Cast one ray through the centre of every pixel.

    Parameters
    ----------
    scene
        What to see.
    camera
        What sees it: +z forward, x right, y down.
    pose
        (4, 4), camera to world.

    Returns
    -------
    (H, W) float64: depth along the optical axis, metres; NaN where nothing is hit.

    Raises
    ------
    InputError
        The pose is not a rigid motion.
    """
    pose = as_rigid(pose, "pose")
    rays = _rotated(camera.unproject(np.ones((camera.height, camera.width))), pose)
    depth = np.full((camera.height, camera.width), np.inf)
    for primitive in scene.primitives:
        window = _window(primitive, camera, pose)
        part = depth[window]
        if part.size == 0:
            continue
        hit = primitive.intersect(pose[:3, 3], rays[window].reshape(-1, 3))
        np.minimum(part, hit.reshape(part.shape), out=part)
    depth[np.isinf(depth)] = np.nan
    return depth


def _rotated(rays: Array, pose: Array) -> Array:
    """Turn rays (H, W, 3) by a pose, row by row: all at once BLAS would start threads for it."""
    return np.stack([row @ pose[:3, :3].T for row in rays])


def _window(primitive: Primitive, camera: PinholeCamera, pose: Array) -> tuple[slice, slice]:
    """Rows and columns outside of which no ray can hit the primitive."""
    corners = transform(inverse(pose), primitive.corners())
    if (corners[:, 2] <= 0).all():
        return slice(0, 0), slice(0, 0)
    if (corners[:, 2] <= 0).any():  # reaches behind the camera: its projection is unbounded
        return slice(0, camera.height), slice(0, camera.width)
    u, v, _ = camera.project(corners)
    columns = np.clip([math.floor(u.min()), math.ceil(u.max()) + 1], 0, camera.width)
    rows = np.clip([math.floor(v.min()), math.ceil(v.max()) + 1], 0, camera.height)
    return slice(int(rows[0]), int(rows[1])), slice(int(columns[0]), int(columns[1]))


def render_lidar(
    scene: Scene,
    pose: ArrayLike,
    elevations: ArrayLike | None = None,
    azimuths: int = 1024,
    max_range: float = 80.0,
) -> PointCloud:
    """Turn a spinning LiDAR once around in the scene.

    Parameters
    ----------
    scene
        What to see.
    pose
        (4, 4), sensor to world. In the sensor's frame x is forward, y left, z up.
    elevations
        (beams,) angle of each beam above the horizon, rad, the order of the
        rows. None means 64 beams from +15 down to -25 degrees.
    azimuths
        Shots a turn; columns run from straight back through the left, the
        front and the right.
    max_range
        Metres; nothing further away is observed.

    Returns
    -------
    Organised cloud (beams, azimuths, 3), metres, in the sensor's own frame,
    viewpoint at the origin, NaN where nothing is hit.

    Raises
    ------
    InputError
        The pose is not a rigid motion, or the number of azimuths not positive.
    """
    pose = as_rigid(pose, "pose")
    if azimuths < 1:
        raise InputError(f"azimuths: expected at least one shot a turn, got {azimuths}")
    if elevations is None:
        elevations = np.radians(np.linspace(15.0, -25.0, 64))
    up = np.atleast_1d(np.asarray(elevations, dtype=np.float64))[:, None]
    turn = np.pi - 2 * np.pi * (np.arange(azimuths) + 0.5)[None, :] / azimuths
    rays = np.stack(
        [np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up) + 0 * turn], axis=-1
    )
    world = _rotated(rays, pose).reshape(-1, 3)
    distance = np.full(len(world), np.inf)
    for primitive in scene.primitives:
        may = _around(primitive, pose[:3, 3], world)
        distance[may] = np.minimum(distance[may], primitive.intersect(pose[:3, 3], world[may]))
    distance[distance > max_range] = np.nan
    return PointCloud(rays * distance.reshape(*rays.shape[:2], 1), viewpoint=np.zeros(3))


def _around(primitive: Primitive, origin: Array, rays: Array) -> NDArray[np.bool_]:
    """Which unit rays (N, 3) pass through the sphere around the primitive."""
    corners = primitive.corners() - origin
    centre = corners.mean(axis=0)
    radius = float(np.linalg.norm(corners - centre, axis=1).max())
    beyond = float(centre @ centre) - radius**2
    if beyond <= 0:  # the sensor stands inside the sphere
        return np.ones(len(rays), dtype=np.bool_)
    along = rays @ centre
    return np.asarray((along > 0) & (along**2 >= beyond))


@dataclass(frozen=True, slots=True)
class StructuredLight:
    """What a structured-light depth sensor (the first Kinect, the Xtion) does to a depth map.

    Parameters
    ----------
    baseline
        From the camera to the projector on its right, metres. With the camera's
        focal length it turns depth into disparity, which is what the sensor
        measures. What the projector does not light is lost: the shadow to the
        left of every object.
    disparity_step
        Steps that the disparity is rounded to, pixels.
    disparity_sigma
        Standard deviation of the disparity before rounding, pixels.
    lateral_sigma
        Standard deviation of where in the image a pixel really looks, pixels.
    dropout
        Share of the pixels lost at random.
    grazing
        Rays that meet the surface at a smaller angle than this are lost, rad.
    min_range, max_range
        Depths outside are lost, metres.
    """

    baseline: float = 0.075
    disparity_step: float = 1 / 8
    disparity_sigma: float = 1 / 48
    lateral_sigma: float = 0.5
    dropout: float = 0.01
    grazing: float = math.radians(10.0)
    min_range: float = 0.4
    max_range: float = 4.5


def sensor_noise(
    depth: Array,
    camera: PinholeCamera,
    rng: np.random.Generator,
    sensor: StructuredLight | None = None,
) -> NDArray[np.uint16]:
    """See an exact depth map as a structured-light sensor would.

    Everything happens in inverse depth: disparity is proportional to it, and
    on a plane it is linear in the pixel, so that a jittered pixel keeps on its
    surface and no points float between two.

    Parameters
    ----------
    depth
        (H, W), metres, NaN where nothing is hit.
    camera
        That it was rendered with.
    rng
        Source of the noise; the same state gives the same map.
    sensor
        None means ``StructuredLight()``.

    Returns
    -------
    (H, W) uint16, millimetres, 0 where the sensor observes nothing.

    Raises
    ------
    InputError
        The map is not of the camera's size.
    """
    if depth.shape != (camera.height, camera.width):
        raise InputError(
            f"depth: expected the camera's {camera.width} x {camera.height} pixels, "
            f"got an array of shape {depth.shape}"
        )
    sensor = StructuredLight() if sensor is None else sensor
    inverse_depth = 1.0 / depth
    per_row, per_column = _slopes(inverse_depth, 0), _slopes(inverse_depth, 1)

    # Where the pixel really looks: the nearest pixel, and the rest of the way on its plane.
    jitter = rng.normal(0.0, sensor.lateral_sigma, (2, *depth.shape))
    rows, columns = np.indices(depth.shape)
    row = np.clip(np.rint(rows + jitter[0]), 0, camera.height - 1).astype(np.intp)
    column = np.clip(np.rint(columns + jitter[1]), 0, camera.width - 1).astype(np.intp)
    seen = (
        inverse_depth[row, column]
        + per_row[row, column] * (rows + jitter[0] - row)
        + per_column[row, column] * (columns + jitter[1] - column)
    )

    pixels = camera.fx * sensor.baseline * seen
    pixels += rng.normal(0.0, sensor.disparity_sigma, depth.shape)
    steps = np.rint(pixels / sensor.disparity_step)
    lost = ~(steps > 0) | (rng.random(depth.shape) < sensor.dropout)
    steps[lost] = 1.0
    measured = camera.fx * sensor.baseline / (steps * sensor.disparity_step)

    lost |= _incidence(inverse_depth, per_row, per_column, camera) < math.sin(sensor.grazing)
    lost |= _shadowed(inverse_depth, camera.fx * sensor.baseline)
    lost |= (measured < sensor.min_range) | (measured > sensor.max_range)
    measured[lost] = 0.0
    millimetres = np.minimum(np.rint(measured * MILLIMETRES), SATURATED - 1)
    return np.asarray(millimetres.astype(np.uint16))


def _slopes(values: Array, axis: int) -> Array:
    """Change of a map (H, W) per pixel along an axis, on the side where it changes less.

    The smaller of the two sides stays on the surface next to an edge. Where
    both neighbours are missing the slope is 0.
    """
    step = np.diff(values, axis=axis)
    edge = np.full_like(np.take(values, [0], axis=axis), np.nan)
    before, after = np.concatenate([edge, step], axis), np.concatenate([step, edge], axis)
    take_after = ~(np.abs(before) <= np.abs(after))
    slope = np.where(take_after & ~np.isnan(after), after, before)
    return np.nan_to_num(slope, nan=0.0)


def _shadowed(inverse_depth: Array, focal_baseline: float) -> NDArray[np.bool_]:
    """Pixels (H, W) whose surface the projector cannot light.

    The projector sees a pixel at its column less its disparity. Along a row
    of one surface that grows; where it falls back, what comes after stands in
    the light of what came before. ``focal_baseline`` is in pixels times metres.
    """
    lit = np.arange(inverse_depth.shape[1]) - focal_baseline * np.nan_to_num(inverse_depth)
    least_to_the_right = np.minimum.accumulate(lit[:, ::-1], axis=1)[:, ::-1]
    return np.asarray(lit > least_to_the_right)


def _incidence(
    inverse_depth: Array, per_row: Array, per_column: Array, camera: PinholeCamera
) -> Array:
    """Sine of the angle between each pixel's ray and the surface that it meets, (H, W).

    A plane n . p = 1 has inverse depth n . (x, y, 1) at the ray (x, y, 1):
    its slopes are n_x and n_y, and the ray's product with n is the value itself.
    """
    rays = camera.unproject(np.ones_like(inverse_depth))
    normal_x, normal_y = per_column * camera.fx, per_row * camera.fy
    normal_z = inverse_depth - rays[..., 0] * normal_x - rays[..., 1] * normal_y
    normal = np.sqrt(normal_x**2 + normal_y**2 + normal_z**2)
    return np.asarray(inverse_depth / (normal * np.linalg.norm(rays, axis=-1)))
