"""Rigid motions of space: the group SE(3), as 4 x 4 matrices.

Every matrix here is float64, acts on column vectors, and carries metres in
its last column. A *twist* is a vector of six: rotation (rad) first, then
translation (m), the order used throughout the package.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmrf_icp.errors import InputError

Array: TypeAlias = NDArray[np.float64]

RIGID_TOLERANCE = 2e-3
"""How far ``R.T @ R`` may stand from the identity before a matrix is refused.

Pose files are written with three decimals or more. Three round an entry by 5e-4 at most, and an
entry of ``R.T @ R``, the product of two unit columns, by 2 * sqrt(3) * 5e-4 = 1.73e-3 and a
little: accepted, and made a rotation again. A scale of 0.2 % is refused.
"""


_PIECE = 4096
"""Points that are moved at a time."""


def as_rigid(matrix: ArrayLike | None, name: str = "init") -> Array:
    """Check that a matrix is a rigid motion and clean its rounding.

    Parameters
    ----------
    matrix
        (4, 4), or None for the identity.
    name
        What the error message calls it.

    Returns
    -------
    (4, 4) float64 whose rotation is orthonormal to machine precision.

    Raises
    ------
    InputError
        Not 4 x 4, not finite, the last row is not (0, 0, 0, 1), or the upper
        left block is not a rotation (a scale, a shear or a reflection).
    """
    if matrix is None:
        return np.eye(4)
    try:
        pose = np.array(matrix, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: expected a 4 x 4 matrix of numbers, got {error}") from None
    if pose.shape != (4, 4):
        raise InputError(f"{name}: expected a 4 x 4 matrix, got shape {pose.shape}")
    if not np.isfinite(pose).all():
        raise InputError(f"{name}: expected finite numbers, found NaN or infinity")
    if np.abs(pose[3] - (0.0, 0.0, 0.0, 1.0)).max() > RIGID_TOLERANCE:
        raise InputError(
            f"{name}: the last row of a rigid motion is 0 0 0 1, found {pose[3].tolist()}; "
            "transpose the matrix if it was written for row vectors"
        )
    rotation = pose[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        off = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
    if not off <= RIGID_TOLERANCE:
        raise InputError(
            f"{name}: the upper left 3 x 3 block is not a rotation (R^T R is off the identity by "
            f"{off:.3g}, three decimals by {RIGID_TOLERANCE:g} at most); a registration is rigid: "
            "remove scale and shear, or write the matrix with more decimals"
        )
    if np.linalg.det(rotation) < 0:
        raise InputError(f"{name}: the rotation is a reflection (determinant -1), not a motion")
    pose[:3, :3] = nearest_rotation(rotation)
    pose[3] = (0.0, 0.0, 0.0, 1.0)
    return pose


def nearest_rotation(matrix: Array) -> Array:
    """Return the rotation nearest to a (3, 3) matrix in the Frobenius norm (never a reflection)."""
    u, _, vt = np.linalg.svd(matrix)
    u[:, -1] *= np.sign(np.linalg.det(u @ vt))
    return np.asarray(u @ vt)


def rigid(rotation: ArrayLike, translation: ArrayLike) -> Array:
    """Assemble a (4, 4) motion from a (3, 3) rotation and a (3,) translation in metres."""
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = translation
    return pose


def inverse(pose: Array) -> Array:
    """Invert a rigid motion through its transpose."""
    rotation = pose[:3, :3].T
    return rigid(rotation, -rotation @ pose[:3, 3])


def transform(pose: Array, points: Array) -> Array:
    """Move points of shape (..., 3) by a (4, 4) motion; NaN stays NaN."""
    if points.ndim != 2 or len(points) <= _PIECE:
        return np.asarray(points @ pose[:3, :3].T + pose[:3, 3])
    # A piece at a time stays in the cache, and BLAS starts no threads for it.
    turn, moved = pose[:3, :3].T, np.empty(points.shape)
    for first in range(0, len(points), _PIECE):
        piece = slice(first, first + _PIECE)
        np.matmul(points[piece], turn, out=moved[piece])
        moved[piece] += pose[:3, 3]
    return moved


def rotation_angle(pose: Array) -> float:
    """Angle of a motion's rotation, radians in [0, pi].

    Taken from the skew part as well as the trace, so that an angle of 1e-9 is
    not lost in the rounding of ``arccos`` near 1.
    """
    r = pose[:3, :3]
    sine = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    return float(np.arctan2(np.linalg.norm(sine), np.trace(r) - 1.0))


def translation_norm(pose: Array) -> float:
    """Length of a motion's translation, metres."""
    return float(np.linalg.norm(pose[:3, 3]))


def skew(v: ArrayLike) -> Array:
    """Return the (3, 3) matrix whose product with x is the cross product v x x."""
    x, y, z = np.asarray(v, dtype=np.float64)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_exp(vector: ArrayLike) -> Array:
    """Rotation about ``vector`` by its length in radians (Rodrigues)."""
    vector = np.asarray(vector, dtype=np.float64)
    angle = float(np.linalg.norm(vector))
    k = skew(vector)
    if angle < 1e-6:
        return np.asarray(np.eye(3) + k + 0.5 * k @ k)
    a = np.sin(angle) / angle
    b = (1.0 - np.cos(angle)) / angle**2
    return np.asarray(np.eye(3) + a * k + b * k @ k)


def exp(twist: ArrayLike) -> Array:
    """Exponential map of SE(3): the retraction of a twist (rotation first) to a motion."""
    twist = np.asarray(twist, dtype=np.float64)
    omega, v = twist[:3], twist[3:]
    angle = float(np.linalg.norm(omega))
    k = skew(omega)
    if angle < 1e-6:
        left = np.eye(3) + 0.5 * k + k @ k / 6.0
    else:
        left = (
            np.eye(3)
            + (1.0 - np.cos(angle)) / angle**2 * k
            + (angle - np.sin(angle)) / angle**3 * k @ k
        )
    return rigid(rotation_exp(omega), left @ v)


def log(pose: Array) -> Array:
    """Twist (6,), rotation first, whose exponential is ``pose``; the angle is in [0, pi]."""
    rotation = pose[:3, :3]
    angle = rotation_angle(pose)
    sine = 0.5 * np.array(
        [
            rotation[2, 1] - rotation[1, 2],
            rotation[0, 2] - rotation[2, 0],
            rotation[1, 0] - rotation[0, 1],
        ]
    )
    if angle < 1e-6:
        omega, bend = sine, 1.0 / 12.0
    else:
        if angle < 3.0:
            omega = sine * (angle / np.sin(angle))
        else:
            # Near half a turn the sine says little; the symmetric part has the axis in each row.
            symmetric = 0.5 * (rotation + rotation.T) - np.cos(angle) * np.eye(3)
            axis = symmetric[np.argmax(np.diag(symmetric))]
            axis = axis / np.linalg.norm(axis)
            omega = angle * (axis if axis @ sine >= 0.0 else -axis)
        bend = (1.0 - 0.5 * angle / np.tan(0.5 * angle)) / angle**2
    k = skew(omega)
    inverse_left = np.eye(3) - 0.5 * k + bend * k @ k
    return np.concatenate([omega, inverse_left @ pose[:3, 3]])


def rotation_about(axis: ArrayLike, angle: float, centre: ArrayLike) -> Array:
    """Rotation by ``angle`` radians about ``axis`` through the point ``centre``."""
    axis = np.asarray(axis, dtype=np.float64)
    rotation = rotation_exp(angle * axis / np.linalg.norm(axis))
    centre = np.asarray(centre, dtype=np.float64)
    return rigid(rotation, centre - rotation @ centre)


def about(twist: ArrayLike, centre: ArrayLike) -> Array:
    """Motion (4, 4) of a twist about the point ``centre`` (3,) instead of about the origin."""
    there = rigid(np.eye(3), centre)
    return np.asarray(there @ exp(twist) @ inverse(there))


def error(estimate: Array, truth: Array) -> tuple[float, float]:
    """Error of a pose as the paper reports it (Results): metres and radians.

    The length of the difference of the translations, and the angle of the
    rotation that is left between the two.
    """
    metres = float(np.linalg.norm(estimate[:3, 3] - truth[:3, 3]))
    return metres, rotation_angle(inverse(truth) @ estimate)
