"""A picture of the distances: their histogram, and the two distributions fitted to it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmrf_icp.field import mixture
from hmrf_icp.field.mixture import Mixture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

BINS = 80
CURVE = 600

INLIER, OUTLIER, BOTH, BARS = "#1f4fa3", "#d8503f", "#222222", "#d5d5d5"
"""Blue for inliers and red for outliers, as in the paper's figure."""


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
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    y = np.asarray(distance, dtype=np.float64)
    y = mixture.checked(y[~np.isnan(y)])
    fitted = mixture.choose(y) if fitted is None else fitted

    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    most = float(np.quantile(y, 0.995)) or 1.0
    _draw(left, y, np.linspace(0.0, most, BINS + 1), fitted, logarithmic=False)
    positive = y[y > 0.0]
    if positive.size:
        low, high = float(np.quantile(positive, 0.002)), float(positive.max())
        edges = np.geomspace(0.5 * low, max(high, 1.01 * low), BINS + 1)
        _draw(right, y, edges, fitted, logarithmic=True)
    else:
        right.set_axis_off()
    left.legend(frameon=False, fontsize=8)
    if title is not None:
        figure.suptitle(title, fontsize=10)
    return figure


def _draw(axes: Axes, y: Array, edges: Array, fitted: Mixture, logarithmic: bool) -> None:
    """Draw histogram and components; with ``logarithmic``, densities per decade."""
    count, _ = np.histogram(y, bins=edges)
    width = np.diff(np.log10(edges) if logarithmic else edges)
    axes.stairs(count / (y.size * width), edges, fill=True, color=BARS, label="distances")
    points = edges[0] + (edges[-1] - edges[0]) * (np.arange(CURVE) + 0.5) / CURVE
    if logarithmic:
        points = np.geomspace(edges[0], edges[-1], CURVE)
    per = points * np.log(10.0) if logarithmic else np.ones_like(points)
    for component, share, colour, kind in (
        (fitted.inlier, fitted.share, INLIER, "inliers"),
        (fitted.outlier, 1.0 - fitted.share, OUTLIER, "outliers"),
    ):
        label = f"{share:.0%} {kind}, {component.name}"
        density = share * np.exp(component.log_density(points)) * per
        axes.plot(points, density, color=colour, linewidth=1.6, label=label)
    axes.plot(points, np.exp(fitted.log_density(points)) * per, color=BOTH, linewidth=1.0)
    odds = fitted.log_odds(points) > 0.0
    for i in np.flatnonzero(odds[:-1] != odds[1:]):
        axes.axvline(float(points[i]), color=BOTH, linewidth=0.8, linestyle="--")
    # A pole at zero distance, or an inlier scale far below a bin, would hide all else.
    highest = float((count / (y.size * width)).max())
    axes.set_ylim(0.0, 1.25 * highest if highest > 0.0 else 1.0)
    axes.set_xlim(float(edges[0]), float(edges[-1]))
    if logarithmic:
        axes.set_xscale("log")
    axes.set_xlabel("distance to the closest target point, m")
    axes.set_ylabel("density, per decade" if logarithmic else "density, 1/m")
    axes.spines[["top", "right"]].set_visible(False)
