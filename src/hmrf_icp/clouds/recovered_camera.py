"""The camera that an organised cloud was seen with, told from its points alone.

Every pixel (u, v) of a pinhole camera and the point (x, y, z) that it saw satisfy
u = fx x / z + cx and v = fy y / z + cy exactly. Ten thousand points over-determine four
numbers by far: either they fit to a small part of a pixel, or there is no such camera. Where the
cloud was moved, its grid was flipped or its axes are named in another order, the projection
is the general one, u w, v w, w = P (x, y, z, 1), and P holds the camera and its pose
(Abdel-Aziz and Karara 1971).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.camera import PinholeCamera

Array = NDArray[np.float64]

SAMPLE = 6_000
"""Pixels that the projection is fitted to, evenly over the grid."""

FEWEST, SHORTEST = 60, 6
"""Observed points, and rows and columns, without which a grid says nothing."""

FITS, STILL = 0.1, 1.0
"""Pixels within which nine points in ten must fit, and the same where coordinates are so coarsely
rounded (millimetres, near the camera) that they cannot fit better."""

FRONT = 0.95
"""Share of the points that must be in front of the camera; a few may be spoilt."""

ROUNDINGS = 3.0
"""The rounding of the coordinates, as deviations in pixels, that nine points in ten must be
within."""

NEAR = 3.0
"""Pixels within which half of the points must be before a moved camera is fitted with care."""

RELIEF, BETTER = 1.0, 0.2
"""Pixels that a projection along parallel rays must leave at least, and the share of them that a
pinhole may: on a plane that faces the camera both fit, and nothing says where it was seen from."""

UNSURE = 0.01
"""Deviation of the place, as a share of the median depth, from which a pose counts as unknown."""

OUTLYING = 3.0
"""Points farther off than so many deviations do not take part in the next fit."""


@dataclass(frozen=True, eq=False)
class RecoveredCamera:
    """A camera, and how the cloud stands to it.

    Attributes
    ----------
    camera
        For the grid as it is, or with its columns in reverse order where ``mirrored``.
    pose
        (4, 4) takes the camera's frame (z forward, x right, y down) to the cloud's;
        the identity for a cloud that still is where its camera saw it.
    mirrored
        Whether the grid shows the scene as a mirror does; then ``points[:, ::-1]`` does not.
    residual
        Pixels within which nine points in ten fit.
    """

    camera: PinholeCamera
    pose: Array
    mirrored: bool
    residual: float

    @property
    def viewpoint(self) -> Array:
        """(3,) where the camera stood, in the cloud's frame, metres."""
        return np.array(self.pose[:3, 3])

    @property
    def at_origin(self) -> bool:
        """Whether the cloud is in the camera's own frame, its grid as the camera's."""
        return not self.mirrored and bool(np.array_equal(self.pose, np.eye(4)))

    @property
    def projection(self) -> Array:
        """(17,) as a range image has it, for points in the cloud's frame."""
        camera, rotation = self.camera, self.pose[:3, :3].T
        numbers = [0.0, camera.fx, camera.fy, camera.cx, camera.cy]
        return np.concatenate([numbers, self.viewpoint, rotation.ravel()])

    @property
    def text(self) -> str:
        """What was recovered, in a line."""
        camera = self.camera
        how = "" if self.at_origin else ", mirrored" if self.mirrored else ", moved"
        if not np.array_equal(self.pose, np.eye(4)):
            how += " to " + " ".join(f"{value:.4g}" for value in self.viewpoint)
        return (
            f"recovered: pinhole {camera.width} x {camera.height}, "
            f"fx {camera.fx:.1f}, fy {camera.fy:.1f}, cx {camera.cx:.1f}, cy {camera.cy:.1f}{how} "
            f"({self.residual:.2g} px)"
        )


def recovered_camera(points: Array) -> RecoveredCamera | None:
    """Find the pinhole camera that points (H, W, 3) were seen with, or None where there is none.

    Crops and grids of every n-th row and column have a camera of their own. A
    range image about a LiDAR, a map of heights and a grid of points in no order have none, and
    neither has a plane alone, unless the cloud is in its camera's frame.

    Parameters
    ----------
    points
        (H, W, 3), NaN where nothing was seen.
    """
    if points.ndim != 3 or min(points.shape[:2]) < SHORTEST:
        return None
    pixels, some = _sample(points)
    if len(some) < FEWEST:
        return None
    rounding = _rounding(some)
    for fit in (_in_its_frame, _in_its_frame_on_its_side, _moved):
        projection = fit(pixels, some)
        if projection is None:
            continue
        off, depth = _off(projection, pixels, some)
        if np.count_nonzero(depth > 0) < FRONT * len(depth):
            continue
        residual = float(np.quantile(off, 0.9))
        focal = float(np.linalg.norm(projection[0, :3]))
        # A rounded coordinate moves the pixel by focal / depth as much, the depth itself alike.
        blur = focal * rounding / float(np.quantile(depth, 0.1))
        if residual > min(max(FITS, ROUNDINGS * blur), STILL):
            continue
        parallel = _parallel(pixels, some)
        if parallel < RELIEF or residual > BETTER * parallel:
            return None
        return _decomposed(projection, points.shape[:2], residual)
    return None


def _sample(points: Array) -> tuple[Array, Array]:
    """Pixels (n, 2) as (u, v) and the points (n, 3) seen there, evenly over the grid."""
    height, width, _ = points.shape
    # Of a large image, a grid that holds a few times as many.
    step = max(1, math.isqrt(height * width // (4 * SAMPLE)))
    some = points[::step, ::step]
    seen = np.isfinite(some).all(axis=-1) & (some != 0.0).any(axis=-1)
    places = np.flatnonzero(seen)
    places = places[np.linspace(0, len(places) - 1, min(SAMPLE, len(places))).astype(np.int64)]
    rows, columns = np.divmod(places, some.shape[1])
    pixels = np.column_stack([columns, rows]).astype(np.float64) * step
    return pixels, some.reshape(-1, 3)[places].astype(np.float64)


def _rounding(points: Array) -> float:
    """Deviation of the rounding of the coordinates, metres, or less.

    No two values of a rounded coordinate are closer than its unit: the smallest gap bounds it.
    """
    largest = float(np.abs(points).max())
    single = float(np.finfo(np.float32).eps) * largest
    unit = 0.0
    for axis in range(3):
        gaps = np.diff(np.unique(points[:, axis]))
        gaps = gaps[gaps > 4.0 * single]
        if gaps.size:
            unit = max(unit, float(gaps.min()))
    return (unit + single) / math.sqrt(12.0)


def _off(projection: Array, pixels: Array, points: Array) -> tuple[Array, Array]:
    """How far each pixel is from where its point is projected, and the depth of the point."""
    seen = points @ projection[:, :3].T + projection[:, 3]
    return np.hypot(*(_divided(seen) - pixels).T), seen[:, 2]


def _divided(seen: Array) -> Array:
    """Pixels (n, 2) of homogeneous ones (n, 3): infinite where the depth is zero."""
    pixels = np.full((len(seen), 2), np.inf)
    with np.errstate(over="ignore"):
        np.divide(seen[:, :2], seen[:, 2:], out=pixels, where=seen[:, 2:] != 0.0)
    return pixels


def _in_its_frame(pixels: Array, points: Array) -> Array | None:
    """Least squares of u on x / z and of v on y / z."""
    sign = float(np.sign(np.median(points[:, 2])))
    front = sign * points[:, 2] > 0.0
    if np.count_nonzero(front) < FRONT * len(front):
        return None
    pixels, points = pixels[front], points[front]
    projection = np.zeros((3, 4))
    projection[2, 2] = sign
    for axis in (0, 1):
        slope, constant = _line(points[:, axis] / points[:, 2], pixels[:, axis])
        if slope == 0.0:
            return None
        projection[axis, axis], projection[axis, 2] = sign * slope, sign * constant
    return projection


def _in_its_frame_on_its_side(pixels: Array, points: Array) -> Array | None:
    """Fit the same to a grid whose rows and columns changed places."""
    projection = _in_its_frame(pixels[:, ::-1], points)
    return None if projection is None else projection[[1, 0, 2]]


def _line(x: Array, y: Array) -> tuple[float, float]:
    """Slope and constant of a line, points far off it left out in the end."""
    keep = np.ones(len(x), dtype=np.bool_)
    slope = constant = 0.0
    for _ in range(4):
        mean_x, mean_y = x[keep].mean(), y[keep].mean()
        spread = ((x[keep] - mean_x) ** 2).sum()
        if spread <= 0.0:
            return 0.0, 0.0
        slope = float(((x[keep] - mean_x) * (y[keep] - mean_y)).sum() / spread)
        constant = float(mean_y - slope * mean_x)
        keep = _close(np.abs(y - slope * x - constant))
    return slope, constant


def _close(off: Array) -> NDArray[np.bool_]:
    """Which are within a few robust deviations of zero; never fewer than half."""
    return np.asarray(off <= OUTLYING * 1.4826 * np.median(off) + 1e-9)


def _moved(pixels: Array, points: Array) -> Array | None:
    """Direct linear transformation, then Gauss and Newton on a camera without skew.

    None where the points do not determine it, as those of one plane do not.
    """
    centre, scale = points.mean(axis=0), float(points.std()) or 1.0
    middle, span = pixels.mean(axis=0), float(pixels.std()) or 1.0
    x = np.column_stack([(points - centre) / scale, np.ones(len(points))])
    uv = (pixels - middle) / span
    keep, weight = np.ones(len(x), dtype=np.bool_), np.ones(len(x))
    p = np.zeros((3, 4))
    for _ in range(5):
        rows = x[keep] * weight[keep, None]
        none = np.zeros_like(rows)
        equations = np.vstack(
            [
                np.hstack([rows, none, -uv[keep, :1] * rows]),
                np.hstack([none, rows, -uv[keep, 1:] * rows]),
            ]
        )
        _, vectors = np.linalg.eigh(equations.T @ equations)
        p = vectors[:, 0].reshape(3, 4)
        seen = x @ p.T
        if np.median(seen[:, 2]) < 0.0:
            p, seen = -p, -seen
        seen[:, 2] = np.maximum(seen[:, 2], 1e-6 * np.abs(seen[:, 2]).max())
        if not seen[:, 2].all():
            # The camera's plane holds all points: a plane whose pixels say nothing of a camera.
            return None
        keep = _close(np.hypot(*(_divided(seen) - uv).T))
        # Divided by the depth, an equation's error is the pixel's.
        weight = 1.0 / seen[:, 2]
    if np.median(np.hypot(*(_divided(seen) - uv).T)) * span > NEAR:
        return None
    undo = np.eye(4)
    undo[:3, :3] /= scale
    undo[:3, 3] = -centre / scale
    back = np.array([[span, 0.0, middle[0]], [0.0, span, middle[1]], [0.0, 0.0, 1.0]])
    return _without_skew(back @ p @ undo, pixels[keep], points[keep])


def _without_skew(projection: Array, pixels: Array, points: Array) -> Array | None:
    """Least squares over focal lengths, principal point and pose, from a projection."""
    from scipy.optimize import least_squares
    from scipy.spatial.transform import Rotation

    if abs(np.linalg.det(projection[:, :3])) <= 0.0:
        return None
    k, rotation = _factors(projection[:, :3])
    mirror = np.diag([np.sign(np.linalg.det(rotation)), 1.0, 1.0])
    place = -np.linalg.solve(projection[:, :3], projection[:, 3])
    start = mirror @ rotation
    depth = float(np.median((points - place) @ start[2]))
    focal = float(k[0, 0])
    if not depth > 0.0 or not np.isfinite(focal) or focal > 1e5:
        return None

    def of(x: Array) -> Array:
        k = np.array(
            [[focal * x[0], 0.0, focal * x[2]], [0.0, focal * x[1], focal * x[3]], [0.0, 0.0, 1.0]]
        )
        turned = Rotation.from_rotvec(x[4:7]).as_matrix() @ start
        return np.asarray(k @ mirror @ np.column_stack([turned, -turned @ (place + depth * x[7:])]))

    def off(x: Array) -> Array:
        seen = points @ of(x)[:, :3].T + of(x)[:, 3]
        return np.asarray((_divided(seen) - pixels).ravel())

    first = np.concatenate([[k[0, 0], k[1, 1], k[0, 2], k[1, 2]] / np.float64(focal), np.zeros(6)])
    try:
        fit = least_squares(off, first, method="lm", max_nfev=200)
    except ValueError:
        return None
    left = float(fit.fun @ fit.fun) / max(1, len(fit.fun) - 10)
    jacobian = np.asarray(fit.jac, dtype=np.float64)
    information = jacobian.T @ jacobian
    if np.linalg.cond(information) > 1e14:
        return None
    if np.sqrt(left * np.linalg.inv(information)[7:, 7:].trace()) > UNSURE:
        return None
    return of(fit.x)


def _factors(left: Array) -> tuple[Array, Array]:
    """K, upper triangular with a positive diagonal and K[2, 2] = 1, and the orthogonal rest."""
    from scipy.linalg import rq

    k, rotation = rq(left)
    signs = np.where(np.diag(k) < 0.0, -1.0, 1.0)
    k, rotation = k * signs, rotation * signs[:, None]
    return np.asarray(k / k[2, 2]), np.asarray(rotation)


def _parallel(pixels: Array, points: Array) -> float:
    """Pixels within which nine points in ten fit a projection along parallel rays."""
    x = np.column_stack([points, np.ones(len(points))])
    fit, *_ = np.linalg.lstsq(x, pixels, rcond=None)
    return float(np.quantile(np.hypot(*(x @ fit - pixels).T), 0.9))


def _decomposed(projection: Array, shape: tuple[int, ...], residual: float) -> RecoveredCamera:
    """Take a projection (3, 4) apart."""
    height, width = shape[:2]
    k, rotation = _factors(projection[:, :3])
    place = -np.linalg.solve(projection[:, :3], projection[:, 3])
    mirrored = bool(np.linalg.det(rotation) < 0.0)
    cx = float(k[0, 2])
    if mirrored:
        rotation = np.diag([-1.0, 1.0, 1.0]) @ rotation
        cx = width - 1.0 - cx
    whole = np.round(rotation)
    if np.abs(rotation - whole).max() < 1e-12:
        rotation = whole
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation.T, place
    pose += 0.0  # no negative zeros
    camera = PinholeCamera(width, height, float(k[0, 0]), float(k[1, 1]), cx, float(k[1, 2]))
    return RecoveredCamera(camera, pose, mirrored, residual)
