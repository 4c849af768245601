"""Scenes to render, and hand-held walks around them.

The world's z axis points up, y away from who looks, x to their right; metres.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.errors import InputError
from hmrf_icp.se3 import Array, rigid, rotation_exp
from hmrf_icp.synthetic.primitives import Box, Frustum, Primitive, Rectangle, Sphere, Torus

CAMERA = PinholeCamera(width=640, height=480, fx=585.0, fy=585.0, cx=319.5, cy=239.5)
"""A structured-light sensor's usual intrinsics, pixels."""


@dataclass(frozen=True, eq=False)
class Scene:
    """What there is to see.

    Parameters
    ----------
    name
        What it is called in a data set's name, ``synthetic:NAME``.
    primitives
        The shapes, placed in the world.
    """

    name: str
    primitives: tuple[Primitive, ...]


def look_at(eye: ArrayLike, target: ArrayLike, roll: float = 0.0) -> Array:
    """Return the pose (4, 4), camera to world, of a camera held upright.

    Parameters
    ----------
    eye
        (3,) where the camera stands, metres.
    target
        (3,) the point on its optical axis, metres.
    roll
        Rotation about the optical axis, rad.
    """
    eye = np.asarray(eye, dtype=np.float64)
    forward = np.asarray(target, dtype=np.float64) - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    upright = np.stack([right, np.cross(forward, right), forward], axis=1)
    return rigid(upright @ rotation_exp((0.0, 0.0, roll)), eye)


def _at(x: float, y: float, z: float, yaw: float = 0.0, tilt: float = 0.0) -> Array:
    """Pose of a shape at (x, y, z), turned about the upright axis after a tilt about x; degrees."""
    turn = rotation_exp((0.0, 0.0, np.radians(yaw)))
    return rigid(turn @ rotation_exp((np.radians(tilt), 0.0, 0.0)), (x, y, z))


def _standing(
    x: float, y: float, z: float, size: tuple[float, float, float], yaw: float = 0.0
) -> Box:
    """Box whose underside is centred at (x, y, z)."""
    return Box(_at(x, y, z + size[2] / 2, yaw), size)


def _floor(x: float, y: float, size: tuple[float, float]) -> Rectangle:
    return Rectangle(_at(x, y, 0.0), size)


def _wall(x: float, y: float, width: float, height: float, yaw: float = 0.0) -> Rectangle:
    """Upright wall on the floor, facing along y before it is turned."""
    return Rectangle(_at(x, y, height / 2, yaw, 90.0), (width, height))


def _mug(x: float, y: float, z: float, yaw: float = 0.0) -> tuple[Primitive, ...]:
    """Mug of coffee; half of the ring that makes the handle drowns in it."""
    handle = rigid(rotation_exp((np.pi / 2, 0.0, 0.0)), (0.0, 0.0, 0.0))
    handle = _at(x, y, z + 0.048, yaw) @ rigid(np.eye(3), (0.043, 0.0, 0.0)) @ handle
    return (
        Frustum(_at(x, y, z), 0.040, 0.043, 0.10, closed_top=False),
        Frustum(_at(x, y, z), 0.040, 0.042, 0.085),
        Torus(handle, 0.027, 0.006),
    )


def _rod(start: ArrayLike, end: ArrayLike, radius: float) -> Frustum:
    """Thin cylinder between two points."""
    start, end = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length
    side = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    side /= np.linalg.norm(side)
    frame = np.stack([side, np.cross(along, side), along], axis=1)
    return Frustum(rigid(frame, start), radius, radius, length)


def _table(
    x: float, y: float, size: tuple[float, float], height: float, leg: float
) -> list[Primitive]:
    """Table top of 3 cm on four legs, its upper side at ``height``."""
    parts: list[Primitive] = [_standing(x, y, height - 0.03, (*size, 0.03))]
    for side in (-1, 1):
        for end in (-1, 1):
            corner = x + side * (size[0] - leg) / 2, y + end * (size[1] - leg) / 2
            parts.append(_standing(*corner, 0.0, (leg, leg, height - 0.03)))
    return parts


def desk() -> Scene:
    """Furnish a small study: a desk in a corner, a shelf and a cupboard beside it."""
    top = 0.74
    room = [
        _floor(0.7, -1.0, (4.6, 3.2)),
        _wall(0.7, 0.60, 4.6, 2.5),
        _wall(-1.15, -1.0, 3.2, 2.5, yaw=90.0),
        _wall(2.75, -1.0, 3.2, 2.5, yaw=90.0),
        _standing(-0.12, 0.585, 1.35, (0.60, 0.03, 0.42)),  # a picture
    ]
    furniture = _table(0.0, 0.15, (1.60, 0.80), top, 0.05)
    furniture += [_standing(0.52, 0.17, 0.06, (0.42, 0.62, 0.60))]  # drawers and their fronts
    for number in range(3):
        level = 0.09 + 0.19 * number
        furniture.append(_standing(0.52, -0.15, level, (0.38, 0.02, 0.17)))
        furniture.append(_rod((0.46, -0.18, level + 0.10), (0.58, -0.18, level + 0.10), 0.008))
    monitor = [
        Box(_at(-0.16, 0.30, 1.06, 12.0, -8.0), (0.56, 0.035, 0.34)),
        _standing(-0.17, 0.345, top, (0.07, 0.03, 0.28), 12.0),
        Frustum(_at(-0.17, 0.33, top), 0.13, 0.11, 0.015),
    ]
    keyboard = [Box(_at(-0.14, -0.02, top + 0.014, 5.0, 4.0), (0.44, 0.15, 0.018))]
    for row in range(4):
        place = _at(-0.14, -0.02, top + 0.014, 5.0, 4.0) @ _at(0.0, -0.05 + 0.034 * row, 0.012)
        keyboard.append(Box(place, (0.42, 0.024, 0.008)))
    clutter = [
        *_mug(0.27, 0.02, top, -35.0),
        Frustum(_at(-0.60, 0.26, top), 0.085, 0.06, 0.02),  # a globe
        _rod((-0.60, 0.26, top), (-0.60, 0.26, top + 0.06), 0.012),
        Sphere(_at(-0.60, 0.26, top + 0.19), 0.125),
        Torus(_at(-0.60, 0.26, top + 0.19, 25.0, 67.0), 0.145, 0.007),
        Frustum(_at(-0.10, 0.30, 0.0), 0.11, 0.14, 0.33, closed_top=False),  # a bin under it
        Frustum(_at(-0.45, -0.10, top), 0.035, 0.040, 0.11, closed_top=False),  # pencils
        _rod((-0.46, -0.10, top + 0.01), (-0.49, -0.12, top + 0.17), 0.004),
        _rod((-0.44, -0.09, top + 0.01), (-0.41, -0.08, top + 0.16), 0.004),
        Frustum(_at(0.68, 0.42, top), 0.085, 0.075, 0.025),  # a lamp
        _rod((0.68, 0.42, top), (0.72, 0.40, top + 0.38), 0.010),
        _rod((0.72, 0.40, top + 0.38), (0.50, 0.26, top + 0.52), 0.010),
        Frustum(_at(0.47, 0.24, top + 0.39, -30.0, 18.0), 0.095, 0.035, 0.13, closed_bottom=False),
    ]
    level = top
    for size, yaw in (
        ((0.23, 0.30, 0.035), 14.0),
        ((0.20, 0.28, 0.025), -9.0),
        ((0.21, 0.26, 0.045), 24.0),
        ((0.15, 0.22, 0.020), 2.0),
    ):
        clutter.append(_standing(0.52, 0.06, level, size, yaw))
        level += size[2]
    return Scene("desk", (*room, *furniture, *monitor, *keyboard, *clutter, *_shelf(), *_corner()))


def _shelf() -> list[Primitive]:
    """Open shelf to the right of the desk, with books, a ball and boxes."""
    left, right, front, depth = 1.02, 1.78, 0.42, 0.30
    middle = (left + right) / 2
    parts: list[Primitive] = [_standing(x, front, 0.0, (0.025, depth, 1.50)) for x in (left, right)]
    parts += [
        _standing(middle, front, z, (right - left, depth, 0.025))
        for z in (0.05, 0.42, 0.79, 1.14, 1.475)
    ]
    x = left + 0.03
    for thick, tall, lean in (
        (0.04, 0.25, 0.0),
        (0.03, 0.22, 0.0),
        (0.05, 0.28, 0.0),
        (0.025, 0.20, 0.0),
        (0.04, 0.24, 4.0),
        (0.035, 0.26, 0.0),
    ):
        parts.append(_standing(x + thick / 2, front - 0.03, 0.815, (thick, 0.19, tall), lean))
        x += thick + 0.008
    parts += [
        Sphere(_at(1.60, front - 0.02, 0.815 + 0.10), 0.10),
        _standing(1.22, front - 0.01, 0.445, (0.28, 0.24, 0.20), 7.0),
        Frustum(_at(1.58, front - 0.02, 0.445), 0.07, 0.11, 0.22),
        _standing(1.55, front, 0.075, (0.30, 0.26, 0.22), -5.0),
        Frustum(_at(1.20, front, 1.165), 0.05, 0.08, 0.20, closed_top=False),
        _standing(1.50, front, 1.165, (0.24, 0.20, 0.12), 12.0),
    ]
    return parts


def _corner() -> list[Primitive]:
    """Fill the corner right of the shelf: a cupboard, boxes, a plant."""
    return [
        _standing(2.50, -0.55, 0.0, (0.50, 0.90, 1.10)),  # a cupboard along the right wall
        _standing(2.24, -0.79, 0.06, (0.02, 0.40, 0.98)),
        _standing(2.24, -0.33, 0.06, (0.02, 0.40, 0.98)),
        _rod((2.21, -0.57, 0.55), (2.21, -0.57, 0.72), 0.009),
        _standing(2.48, -0.60, 1.10, (0.30, 0.40, 0.22), 20.0),
        _standing(2.12, 0.28, 0.0, (0.48, 0.42, 0.46), 17.0),
        _standing(2.14, 0.28, 0.46, (0.28, 0.24, 0.22), -21.0),
        Frustum(_at(2.52, 0.30, 0.0), 0.13, 0.17, 0.30),  # a plant in its pot
        _rod((2.52, 0.30, 0.28), (2.50, 0.32, 0.62), 0.015),
        Sphere(_at(2.50, 0.32, 0.74), 0.19),
    ]


def tabletop() -> Scene:
    """Set a table with a handful of objects, a wall behind it and a floor below."""
    top = 0.70
    table = _table(0.0, 0.0, (0.90, 0.62), top, 0.06)
    objects = [
        Sphere(_at(-0.17, -0.06, top + 0.075), 0.075),
        _standing(0.16, 0.10, top, (0.16, 0.11, 0.19), 28.0),
        *_mug(0.06, -0.15, top, 40.0),
        Frustum(_at(-0.12, 0.16, top), 0.045, 0.075, 0.12),  # a vase
        Frustum(_at(-0.12, 0.16, top + 0.12), 0.075, 0.030, 0.09),
        Frustum(_at(-0.12, 0.16, top + 0.21), 0.030, 0.050, 0.05, closed_top=False),
        _standing(-0.30, 0.10, top, (0.20, 0.14, 0.035), -20.0),
        _standing(-0.30, 0.10, top + 0.035, (0.17, 0.12, 0.030), 6.0),
        Torus(_at(0.27, -0.10, top + 0.018), 0.055, 0.018),
    ]
    room = [
        _floor(0.0, -0.2, (4.4, 3.4)),
        _wall(0.0, 1.25, 4.4, 2.4),
        _wall(-2.0, -0.2, 3.4, 2.4, yaw=84.0),
        _wall(2.1, -0.2, 3.4, 2.4, yaw=95.0),
        _standing(-1.45, 0.75, 0.0, (0.50, 0.45, 0.95), 12.0),
        _standing(1.55, -0.45, 0.0, (0.55, 0.80, 0.60), -8.0),
    ]
    return Scene("tabletop", (*room, *table, *objects))


SCENES: dict[str, Callable[[], Scene]] = {"desk": desk, "tabletop": tabletop}
"""What ``synthetic:NAME`` can be."""

_DESK_WALK = np.array(
    [  # eye, and the point looked at
        [-0.35, -1.00, 1.38, -0.28, 0.20, 0.84],
        [-0.20, -0.92, 1.42, -0.16, 0.22, 0.82],
        [0.02, -0.95, 1.46, 0.10, 0.24, 0.80],
        [0.26, -1.02, 1.42, 0.42, 0.26, 0.78],
        [0.50, -1.05, 1.44, 0.84, 0.30, 0.74],
        [0.72, -1.06, 1.40, 1.26, 0.34, 0.72],
        [0.92, -1.02, 1.42, 1.72, 0.30, 0.66],
        [1.05, -0.98, 1.45, 2.16, 0.10, 0.60],
    ]
)


def _orbit(knots: int = 12) -> Array:
    """Walk around the table: 190 degrees, between 0.6 and 1.2 m from the objects."""
    angle = np.radians(np.linspace(-95.0, 95.0, knots))
    distance = 0.88 + 0.22 * np.cos(np.linspace(0.3, 2.6 * np.pi, knots))
    height = np.radians(29.0 + 7.0 * np.sin(np.linspace(0.0, 3.0 * np.pi, knots)))
    target = np.stack(
        [0.08 * np.sin(angle), 0.04 * np.cos(2 * angle), np.full(knots, 0.80)], axis=1
    )
    away = np.stack(
        [np.sin(angle) * np.cos(height), -np.cos(angle) * np.cos(height), np.sin(height)], axis=1
    )
    return np.concatenate([target + distance[:, None] * away, target], axis=1)


_WALKS: dict[str, Callable[[], Array]] = {"desk": _DESK_WALK.copy, "tabletop": _orbit}


def trajectory(name: str, n: int) -> list[Array]:
    """Sample a hand-held walk around a scene.

    The desk's leads from the desk along the shelf into the corner, where
    nothing is left of the first view; the tabletop's goes around the table.
    The walk is always the same: ``n`` only says how densely it is sampled.

    Parameters
    ----------
    name
        A key of ``SCENES``.
    n
        Number of poses, 1 or more.

    Returns
    -------
    n poses (4, 4), camera to world.

    Raises
    ------
    InputError
        No such scene, or no poses asked for.
    """
    if name not in _WALKS:
        raise InputError(f"trajectory: no scene {name!r}; known are {', '.join(SCENES)}")
    if n < 1:
        raise InputError(f"trajectory: expected one pose or more, got {n}")
    from scipy.interpolate import CubicSpline

    knots = _WALKS[name]()
    time = np.linspace(0.0, len(knots) - 1.0, n)
    path = CubicSpline(np.arange(len(knots)), knots)(time)
    # An unsteady hand: incommensurate slow sines, a few millimetres and about a degree.
    frequency = np.array([1.9, 2.3, 2.9, 1.7, 2.7, 3.1])
    amplitude = np.array([0.008, 0.008, 0.006, 0.015, 0.015, 0.012])
    path = path + amplitude * np.sin(time[:, None] * frequency + np.arange(6))
    roll = np.radians(1.5) * np.sin(1.3 * time + 0.4)
    return [look_at(p[:3], p[3:], r) for p, r in zip(path, roll, strict=True)]
