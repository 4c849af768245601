"""A picture of the distances: their histogram, and the two distributions fitted to it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmrf_icp.drawing import palette
from hmrf_icp.field import mixture
from hmrf_icp.field.mixture import Mixture
from hmrf_icp.figures.style import Lengths, Names, axes_or_new, entitled, inked, own_figure
from hmrf_icp.result import RegistrationResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

BINS = 80
CURVE = 600

BARS = 0.22
"""Opacity of the bars, which are of the ink."""


def residuals(
    result: RegistrationResult,
    ax: Axes | None = None,
    *,
    fitted: Mixture | None = None,
    logarithmic: bool = True,
    names: Names | None = None,
    method: str | None = None,
    unit: str | None = "m",
    title: str | None = None,
) -> Axes:
    """Draw the distances at the end with a mixture of inliers and outliers fitted to them.

    The dashed line is where a point, its neighbours aside, is as likely an inlier as not.

    Parameters
    ----------
    result
        What came out.
    ax
        Axes to draw in; None for a new figure of pyplot's.
    fitted
        The mixture to draw; None fits the pair of distributions with the best BIC.
    logarithmic
        Whether over the logarithm of the distance, where millimetres and metres both show.
    names, method, unit, title
        As for :func:`hmrf_icp.plot.before_after`.

    Returns
    -------
    The axes.

    Raises
    ------
    InputError
        There are no distances.
    """
    y = mixture.checked(result.correspondences.matched.distance)
    ax = axes_or_new(ax, 6.4, 4.4)
    fitted = mixture.choose(y) if fitted is None else fitted
    # Nothing to take a logarithm of: all distances are zero.
    logarithmic = logarithmic and bool((y > 0.0).any())
    _draw(ax, y, edges_for(y, logarithmic), fitted, logarithmic, Lengths(unit).plain)
    ax.legend(frameon=False, fontsize=8, labelcolor=inked(ax), loc="upper left", labelspacing=0.2)
    entitled(ax, result, "Distances at the end", names, method, title)
    return ax


def residual_figure(
    distance: ArrayLike, fitted: Mixture | None = None, title: str | None = None
) -> Figure:
    """Draw the distances of a registration with the mixture that explains them.

    On the left the density over the distance, on the right over its logarithm,
    where distances from millimetres to metres all show. The dashed line is where
    a point, its neighbours aside, is as likely an inlier as not.

    Parameters
    ----------
    distance
        Distances of the source's points to their matches, metres, of any
        shape; NaN is left out (``result.distance`` can be given as it is).
    fitted
        The mixture to draw; None chooses the pair with the best BIC.
    title
        Over the figure.

    Raises
    ------
    InputError
        There are no distances, or some are negative.
    """
    y = np.asarray(distance, dtype=np.float64)
    y = mixture.checked(y[~np.isnan(y)])
    fitted = mixture.choose(y) if fitted is None else fitted

    figure = own_figure(9.0, 3.6)
    figure.set_layout_engine("constrained")
    left, right = figure.subplots(1, 2)
    _draw(left, y, edges_for(y, False), fitted, False, "m")
    if (y > 0.0).any():
        _draw(right, y, edges_for(y, True), fitted, True, "m")
    else:
        right.set_axis_off()
    colour = inked(left)
    left.legend(frameon=False, fontsize=8, labelcolor=colour, loc="upper right")
    if title is not None:
        figure.suptitle(title, fontsize=10, color=colour)
    return figure


def edges_for(y: Array, logarithmic: bool) -> Array:
    """Edges of the bins for distances (M,): all but a few stray ones are inside."""
    if not logarithmic:
        return np.linspace(0.0, float(np.quantile(y, 0.995)) or 1.0, BINS + 1)
    positive = y[y > 0.0]
    low, high = float(np.quantile(positive, 0.002)), float(positive.max())
    return np.geomspace(0.5 * low, max(high, 1.01 * low), BINS + 1)


def _draw(
    axes: Axes, y: Array, edges: Array, fitted: Mixture, logarithmic: bool, unit: str
) -> None:
    """Draw histogram and components; with ``logarithmic``, densities per decade."""
    colour = inked(axes)
    count, _ = np.histogram(y, bins=edges)
    width = np.diff(np.log10(edges) if logarithmic else edges)
    axes.stairs(
        count / (y.size * width), edges, fill=True, color=colour, alpha=BARS, label="distances"
    )
    points = edges[0] + (edges[-1] - edges[0]) * (np.arange(CURVE) + 0.5) / CURVE
    if logarithmic:
        points = np.geomspace(edges[0], edges[-1], CURVE)
    per = points * np.log(10.0) if logarithmic else np.ones_like(points)
    both = np.exp(fitted.log_density(points)) * per
    axes.plot(points, both, color=colour, linewidth=0.8)
    for component, share, tint, kind, line in (
        (fitted.inlier, fitted.share, palette.INLIER, "inliers", "-"),
        (fitted.outlier, 1.0 - fitted.share, palette.OUTLIER, "outliers", (0, (4, 1.5))),
    ):
        label = f"{share:.0%} {kind}, {component.name}"
        density = share * np.exp(component.log_density(points)) * per
        # An edge of ink: light colours are seen on a light ground, and dark ones on a dark.
        axes.plot(points, density, color=colour, linewidth=2.8, linestyle=line)
        axes.plot(points, density, color=tint, linewidth=2.0, linestyle=line, label=label)
    odds = fitted.log_odds(points) > 0.0
    for i in np.flatnonzero(odds[:-1] != odds[1:]):
        axes.axvline(float(points[i]), 0.0, 0.75, color=colour, linewidth=0.8, linestyle="--")
    # A pole at zero distance, or an inlier scale far below a bin, would hide all else. The top
    # quarter is the legend's.
    highest = float((count / (y.size * width)).max())
    axes.set_ylim(0.0, 1.4 * highest if highest > 0.0 else 1.0)
    axes.set_xlim(float(edges[0]), float(edges[-1]))
    if logarithmic:
        axes.set_xscale("log")
    axes.set_xlabel(f"distance to the closest target point, {unit}")
    axes.set_ylabel("density, per decade" if logarithmic else f"density, 1/{unit}")
    axes.spines[["top", "right"]].set_visible(False)
