"""A picture of one registration: the clouds before and after, the distances, the inlier field."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from hmrf_icp import presets, se3
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.errors import InputError
from hmrf_icp.figures.oblique import Patches, bounds, draw, lit, viewing_frame
from hmrf_icp.loop.placed import Placed
from hmrf_icp.result import RegistrationResult
from hmrf_icp.se3 import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

    from hmrf_icp.presets import Registrar

DPI = 150
POINTS_DRAWN = 40_000
"""About so many points of each cloud are drawn."""

RED, DARK_BLUE, LIGHT_BLUE = "#d8503f", "#1f4fa3", "#9cc9ee"
"""Target, inliers and outliers of the source: the colours of the paper's figure."""

UNOBSERVED = "#b9c9ae"
TEXT = "#222222"


@dataclass(frozen=True, eq=False)
class InlierField:
    """What EM made of the initial configuration, before the first motion (paper, ex_frame).

    Attributes
    ----------
    distance
        (H, W) or (N,) Y, of each source point to the closest target point, metres.
    first, last
        Expected labels in [-1, 1] after the first EM step, and after
        the last before the first motion.
    steps
        The number of EM steps that led to ``last``.

    All are NaN where the source is unobserved.
    """

    distance: Array
    first: Array
    last: Array
    steps: int


def field_before_first_step(
    source: PointCloud,
    target: PointCloud,
    init: ArrayLike | None = None,
    preset: str | Registrar = presets.DEFAULT,
) -> InlierField:
    """Match and reject in the initial configuration, without moving anything.

    A method that tries more than one start is asked about this one alone.

    Parameters
    ----------
    source, target
        The cloud that moves and the one that stays.
    init
        (4, 4) start, source to target; None for the identity.
    preset
        The method that is used, as for ``register``; it has the parts ``match``
        and ``reject``. A rejection without EM steps decides once: its first
        decision is its last.

    Raises
    ------
    InputError
        The start is not a rigid motion, the preset is unknown, or it cannot do
        with this source.
    """
    prepared = PreparedCloud(source), PreparedCloud(target)
    method: Any = presets.preset(preset) if isinstance(preset, str) else preset
    method = getattr(method, "method", method)  # the loop within, where there is more round it
    placed = Placed.at(se3.as_rigid(init), source.observed_points)
    matches = method.match.prepare(*prepared)(placed)
    last = first = method.reject.prepare(*prepared)(matches, None)
    if hasattr(method.reject, "first_steps") and last.em_iterations > 1:
        first = replace(method.reject, first_steps=1).prepare(*prepared)(matches, None)
    return InlierField(
        source.on_grid(matches.distance),
        source.on_grid(first.z),
        source.on_grid(last.z),
        last.em_iterations,
    )


def registration_figure(
    source: PointCloud,
    target: PointCloud,
    result: RegistrationResult,
    path: str | os.PathLike[str],
    init: ArrayLike | None = None,
    field: InlierField | None = None,
) -> None:
    """Draw what a registration did; the file appears whole or not at all.

    Above, the two clouds before and after in one oblique view: the target in
    red, the source's inliers in dark blue, its outliers in light blue. Below,
    for an organised source, maps in its own image: with ``field`` the initial
    distances and the inlier field at the first and the last EM step before the
    first motion, without it the distances and probabilities at the end. For
    any other source its points, coloured by these.

    Parameters
    ----------
    source, target
        The clouds that were registered, in their own frames.
    result
        What came out.
    path
        PNG, PDF or SVG to write.
    init
        (4, 4) start that was given to ``register``; None for the identity.
    field
        As from ``field_before_first_step``.

    Raises
    ------
    InputError
        The result or the field is not of the source's shape, the start is not
        rigid, or the file cannot be written there.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from hmrf_icp.io.whole import written_whole

    if result.distance.shape != source.shape:
        raise InputError(
            f"result: is of a source of shape {result.distance.shape}, this one has {source.shape}"
        )
    if field is not None and field.distance.shape != source.shape:
        raise InputError(
            f"field: expected the source's shape {source.shape}, got {field.distance.shape}"
        )
    start = se3.as_rigid(init)

    figure = Figure(figsize=(11.0, 7.9), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    _draw_clouds(figure, source, target, result, start)
    if not source.organised:
        _draw_points(figure, source, target, result)
    elif field is None:
        _draw_end(figure, result)
    else:
        _draw_field(figure, field)
    with written_whole(path) as partial:
        figure.savefig(partial, dpi=DPI)


def _axes(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    axes = figure.add_axes((left, bottom, width, height))
    for spine in axes.spines.values():
        spine.set_color("#c8c8c8")
        spine.set_linewidth(0.8)
    return axes


def _title(axes: Axes, text: str, detail: str = "") -> None:
    axes.set_title(text, loc="left", fontsize=10.5, fontweight="bold", color=TEXT, pad=6)
    if detail:
        axes.set_title(detail, loc="right", fontsize=8.5, color="#555555", pad=6)


def _rgb(colour: str, number: int) -> Array:
    from matplotlib.colors import to_rgb

    return np.tile(to_rgb(colour), (number, 1))


def _draw_clouds(
    figure: Figure,
    source: PointCloud,
    target: PointCloud,
    result: RegistrationResult,
    start: Array,
) -> None:
    """Both clouds before and after, and the legend between the rows."""
    staying, _ = Patches.of(target, POINTS_DRAWN)
    moving, kept = Patches.of(source, POINTS_DRAWN)
    before, after = moving.moved(start), moving.moved(result.transformation)
    frame = viewing_frame(source, target, result.transformation)
    limits = bounds([staying.points, before.points, after.points], frame)
    red = _rgb(RED, len(staying.points))
    inlier = result.inlier_probability.ravel()[kept] > 0.5
    blue = np.where(inlier[:, None], _rgb(DARK_BLUE, len(inlier)), _rgb(LIGHT_BLUE, len(inlier)))

    left = _axes(figure, 0.015, 0.49, 0.48, 0.47)
    red = lit(staying, red, frame)
    dark = lit(before, _rgb(DARK_BLUE, len(inlier)), frame)
    draw(left, [(staying, red), (before, dark)], frame, limits)
    _title(left, "Before registration")
    right = _axes(figure, 0.505, 0.49, 0.48, 0.47)
    draw(right, [(staying, red), (after, lit(after, blue, frame))], frame, limits)
    _title(
        right,
        "After registration",
        f"{_verdict(result)}, overlap {result.overlap:.0%}, "
        f"inlier RMSE {_length(result.inlier_rmse)}",
    )
    _legend(
        figure,
        0.472,
        [
            (RED, "target"),
            (DARK_BLUE, "source (after: inliers, P > 1/2)"),
            (LIGHT_BLUE, "source, outliers"),
        ],
    )


def _legend(figure: Figure, top: float, entries: list[tuple[str, str]]) -> None:
    from matplotlib.lines import Line2D

    figure.legend(
        handles=[
            Line2D([], [], marker="o", linestyle="", markersize=7, color=colour, label=label)
            for colour, label in entries
        ],
        loc="upper center",
        bbox_to_anchor=(0.5, top + 0.013),
        ncols=len(entries),
        frameon=False,
        fontsize=9,
        handletextpad=0.3,
        columnspacing=2.0,
    )


@dataclass(frozen=True)
class _Scale:
    """How values become colours; ``ends`` names the two ends of a field of labels."""

    name: str
    low: float
    high: float
    ends: tuple[str, str] | None = None

    def colours(self) -> ScalarMappable:
        """Give the mapping; the darkest eighths of its range at both ends are left out."""
        from matplotlib import colormaps
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import ListedColormap, Normalize

        margin = 0.0 if self.ends is None else 0.125
        chosen = colormaps[self.name](np.linspace(margin, 1.0 - margin, 256))
        cmap = ListedColormap(chosen).with_extremes(bad=UNOBSERVED)
        return ScalarMappable(Normalize(self.low, self.high), cmap)


_LABELS = _Scale("RdBu_r", -1.0, 1.0, ("\u22121 outlier", "inlier +1"))
"""Red for inliers and blue for outliers, as in the paper's figure of the field."""


def _distances(distance: Array) -> _Scale:
    """Scale up to all but the farthest hundredth of the points."""
    return _Scale("viridis", 0.0, max(float(np.nanpercentile(distance, 99.0)), 1e-9))


def _draw_field(figure: Figure, field: InlierField) -> None:
    """Draw the paper's figure ex_frame: Y, z after the first EM step, z after the last."""
    panels = [_axes(figure, 0.015 + 0.33 * k, 0.09, 0.31, 0.315) for k in range(3)]
    _map(figure, panels[0], field.distance, _distances(field.distance))
    _title(panels[0], "Closest target point, at the start")
    for axes, z, step in (
        (panels[1], field.first, f"{min(1, field.steps)}"),
        (panels[2], field.last, f"{field.steps} (last)"),
    ):
        _map(figure, axes, z, _LABELS)
        _title(axes, f"Inlier field, EM step {step}", f"{_inlier_share(z):.0%} inliers")
    _note_unobserved(figure)


def _draw_end(figure: Figure, result: RegistrationResult) -> None:
    """Draw what there is without the field of the start: distances and labels at the end."""
    left, right = (_axes(figure, x, 0.09, 0.36, 0.315) for x in (0.1, 0.54))
    z = 2.0 * result.inlier_probability - 1.0
    _map(figure, left, result.distance, _distances(result.distance))
    _title(left, "Closest target point, at the end")
    _map(figure, right, z, _LABELS)
    _title(right, "Inlier field, at the end", f"{_inlier_share(z):.0%} inliers")
    _note_unobserved(figure)


def _draw_points(
    figure: Figure, source: PointCloud, target: PointCloud, result: RegistrationResult
) -> None:
    """Draw an unorganised source by distance, and by the probability of being an inlier."""
    patches, kept = Patches.of(source, POINTS_DRAWN)
    moved = patches.moved(result.transformation)
    frame = viewing_frame(source, target, result.transformation)
    limits = bounds([moved.points], frame)
    z = 2.0 * result.inlier_probability - 1.0
    left, right = (_axes(figure, x, 0.09, 0.48, 0.315) for x in (0.015, 0.505))
    for axes, values, scale in (
        (left, result.distance, _distances(result.distance)),
        (right, z, _LABELS),
    ):
        shade = scale.colours().to_rgba(values.ravel()[kept])[:, :3]
        draw(axes, [(moved, shade)], frame, limits)
        _bar(figure, axes, scale)
    _title(left, "Closest target point, at the end")
    _title(right, "Inliers, at the end", f"{_inlier_share(z):.0%} inliers")


def _map(figure: Figure, axes: Axes, values: Array, scale: _Scale) -> None:
    """One image of the source, unobserved pixels in green."""
    colours = scale.colours()
    axes.imshow(
        np.ma.masked_invalid(values),
        cmap=colours.cmap,
        vmin=scale.low,
        vmax=scale.high,
        interpolation="nearest",
        aspect="equal",
    )
    axes.set_xticks([])
    axes.set_yticks([])
    _bar(figure, axes, scale)


def _bar(figure: Figure, axes: Axes, scale: _Scale) -> None:
    """Colour bar below the axes."""
    axes.apply_aspect()
    box = axes.get_position()
    place = figure.add_axes((box.x0 + 0.15 * box.width, box.y0 - 0.03, 0.7 * box.width, 0.013))
    bar = figure.colorbar(
        scale.colours(),
        cax=place,
        orientation="horizontal",
        ticks=None if scale.ends is None else [-1, 0, 1],
        extend="max" if scale.ends is None else "neither",
    )
    bar.outline.set_visible(False)
    place.tick_params(labelsize=8, length=2, colors=TEXT)
    if scale.ends is None:
        place.text(1.06, 0.5, "metres", transform=place.transAxes, va="center", fontsize=8)
    else:
        place.set_xticklabels([scale.ends[0], "0", scale.ends[1]])


def _note_unobserved(figure: Figure) -> None:
    from matplotlib.patches import Patch

    figure.legend(
        handles=[Patch(facecolor=UNOBSERVED, edgecolor="none", label="unobserved by the source")],
        loc="lower right",
        bbox_to_anchor=(0.99, 0.0),
        frameon=False,
        fontsize=8,
        handlelength=1.2,
        handleheight=1.0,
    )


def _inlier_share(z: Array) -> float:
    """Share of the observed points with z > 0."""
    return float(np.mean(z[~np.isnan(z)] > 0))


def _verdict(result: RegistrationResult) -> str:
    """Say whether the pose is to be believed, in the room that a title has."""
    if result.confidence is not None:
        words = "confidence" if result.believed else "NOT convincing, confidence"
        return f"{words} {result.confidence:.2f}"
    state = "converged" if result.converged else "not converged"
    return f"{state}, {result.iterations} iterations"


def _length(metres: float) -> str:
    return f"{1000 * metres:.2g} mm" if metres < 0.1 else f"{metres:.2g} m"
