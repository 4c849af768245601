"""The paper's four panels: errors, iterations and time against overlap."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.evaluate.report.methods import ReportedMethod
from hmrf_icp.evaluate.report.runs import ReportedStart
from hmrf_icp.evaluate.report.study import Study
from hmrf_icp.evaluate.report.style import PAPER_COLOURS, Drawing, drawing_style, sheet, shown

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PANELS = (
    ("error_m", "Translation error", "Error (metres)"),
    ("error_rad", "Rotation error", "Error (radians)"),
    ("iterations", "ICP iterations", "Iterations"),
    ("seconds", "Elapsed time", "Elapsed time (seconds)"),
)
OVERLAP_JITTER = 0.02
ITERATION_JITTER = 0.4
"""Widths of the paper's jitter, which pgfplots draws from [0, width)."""

BEYOND = 0.995
"""An axis ends at this quantile, so that one run that flew off does not flatten all others."""

PRESET_MARKS = (("#ff8c00", "^"), ("#8b4513", "s"), ("#6a0dad", "D"), ("#708090", "v"))


def paper_panels(study: Study, start: ReportedStart) -> Drawing:
    """Draw the four panels for one start, with the paper's colours for its six methods."""
    methods = study.roster.own or study.roster.methods
    runs = study.runs.where(study.runs.begun_at(start))
    with drawing_style():
        figure, grid = sheet(2, 2, 5.0, 3.4)
        for (column, title, unit), axes in zip(PANELS, [*grid[0], *grid[1]], strict=True):
            # One generator a panel: a method more or less moves no other method's points.
            for number, method in enumerate(methods):
                jitter = np.random.default_rng((number, len(column)))
                mask = runs.of(method.name)
                overlap, value = runs["overlap"][mask], runs[column][mask]
                overlap = overlap + OVERLAP_JITTER * jitter.random(overlap.size)
                if column == "iterations":
                    value = value + ITERATION_JITTER * jitter.random(value.size)
                _dots(axes, method, methods, overlap, value)
            shown = runs[column][np.isin(runs["method"], [method.name for method in methods])]
            _limit(axes, shown)
            axes.set_title(f"{study.dataset} — {title}", fontweight="normal")
            axes.set_xlabel("Overlap")
            axes.set_ylabel(unit)
            axes.set_xlim(-0.02, 1.04)
        grid[0][1].legend(
            loc="upper right", markerscale=2.0, frameon=True, framealpha=0.85, handletextpad=0.2
        )
        return Drawing.of(
            figure,
            f"paper-panels-{start.slug}",
            f"The paper's four panels, {start.begun}: one mark a run, "
            "with the paper's jitter in overlap (and in iterations) and its colours.",
            "Four scatter plots against overlap: translation error in metres, rotation error in "
            "radians, ICP iterations and elapsed time in seconds, of "
            + ", ".join(method.label for method in methods)
            + ". The medians are in the tables of accuracy and of iterations and time.",
        )


def _dots(
    axes: Axes,
    method: ReportedMethod,
    methods: tuple[ReportedMethod, ...],
    overlap: NDArray[np.float64],
    value: NDArray[np.float64],
) -> None:
    if method.name == "hmrf":
        axes.scatter(
            overlap,
            value,
            s=14,
            facecolors="none",
            edgecolors="black",
            linewidths=0.7,
            label=shown(method.label),
            rasterized=True,
            zorder=3,
        )
        return
    if method.name in PAPER_COLOURS:
        colour, marker, size = PAPER_COLOURS[method.name], "o", 3.5
    else:
        others = [other for other in methods if other.name not in PAPER_COLOURS]
        colour, marker = PRESET_MARKS[others.index(method) % len(PRESET_MARKS)]
        size = 12.0
    axes.scatter(
        overlap,
        value,
        s=size,
        c=colour,
        marker=marker,
        linewidths=0,
        label=shown(method.label),
        rasterized=True,
        zorder=2 if method.name in PAPER_COLOURS else 4,
    )


def _limit(axes: Axes, values: NDArray[np.float64]) -> None:
    finite = values[np.isfinite(values)]
    if not finite.size:
        return
    end = 1.08 * float(np.quantile(finite, BEYOND))
    if end <= 0 or float(finite.max()) <= 1.5 * end:
        axes.set_ylim(bottom=min(0.0, float(finite.min())))
        return
    axes.set_ylim(0.0, end)
    outside = int(np.count_nonzero(finite > end))
    axes.text(
        0.01,
        0.98,
        f"{outside} of {finite.size} runs lie above, up to {float(finite.max()):.3g}",
        transform=axes.transAxes,
        va="top",
        fontsize=7.5,
        color="#555555",
    )
