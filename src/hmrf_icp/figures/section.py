"""A close-up: a thin slice through both clouds where they lie on each other, seen edge-on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3
from hmrf_icp.drawing import palette
from hmrf_icp.figures.pair import Pair
from hmrf_icp.figures.style import Lengths, inked, scale_bar
from hmrf_icp.se3 import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOTIONS, SPACINGS = 5.0, 12.0
"""Half the height of a close-up: so many motions of the place, or spacings if that is more."""

THICK = 3.0
"""Thickness of the slice, spacings."""

ASKED = 2000
"""Points among which a place is looked for."""

EXAMINED = 40
"""Of these, the places whose slice is looked at."""

MARKED = 60
"""Points of each cloud that a good slice has."""


@dataclass(frozen=True, eq=False)
class Section:
    """A slice: where it is, which way it looks, how much it shows.

    Attributes
    ----------
    centre
        (3,) its middle, in the target's frame.
    axes
        (3, 3) rows: across, up (along the surface's normal), through the slice.
    half
        (2,) half its width and height, metres.
    thickness
        Metres.
    """

    centre: Array
    axes: Array
    half: Array
    thickness: float

    def points(self, points: Array) -> Array:
        """(K, 2) of points (M, 3): those within, in the slice's own axes about its middle."""
        local = (points - self.centre) @ self.axes.T
        within = (np.abs(local[:, :2]) <= self.half).all(axis=1)
        within &= np.abs(local[:, 2]) <= self.thickness / 2.0
        return np.asarray(local[within, :2])


def find_section(
    pair: Pair, before: Array, inlier: NDArray[np.bool_], aspect: float, most: float
) -> Section | None:
    """Find a slice that shows the motion from the pose ``before`` (4, 4) best.

    It lies where an inlier moved far along the normal of its surface, and both clouds have
    points round it. None where there are too few.

    Parameters
    ----------
    pair
        The clouds, as they ended.
    before
        The pose before, between the prepared clouds.
    inlier
        (M,) which of the source's observed points have a counterpart.
    aspect
        Width over height.
    most
        Half its height at the most, metres.
    """
    surface, spacing = pair.source.surface, max(pair.source.surface.spacing, 1e-300)
    spacing = max(spacing, pair.target.surface.spacing)
    rows = np.flatnonzero(inlier & (np.abs(surface.normals).sum(axis=1) > 0.5))
    if len(rows) < MARKED:
        return None
    rows = rows[np.linspace(0, len(rows) - 1, min(ASKED, len(rows))).astype(np.intp)]
    there = se3.transform(pair.pose, surface.points[rows])
    motion = there - se3.transform(before, surface.points[rows])
    normals = surface.normals[rows] @ pair.pose[:3, :3].T
    along = np.abs((motion * normals).sum(axis=1))
    far = float(np.percentile(along, 90.0))
    likely = rows[along >= np.percentile(along, 60.0)]
    likely = likely[np.linspace(0, len(likely) - 1, min(EXAMINED, len(likely))).astype(np.intp)]
    high = min(max(MOTIONS * far, SPACINGS * spacing), most)
    moved = se3.transform(pair.pose, pair.source.points)
    best: tuple[int, Section | None] = (0, None)
    for row in likely:
        normal = pair.pose[:3, :3] @ surface.normals[row]
        across = np.cross(normal, _most_unlike(normal))
        across /= np.linalg.norm(across)
        axes = np.stack([across, normal, np.cross(across, normal)])
        middle = se3.transform(pair.pose, surface.points[row][None])[0]
        section = Section(
            middle,
            axes,
            high * np.array([max(aspect, 1.0), max(1.0 / aspect, 1.0)]),
            THICK * spacing,
        )
        few = min(len(section.points(moved)), len(section.points(pair.target.points)))
        if min(few, MARKED) > best[0]:
            best = min(few, MARKED), section
        if best[0] == MARKED:
            break
    return best[1]


def draw_section(ax: Axes, pair: Pair, section: Section, pose: Array, lengths: Lengths) -> None:
    """Draw the points of a slice with the source under a pose (4, 4)."""
    for points, colour, marker in (
        (pair.target.points, palette.TARGET, "s"),
        (se3.transform(pose, pair.source.points), palette.SOURCE, "o"),
    ):
        x, y = section.points(points).T
        ax.plot(x, y, marker, color=colour, markersize=2.6, markeredgewidth=0.0)
    ax.set_xlim(-section.half[0], section.half[0])
    ax.set_ylim(-section.half[1], section.half[1])
    ax.set_aspect("equal")
    ax.set_xticks([])
    ax.set_yticks([])
    inked(ax)
    scale_bar(ax, lengths)


def _most_unlike(vector: Array) -> Array:
    """Axis (3,) that a vector (3,) has least of."""
    axis = np.zeros(3)
    axis[int(np.argmin(np.abs(vector)))] = 1.0
    return axis
