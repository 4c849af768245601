"""Two clouds painted into axes: one frame, one scale, whatever is shown of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.drawing.oblique import Patches, bounds, viewing_frame
from hmrf_icp.drawing.painter import paint
from hmrf_icp.figures.pair import Pair
from hmrf_icp.figures.style import Lengths, inked, scale_bar
from hmrf_icp.se3 import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POINTS_DRAWN = 40_000
"""About so many points of each cloud are drawn."""

FINER = 1.5
"""Painted pixels a pixel of the figure, so that a figure that is enlarged stays sharp."""


@dataclass(frozen=True, eq=False)
class View:
    """From where a pair is looked at, and what of it is drawn.

    Attributes
    ----------
    moving, staying
        The source's patches in its own frame, and the target's.
    kept, stayed
        Rows of these points among the observed ones of their clouds.
    frame
        (3, 3) right, up, towards who looks.
    """

    moving: Patches
    staying: Patches
    kept: NDArray[np.intp]
    stayed: NDArray[np.intp]
    frame: Array

    @classmethod
    def of(cls, pair: Pair, most: int = POINTS_DRAWN) -> View:
        """Look at a pair as it ended."""
        source, target = pair.clouds
        moving, kept = Patches.of(source, most)
        staying, stayed = Patches.of(target, most)
        rows = [
            np.cumsum(cloud.observed.ravel())[flat] - 1
            for cloud, flat in ((source, kept), (target, stayed))
        ]
        frame = viewing_frame(source, target, pair.pose)
        return cls(moving, staying, rows[0], rows[1], frame)

    def limits(self, poses: Sequence[Array], aspect: float, target: bool = True) -> Array:
        """Find limits that hold the source under all of the poses, and the target."""
        clouds = [self.moving.moved(pose).points for pose in poses]
        return bounds(
            [*clouds, self.staying.points] if target else clouds, self.frame, aspect=aspect
        )


def show(
    ax: Axes,
    layers: Sequence[tuple[Patches, Array]],
    frame: Array,
    limits: Array,
    lengths: Lengths,
) -> None:
    """Paint layers of patches and colours into axes, with a bar for the scale."""
    width = max(int(FINER * box_of(ax)[0]), 160)
    span = limits[:, 1] - limits[:, 0]
    image = paint(layers, frame, limits, (width, max(int(width * span[1] / span[0]), 1)))
    left, right, low, high = limits.ravel().tolist()
    extent = left, right, low, high
    ax.imshow(image, extent=extent, interpolation="antialiased", aspect="equal")
    ax.set_xticks([])
    ax.set_yticks([])
    inked(ax)
    for spine in ax.spines.values():
        spine.set_alpha(0.5)
    scale_bar(ax, lengths)


def box_of(ax: Axes) -> tuple[float, float]:
    """Width and height of axes, pixels, as they are laid out now."""
    locator: Any = ax.get_axes_locator()
    box = ax.get_position() if locator is None else locator(ax, None)
    size = box.transformed(ax.figure.transSubfigure)
    return float(size.width), float(size.height)
