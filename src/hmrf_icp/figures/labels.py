"""Who has a counterpart: the source's points coloured by it, and the field as an image."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np

from hmrf_icp.clouds.cloud import PointCloudLike
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.drawing import palette
from hmrf_icp.drawing.oblique import lit
from hmrf_icp.errors import InputError
from hmrf_icp.figures.pair import Pair
from hmrf_icp.figures.style import Lengths, Names, above, axes_or_new, entitled, ink, inked
from hmrf_icp.figures.view import View, box_of, show
from hmrf_icp.result import RegistrationResult
from hmrf_icp.se3 import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize


def labels(
    result: RegistrationResult,
    source: PreparedCloud | PointCloudLike | None = None,
    target: PreparedCloud | PointCloudLike | None = None,
    ax: Axes | None = None,
    *,
    names: Names | None = None,
    method: str | None = None,
    unit: str | None = "m",
    title: str | None = None,
) -> Axes:
    """Draw the source where it ended, each point by its probability of being an inlier.

    Parameters
    ----------
    result, source, target, names, method, unit, title
        As for :func:`hmrf_icp.plot.before_after`.
    ax
        Axes to draw in; None for a new figure of pyplot's.

    Returns
    -------
    The axes.

    Raises
    ------
    InputError
        The result holds no clouds and none are given, or is of others.
    """
    pair, lengths = Pair.of(result, source, target), Lengths(unit)
    ax = axes_or_new(ax, 6.4, 5.4, (0.1, 0.65, above(result)))
    view = View.of(pair)
    moved = view.moving.moved(pair.pose)
    width, height = box_of(ax)
    limits = view.limits([pair.pose], width / max(height, 1.0), target=False)
    probability = result.correspondences.matched.probability
    colours = palette.between(probability[view.kept])
    show(ax, [(moved, lit(moved, colours, view.frame))], view.frame, limits, lengths)
    colour_bar(ax, label_scale(), "probability of being an inlier")
    entitled(ax, result, f"Inliers, {result.fitness:.0%} of the points", names, method, title)
    return ax


def field(
    result: RegistrationResult,
    ax: Axes | None = None,
    *,
    names: Names | None = None,
    method: str | None = None,
    title: str | None = None,
) -> Axes:
    """Draw the field as an image: the probability of being an inlier at each pixel of the source.

    Parameters
    ----------
    result
        Of a source that is organised like an image.
    ax
        Axes to draw in; None for a new figure of pyplot's.
    names, method, title
        As for :func:`hmrf_icp.plot.before_after`.

    Returns
    -------
    The axes.

    Raises
    ------
    InputError
        The source is not organised; :func:`hmrf_icp.plot.labels` draws any.
    """
    if len(result.correspondences.shape) != 2:
        raise InputError(
            f"result: its source is a list of points, of shape {result.correspondences.shape}, and "
            "no image; plot.labels draws it"
        )
    ax = axes_or_new(ax, 6.0, 5.0)
    image_of(ax, result.inlier_probability, label_scale())
    colour_bar(ax, label_scale(), "probability of being an inlier; hatched: unobserved")
    entitled(ax, result, f"Field, {result.fitness:.0%} inliers", names, method, title)
    return ax


def image_of(ax: Axes, values: Array, scale: ScalarMappable) -> None:
    """Draw one value a pixel (H, W); NaN is hatched."""
    colour = inked(ax)
    ax.patch.set_hatch("//////")
    ax.patch.set_edgecolor(colour)
    ax.patch.set_linewidth(0.0)
    ax.imshow(
        np.ma.masked_invalid(values),
        cmap=scale.cmap,
        norm=cast("Normalize", scale.norm),
        interpolation="nearest",
        aspect="equal",
    )
    ax.set_xticks([])
    ax.set_yticks([])


def label_scale() -> ScalarMappable:
    """Colours of probabilities from 0 to 1, those of outliers and inliers at the ends."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    cmap = ListedColormap(palette.between(np.linspace(0.0, 1.0, 256)))
    return ScalarMappable(Normalize(0.0, 1.0), cmap.with_extremes(bad=(0.0, 0.0, 0.0, 0.0)))


def colour_bar(ax: Axes, scale: ScalarMappable, label: str, extend: str = "neither") -> Any:
    """Put a colour bar under axes, without taking room from them."""
    place = ax.inset_axes((0.15, -0.075, 0.7, 0.03))
    bar = ax.figure.colorbar(scale, cax=place, orientation="horizontal", extend=extend)
    bar.outline.set_visible(False)
    colour = ink(ax)
    place.tick_params(labelsize=8, length=2, colors=colour)
    bar.set_label(label, fontsize=8, color=colour, labelpad=1.0)
    return bar
