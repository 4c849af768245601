"""Clouds drawn as lit surfaces from an oblique viewpoint, far points first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.se3 import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LIGHT = np.array([-0.35, 0.65, 0.70])
"""Direction to the lamp in the picture's axes: right, up, towards who looks."""

SHADOW = 0.45
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


def bounds(clouds: Sequence[Array], frame: Array, margin: float = 0.03) -> Array:
    """Find the picture's limits ((left, right), (low, high)), metres, from points (M, 3) each.

    All but a few stray points are inside.
    """
    flat = np.concatenate(clouds) @ frame[:2].T
    low, high = np.percentile(flat, (0.02, 99.98), axis=0)
    room = margin * (high - low).max() + 1e-12
    return np.stack([low - room, high + room], axis=1)


def draw(
    axes: Axes,
    layers: Sequence[tuple[Patches, Array]],
    frame: Array,
    limits: Array,
) -> None:
    """Draw patches in orthographic projection, with a bar for the scale.

    Parameters
    ----------
    axes
        Empty ones; their place in the figure must be final, it gives the size of a patch.
    layers
        Patches and their colours (M, 3), RGB in [0, 1], as they are or from ``lit``.
    frame
        As from ``viewing_frame``.
    limits
        As from ``bounds``.
    """
    points = np.concatenate([patches.points for patches, _ in layers]) @ frame.T
    spacing = np.concatenate([patches.spacing for patches, _ in layers])
    colours = np.concatenate([colour for _, colour in layers])
    within = ((points[:, :2] >= limits[:, 0]) & (points[:, :2] <= limits[:, 1])).all(axis=1)
    order = np.flatnonzero(within)[np.argsort(points[within, 2], kind="stable")]

    box = axes.get_position()
    inches = np.array([box.width, box.height]) * axes.figure.bbox.size / axes.figure.dpi
    span = limits[:, 1] - limits[:, 0]
    grow = (inches / inches.min()) / (span / span[np.argmin(inches)])
    span = span * np.maximum(grow / grow.min(), 1.0)  # one metre is as long up as across
    middle = limits.mean(axis=1)
    axes.set_xlim(middle[0] - span[0] / 2, middle[0] + span[0] / 2)
    axes.set_ylim(middle[1] - span[1] / 2, middle[1] + span[1] / 2)
    per_metre = 72.0 * inches[0] / span[0]
    diameter = np.maximum(1.35 * spacing[order] * per_metre, 0.7)
    axes.scatter(
        points[order, 0],
        points[order, 1],
        s=diameter**2,
        c=colours[order],
        marker="o",
        linewidths=0,
        rasterized=True,
    )
    axes.set_xticks([])
    axes.set_yticks([])
    _scale_bar(axes, span)


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


def _scale_bar(axes: Axes, span: Array) -> None:
    """Bar of a round length, about a fifth of the width, in the lower left corner."""
    about = 0.2 * float(span[0])
    decade = 10.0 ** np.floor(np.log10(about))
    length = float(max(f * decade for f in (1.0, 2.0, 5.0) if f * decade <= about))
    left, low = axes.get_xlim()[0] + 0.03 * span[0], axes.get_ylim()[0] + 0.04 * span[1]
    axes.plot([left, left + length], [low, low], color="#222222", linewidth=2.5)
    text = f"{length:g} m" if length >= 0.1 else f"{1000 * length:g} mm"
    axes.text(
        left + length / 2,
        low + 0.012 * span[1],
        text,
        ha="center",
        va="bottom",
        fontsize=8,
        color="#222222",
    )
