"""Clouds as lit surfaces, seen from an oblique viewpoint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.se3 import Array

LIGHT = np.array([-0.35, 0.65, 0.70])
"""Direction to the lamp in the picture's axes: right, up, towards who looks."""

SHADOW = 0.55
"""Brightness of what faces away from the lamp."""


@dataclass(frozen=True, eq=False)
class Patches:
    """Points with what is needed to draw each as a small piece of surface.

    Attributes
    ----------
    points
        (M, 3) metres.
    normals
        (M, 3) of either sign, NaN where unknown.
    spacing
        (M,) to the neighbouring points, metres.
    """

    points: Array
    normals: Array
    spacing: Array

    @classmethod
    def of(cls, cloud: PointCloud, most: int) -> tuple[Patches, NDArray[np.intp]]:
        """Thin a cloud out to about ``most`` points.

        Returns
        -------
        The patches, and for each the flat index of its point in the cloud's shape.
        """
        share = max(1.0, len(cloud) / most)
        step = int(np.ceil(np.sqrt(share) if cloud.organised else share))
        thin = cloud.subsample(step)
        index = np.arange(int(np.prod(cloud.shape))).reshape(cloud.shape)
        kept = index[(slice(None, None, step),) * index.ndim][thin.observed]
        if not thin.organised:
            normals = np.full((len(thin), 3), np.nan)
            return cls(thin.observed_points, normals, _isotropic_spacing(thin)), kept
        across, down = (_shorter_difference(thin.points, axis) for axis in (1, 0))
        normals = _smoothed_normals(across, down)
        lengths = np.stack([np.linalg.norm(across, axis=-1), np.linalg.norm(down, axis=-1)])
        spacing = np.sqrt(lengths.prod(axis=0))[thin.observed]
        usual = float(np.nanmedian(spacing)) if np.isfinite(spacing).any() else 0.0
        spacing = np.clip(np.nan_to_num(spacing, nan=usual), 0.3 * usual, 1.6 * usual)
        return cls(thin.observed_points, normals[thin.observed], spacing), kept

    def moved(self, pose: Array) -> Patches:
        """Move by a rigid motion (4, 4)."""
        return Patches(
            se3.transform(pose, self.points), self.normals @ pose[:3, :3].T, self.spacing
        )


def _shorter_difference(points: Array, axis: int) -> Array:
    """Difference (H, W, 3) to one of the two neighbours along an axis, the nearer one."""
    step = np.diff(points, axis=axis)
    edge = np.full_like(np.take(points, [0], axis=axis), np.nan)
    before, after = np.concatenate([edge, step], axis), np.concatenate([step, edge], axis)
    length_before, length_after = (np.linalg.norm(d, axis=-1) for d in (before, after))
    take_after = ~(length_before <= length_after) & ~np.isnan(length_after)
    return np.where(take_after[..., None], after, before)


def _smoothed_normals(across: Array, down: Array) -> Array:
    """Estimate normals (H, W, 3) over three by three pixels: one pixel's own are all noise."""
    from scipy.ndimage import uniform_filter

    normals = np.cross(across, down)
    with np.errstate(invalid="ignore", divide="ignore"):
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        normals = uniform_filter(np.nan_to_num(normals), size=(3, 3, 1), mode="constant")
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return normals


def _isotropic_spacing(cloud: PointCloud) -> Array:
    """One spacing for all points of an unorganised cloud, as if they filled its two widest axes."""
    extent = np.sort(np.ptp(cloud.observed_points, axis=0))
    return np.full(len(cloud), float(np.sqrt(extent[1] * extent[2] / len(cloud))))


def viewing_frame(source: PointCloud, target: PointCloud, transformation: Array) -> Array:
    """Choose from where to look at a pair of clouds in the target's frame.

    Depth maps are seen from between their two sensors, raised and to the
    side; other clouds obliquely from above, z up, on their broad side.

    Returns
    -------
    (3, 3), rows: right, up, towards who looks.
    """
    poses = [
        pose
        for cloud, pose in ((source, transformation), (target, np.eye(4)))
        if _like_a_camera(cloud)
    ]
    if poses:
        between = np.sum([pose[:3, 2] for pose in poses], axis=0)
        forward = between if np.linalg.norm(between) > 0.5 else poses[-1][:3, 2]
        up, turn, tilt = -poses[-1][:3, 1], 20.0, 15.0
    else:
        up = np.array([0.0, 0.0, 1.0])
        flat = target.observed_points[:, :2] - target.observed_points[:, :2].mean(axis=0)
        narrow = np.linalg.eigh(flat.T @ flat)[1][:, 0]
        forward, turn, tilt = np.array([*(narrow * np.sign(narrow[1] or 1.0)), 0.0]), 20.0, 40.0
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    level = np.stack([right, np.cross(right, forward / np.linalg.norm(forward)), np.zeros(3)])
    level[2] = np.cross(level[0], level[1])
    turned = se3.rotation_exp((0.0, np.radians(turn), 0.0)) @ level
    return np.asarray(se3.rotation_exp((np.radians(tilt), 0.0, 0.0)) @ turned)


def _like_a_camera(cloud: PointCloud) -> bool:
    """Whether z is forward and y down: a depth map, also where its intrinsics are not known."""
    return cloud.camera is not None or (cloud.organised and cloud.viewpoint is None)


def bounds(
    clouds: Sequence[Array], frame: Array, margin: float = 0.03, aspect: float | None = None
) -> Array:
    """Find the picture's limits ((left, right), (low, high)), metres, from points (M, 3) each.

    All but a few stray points are inside. With ``aspect``, width over height, the limits are
    widened to it: a metre is as long up as across.
    """
    flat = np.concatenate(clouds) @ frame[:2].T
    low, high = np.percentile(flat, (0.02, 99.98), axis=0)
    room = margin * (high - low).max() + 1e-12
    limits = np.stack([low - room, high + room], axis=1)
    if aspect is None:
        return limits
    span = limits[:, 1] - limits[:, 0]
    wanted = np.array([max(span[0], aspect * span[1]), max(span[1], span[0] / aspect)])
    middle = limits.mean(axis=1)
    return np.stack([middle - wanted / 2, middle + wanted / 2], axis=1)


def lit(patches: Patches, colours: Array, frame: Array) -> Array:
    """Light colours (M, 3); patches of unknown normals darken with their depth instead."""
    normals = patches.normals @ frame.T
    # A depth map shows front sides alone, whichever way its normals point.
    normals = normals * np.where(normals[:, 2:] < 0, -1.0, 1.0)
    cosine = np.clip(normals @ (LIGHT / np.linalg.norm(LIGHT)), 0.0, 1.0)
    unknown = np.isnan(cosine)
    if unknown.any():
        depth = patches.points[unknown] @ frame[2]
        low, high = np.percentile(depth, (2.0, 98.0))
        cosine[unknown] = 0.85 * np.clip((depth - low) / max(high - low, 1e-12), 0.0, 1.0)
    brightness = (SHADOW + (1.0 - SHADOW) * cosine)[:, None]
    highlight = np.clip(cosine - 0.9, 0.0, 0.1)[:, None]
    return np.asarray(np.clip(colours * brightness + highlight, 0.0, 1.0))
