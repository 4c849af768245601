"""Both clouds before and after, in one view at one scale, and close up where little moved."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmrf_icp import se3
from hmrf_icp.clouds.cloud import PointCloudLike
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.drawing import palette
from hmrf_icp.drawing.oblique import lit
from hmrf_icp.figures.pair import Pair
from hmrf_icp.figures.section import draw_section, find_section
from hmrf_icp.figures.style import (
    Lengths,
    Names,
    above,
    axes_or_new,
    entitled,
    ink,
    legend,
)
from hmrf_icp.figures.view import View, box_of, show
from hmrf_icp.result import RegistrationResult
from hmrf_icp.se3 import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SMALL = 0.06
"""Motion, as a share of the picture's width, below which a close-up is shown as well."""

CLOSE = 0.15
"""Half the height of a close-up, as a share of the picture's width, at the most."""

CONTRADICTING = 0.002
"""Share of the points in space that was seen to be empty from which they are in the legend."""


def before_after(
    result: RegistrationResult,
    source: PreparedCloud | PointCloudLike | None = None,
    target: PreparedCloud | PointCloudLike | None = None,
    ax: Axes | None = None,
    *,
    init: ArrayLike | None = None,
    names: Names | None = None,
    method: str | None = None,
    unit: str | None = "m",
    title: str | None = None,
) -> Axes:
    """Draw both clouds before and after the registration.

    Source and target in their colours, from one place and at one scale. In the picture after,
    source points that stand where the target's sensor saw nothing are marked, and arrows
    show the directions of which the surfaces tell nothing. Where the motion is small a slice
    through both clouds shows it close up, before and after.

    Parameters
    ----------
    result
        What came out.
    source, target
        The clouds; None for those that the result holds (a copy of it holds none).
    ax
        Axes to draw in, divided into panels; None for a new figure of pyplot's.
    init
        (4, 4) the start that was given to ``register``; None for the identity.
    names, method
        What the clouds and the method are called in the title.
    unit
        ``"m"``, or None where the unit of the clouds is not known.
    title
        In place of the one that says what is shown and how far to believe it.

    Returns
    -------
    The axes; the panels are its ``child_axes``.

    Raises
    ------
    InputError
        The result holds no clouds and none are given, or is of others; the start is not rigid.
    """
    pair, lengths = Pair.of(result, source, target), Lengths(unit)
    start = pair.between(se3.as_rigid(init))
    ax = axes_or_new(ax, 9.5, 4.6, (0.1, 0.35, above(result)))
    ax.set_axis_off()
    view = View.of(pair)

    inlier = result.correspondences.matched.probability > 0.5
    limits = view.limits([start, pair.pose], 1.0)
    small = _motion(pair, start) < SMALL * (limits[0, 1] - limits[0, 0])
    close = [ax.inset_axes((0.77, y, 0.22, 0.40)) for y in (0.505, 0.02)] if small else []
    section = None
    if small:
        width, height = box_of(close[0])
        most = CLOSE * float(limits[0, 1] - limits[0, 0])
        section = find_section(pair, start, inlier, width / max(height, 1.0), most)
        if section is None:
            for panel in close:
                panel.remove()
    wide = 0.48 if section is None else 0.365
    panels = [ax.inset_axes((x, 0.02, wide, 0.885)) for x in (0.01, 0.025 + wide)]
    width, height = box_of(panels[0])
    limits = view.limits([start, pair.pose], width / max(height, 1.0))

    target_colour = np.tile(palette.rgb(palette.TARGET), (len(view.staying.points), 1))
    staying = view.staying, lit(view.staying, target_colour, view.frame)
    violated = contradicting(pair)
    entries = [(palette.SOURCE, "source"), (palette.TARGET, "target")]
    for panel, pose, words in zip(panels, (start, pair.pose), ("Before", "After"), strict=True):
        moving = view.moving.moved(pose)
        colours = np.tile(palette.rgb(palette.SOURCE), (len(moving.points), 1))
        if words == "After" and violated is not None and violated.mean() > CONTRADICTING:
            colours[violated[view.kept]] = palette.rgb(palette.VIOLATED)
            entries.append(
                (palette.VIOLATED, f"source where the target saw nothing ({violated.mean():.1%})")
            )
        show(
            panel,
            [staying, (moving, lit(moving, colours, view.frame))],
            view.frame,
            limits,
            lengths,
        )
        panel.set_title(words, loc="left", fontsize=9.5, fontweight="bold", color=ink(ax), pad=3.0)
    if result.degenerate:
        _draw_free(panels[1], result, pair, view.frame, limits)
        entries.append((palette.FREE, "free direction"))
    if section is not None:
        for panel, pose, words in zip(close, (start, pair.pose), ("before", "after"), strict=True):
            draw_section(panel, pair, section, pose, lengths)
            panel.set_title(f"A slice, {words}", loc="left", fontsize=8.5, color=ink(ax), pad=3.0)
    legend(ax, entries)
    entitled(ax, result, "Before and after", names, method, title)
    return ax


def contradicting(pair: Pair) -> NDArray[np.bool_] | None:
    """(M,) Which source points stand in space that the target's sensor saw to be empty.

    None where nobody knows where the sensor stood.
    """
    from hmrf_icp.kernels.range_image import FRONT

    image = pair.target.viewed.range_image
    if image is None:
        return None
    surface = pair.source.surface
    return np.asarray(image.ask(surface.points, surface.normals, pair.pose) == FRONT)


def _motion(pair: Pair, start: Array) -> float:
    """How far the farthest tenth of the source moved, metres."""
    points = pair.source.points
    gap = se3.transform(pair.pose, points) - se3.transform(start, points)
    return float(np.percentile(np.linalg.norm(gap, axis=1), 90.0))


def _draw_free(
    ax: Axes, result: RegistrationResult, pair: Pair, frame: Array, limits: Array
) -> None:
    """Draw an arrow both ways along each direction, or axis, that is free."""
    middle = (result.centre - pair.target.origin) @ frame[:2].T
    reach = 0.25 * float((limits[:, 1] - limits[:, 0]).min())
    for free in result.degenerate:
        way = reach * (frame[:2] @ free.direction)
        foot = middle
        if free.point is not None:
            foot = (free.point - pair.target.origin) @ frame[:2].T
            along = frame[:2] @ free.direction
            foot = foot + along * ((middle - foot) @ along) / max(float(along @ along), 1e-12)
        ax.annotate(
            "",
            foot + way,
            foot - way,
            arrowprops={
                "arrowstyle": "<->",
                "color": palette.FREE,
                "linewidth": 2.5,
                "linestyle": "-" if free.point is None else "--",
            },
            zorder=6,
        )
