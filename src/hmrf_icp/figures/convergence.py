"""What the loop learnt from iteration to iteration, and how large its steps were."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hmrf_icp.drawing import palette
from hmrf_icp.errors import InputError
from hmrf_icp.figures.style import Lengths, Names, axes_or_new, entitled, inches, ink, inked
from hmrf_icp.result import RegistrationResult, count

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARKERS = "ov^sDP*X"

IN, OUT = ("inlier", "_in"), ("outlier", "_out")
"""What the names of parameters hold that are the inliers' and the outliers'."""

NO_LENGTH = ("beta", "share", "shape", "log", "degree", "freedom", "iteration")
"""What those hold that are no lengths, and are not drawn among them."""


NARROW = 3.5
"""Inches below which the legend is set tightly."""


def convergence(
    result: RegistrationResult,
    ax: Axes | None = None,
    *,
    names: Names | None = None,
    method: str | None = None,
    unit: str | None = "m",
    title: str | None = None,
) -> Axes:
    """Draw the lengths that the loop learnt, its steps and the share of inliers over iterations.

    Lengths on a logarithmic scale on the left, the share of inliers on the right. Of a search,
    the iterations that led to the pose returned.

    Parameters
    ----------
    result
        What came out.
    ax
        Axes to draw in; None for a new figure of pyplot's.
    names, method, unit, title
        As for :func:`hmrf_icp.plot.before_after`.

    Returns
    -------
    The axes of the lengths.

    Raises
    ------
    InputError
        The result has no iterations.
    """
    from matplotlib.ticker import MaxNLocator

    if not result.history:
        raise InputError("result: there are no iterations to draw, its history is empty")
    lengths = Lengths(unit)
    factor, name = lengths.short
    ax = axes_or_new(ax, 6.4, 4.4)
    colour = inked(ax)
    history = result.history
    steps = [iteration.iteration for iteration in history]
    curves = {
        parameter: [one.parameters.get(parameter, float("nan")) for one in history]
        for parameter in history[-1].parameters
        if not any(part in parameter for part in NO_LENGTH)
    }
    for k, (parameter, values) in enumerate(curves.items()):
        ax.plot(
            steps,
            [factor * value if value > 0.0 else float("nan") for value in values],
            marker=MARKERS[k % len(MARKERS)],
            markersize=4,
            linewidth=1.6,
            color=_colour(parameter, colour),
            markeredgecolor=colour,
            markeredgewidth=0.4,
            label=parameter,
        )
    for label, values, line in (
        ("RMSE of the inliers", [one.inlier_rmse for one in history], "-"),
        ("step", [one.step_translation for one in history], ":"),
    ):
        shown = [factor * value if value > 0.0 else float("nan") for value in values]
        ax.plot(steps, shown, line, color=colour, linewidth=1.2, label=label)
    ax.set_yscale("log")
    ax.set_xlabel("iteration")
    ax.set_ylabel(name)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.spines["top"].set_visible(False)
    _share(ax, steps, [one.inlier_share for one in history])
    low, high = ax.get_ylim()
    ax.set_ylim(low * (low / high) ** 0.35, high)  # room for the legend
    small = inches(ax) < NARROW
    ax.legend(
        frameon=False,
        fontsize=6.5 if small else 7.5,
        labelcolor=colour,
        loc="lower left",
        ncols=2,
        handlelength=1.2 if small else 2.0,
        columnspacing=1.0 if small else 2.0,
    )
    state = "Converged" if result.converged else "Not converged"
    entitled(ax, result, f"{state} after {count(len(history), 'iteration')}", names, method, title)
    return ax


def _share(ax: Axes, steps: list[int], share: list[float]) -> None:
    """Draw the share of inliers against an axis of its own on the right."""
    right = ax.twinx()
    inked(right)
    right.plot(steps, share, "--", color=palette.INLIER, linewidth=1.6)
    right.set_ylim(0.0, 1.0)
    right.set_ylabel("share of inliers (dashed)", color=ink(ax))
    right.spines["top"].set_visible(False)
    right.patch.set_visible(False)


def _colour(parameter: str, other: str) -> str:
    """Colour of a parameter, by whose it is."""
    if any(part in parameter for part in IN):
        return palette.INLIER
    return palette.OUTLIER if any(part in parameter for part in OUT) else other
