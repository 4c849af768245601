"""Figures of how well a method's own score foretells its success."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hmrf_icp.evaluate.report.confidence import (
    LOW_OVERLAP,
    Score,
    confident,
    own_score,
    pooled_fitness,
)
from hmrf_icp.evaluate.report.statistics import reliability, roc_curve
from hmrf_icp.evaluate.report.study import Study
from hmrf_icp.evaluate.report.style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    Drawing,
    drawing_style,
    looks,
    sheet,
    shown,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
MARKERS = ("o", "s", "^", "D", "v", "P")
MOST_CURVES = 6


def reliability_figure(study: Study) -> Drawing | None:
    """Share of successes against stated confidence; None where no method states one."""
    given = confident(study)[:MOST_CURVES]
    if not given:
        return None
    with drawing_style():
        figure, grid = sheet(1, 2, 4.6, 4.0)
        left, right = grid[0]
        left.plot(
            [0, 1], [0, 1], color=GREY, linewidth=0.9, linestyle="--", label="as it should be"
        )
        bins = np.linspace(0, 1, 21).tolist()
        words = []
        colours = _colours(study, given)
        for number, (score, colour) in enumerate(zip(given, colours, strict=True)):
            value = np.clip(score.value, 0.0, 1.0)
            result = reliability(value, score.solved)
            marker = MARKERS[number % 6]
            height = [share.solved / share.runs for share in result.shares]
            low, high = zip(*(share.interval for share in result.shares), strict=True)
            left.plot(
                result.confidence, height, color=colour, marker=marker, label=shown(score.label)
            )
            left.vlines(result.confidence, low, high, color=colour, linewidth=0.8, alpha=0.6)
            for solved, line in ((True, "-"), (False, "--")):
                right.hist(
                    value[score.solved == solved],
                    bins=bins,
                    histtype="step",
                    color=colour,
                    linestyle=line,
                    linewidth=1.5,
                    label=shown(f"{score.label}, {'solved' if solved else 'not solved'}"),
                )
            words.append(
                f"{score.label}: calibration error {result.calibration_error:.3f}, Brier score "
                f"{result.brier:.3f}."
            )
        left.set_xlabel("Stated confidence (mean of a bin)")
        left.set_ylabel("Share of runs that succeeded")
        left.set_title("Reliability")
        left.set_xlim(-0.02, 1.02)
        left.set_ylim(-0.03, 1.03)
        left.legend(loc="lower right")
        right.set_xlabel("Stated confidence")
        right.set_ylabel("Runs")
        right.set_yscale("symlog", linthresh=1)
        right.yaxis.set_major_formatter(lambda y, _: f"{y:g}")
        right.yaxis.set_major_formatter(lambda y, _: f"{y:g}")
        right.set_title("Who is given which confidence")
        right.legend(loc="upper center")
        return Drawing.of(
            figure,
            "reliability",
            "Left: of the runs given a confidence, how many succeeded (bins of 0.1, intervals "
            "after Wilson); on the dashed line the confidence can be taken at its word. Right: how "
            "many runs were given which confidence.",
            "Reliability diagram and histogram of confidence. " + " ".join(words),
        )


def roc_figure(study: Study) -> Drawing | None:
    """ROC curves over all overlaps and below 0.2; None where nothing can be told apart."""
    curves = [score for score in _curves(study) if score.area() is not None]
    if not curves:
        return None
    with drawing_style():
        figure, grid = sheet(1, 2, 4.6, 4.4)
        for axes, low_only in zip(grid[0], (False, True), strict=True):
            _roc(axes, curves, _colours(study, curves), low_only)
        grid[0][0].set_title("All overlaps")
        grid[0][1].set_title(f"Overlap below {LOW_OVERLAP:g}")
        words = []
        for score in curves:
            area, low = score.area(), score.area(low_only=True)
            words.append(
                f"{score.label}, {score.column}: area {area:.3f} over all overlaps"
                + ("." if low is None else f", {low:.3f} below {LOW_OVERLAP:g}.")
            )
        return Drawing.of(
            figure,
            "roc",
            "ROC curves of each method's own score, with the area under each: of the runs at or "
            "above a threshold, the share of all successes against the share of all failures. Up "
            "and to the left is better, the diagonal is chance.",
            "ROC curves. " + " ".join(words),
        )


def _curves(study: Study) -> list[Score]:
    """Confidences, the paper's field, and the peers together: more cannot be told apart."""
    chosen = confident(study)
    stated = {score.label for score in chosen}
    for method in study.roster.own:
        if method.label not in stated and (method.kind == "preset" or method.name == "hmrf"):
            score = own_score(study, method)
            chosen += [] if score is None else [score]
    pooled = pooled_fitness(study)
    return chosen[: MOST_CURVES - 1] + ([] if pooled is None else [pooled])


def _colours(study: Study, scores: Sequence[Score]) -> list[str]:
    """Give methods the colours that they have in the other figures, and what is pooled the rest."""
    styles = looks(study.roster.methods)
    own = {method.label: styles[method.name].colour for method in study.roster.own}
    free = [colour for colour in COLOURS if colour not in own.values()]
    return [
        own.get(score.label, free[number % len(free)] if free else GREY)
        for number, score in enumerate(scores)
    ]


def _roc(axes: Axes, curves: list[Score], colours: list[str], low_only: bool) -> None:
    axes.plot([0, 1], [0, 1], color=GREY, linewidth=0.9, linestyle="--")
    for number, (score, colour) in enumerate(zip(curves, colours, strict=True)):
        keep = score.low if low_only else np.ones_like(score.low)
        area = score.area(low_only)
        if area is None:
            continue
        false, true = roc_curve(score.value[keep], score.solved[keep])
        line = "-" if score.column == "confidence" else (0, (5, 1 + number))
        axes.plot(
            false,
            true,
            color=colour,
            linestyle=line,
            label=shown(f"{score.label}, {score.column}: {area:.3f}"),
        )
    if not axes.get_legend_handles_labels()[1]:
        axes.text(0.5, 0.5, "only successes, or only failures", ha="center", color=GREY)
    else:
        axes.legend(loc="lower right")
    axes.set_xlabel("Share of failures at or above the threshold")
    axes.set_ylabel("Share of successes at or above it")
    axes.set_xlim(-0.01, 1.01)
    axes.set_ylim(-0.01, 1.01)
    axes.set_aspect("equal")
