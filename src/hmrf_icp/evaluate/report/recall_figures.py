"""Recall by overlap, against how far the start is off, and against time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hmrf_icp.evaluate.report.hindsight import Hindsight
from hmrf_icp.evaluate.report.methods import ReportedMethod, best, family_label
from hmrf_icp.evaluate.report.recall_tables import Slice, recall
from hmrf_icp.evaluate.report.runs import ReportedStart
from hmrf_icp.evaluate.report.statistics import DECILES, Share, median
from hmrf_icp.evaluate.report.study import Study
from hmrf_icp.evaluate.report.style import (
    ORACLE_LOOK,
    Drawing,
    Look,
    drawing_style,
    looks,
    recall_axis,
    sheet,
    shown,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def recall_by_overlap(study: Study) -> Drawing:
    """Recall by decile of overlap: own methods on the left, peers on the right, a start a row."""
    has_both = bool(study.roster.own) and bool(study.roster.peers)
    with drawing_style():
        figure, grid = sheet(len(study.starts), 2 if has_both else 1, 5.2, 3.3)
        for row, start in zip(grid, study.starts, strict=True):
            if study.roster.own:
                _by_overlap(row[0], study, start, list(study.roster.own))
                row[0].set_title(f"This package, {start.short}")
            if study.roster.peers:
                _peers_by_overlap(row[-1], study, start)
                row[-1].set_title(f"Peers, {start.short}")
            for axes in row:
                # The own methods are the same in every row; a peer's best threshold is not.
                if axes is row[-1] or start == study.starts[0]:
                    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        return Drawing.of(
            figure,
            "recall-by-overlap",
            "Recall by decile of overlap, with 95 % intervals after "
            "Wilson; points are moved sideways a little so that the intervals can be told apart."
            + (
                " Of each peer the threshold that solves most from that start is shown; the dotted "
                "line is the oracle, any peer at any threshold."
                if study.roster.peers
                else ""
            ),
            "Line plots of recall against overlap, one row a start. "
            f"{_low_and_high(study, study.headline)} All values are in the tables of recall by "
            "overlap.",
        )


def recall_by_start(study: Study) -> Drawing:
    """Recall over all overlaps against the perturbation of the start."""
    chosen = [*study.roster.own]
    chosen += [best(study.runs, members, study.success) for members in _families(study)]
    style = looks(study.roster.methods)
    with drawing_style():
        figure, grid = sheet(1, 1, 8.0, 4.0)
        axes = grid[0][0]
        places = np.arange(len(study.starts), dtype=np.float64)
        for number, method in enumerate(chosen):
            shares = [recall(study, method, Slice(start)) for start in study.starts]
            moved = places + _aside(number, len(chosen), 0.24)
            _line(axes, moved, shares, style[method.name], method.label)
        if study.hindsights:
            shares = [_oracle_from(study, start) for start in study.starts]
            _line(axes, places, shares, ORACLE_LOOK, "oracle of the peers", interval=False)
        axes.set_xticks(places, [start.label for start in study.starts])
        axes.set_xlim(-0.5, len(study.starts) - 0.5)
        axes.set_xlabel("Start: rotation about the centroid (radians), and translation")
        axes.set_title("Recall over all overlaps")
        recall_axis(axes)
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        return Drawing.of(
            figure,
            "recall-by-start",
            "Recall over all overlaps against how far the start is from the true pose, with 95 % "
            "intervals after Wilson. Of each peer the threshold that solves most over all starts "
            "is shown.",
            "Line plot of recall against the perturbation of the start. "
            + " ".join(
                f"{study.headline.label} at {start.label}: "
                f"{_words(recall(study, study.headline, Slice(start)))}."
                for start in study.starts
            ),
        )


def time_against_recall(study: Study) -> Drawing:
    """Median time against recall, a panel a start; a peer's thresholds are joined by a line."""
    from matplotlib.ticker import LogLocator, NullLocator

    style = looks(study.roster.methods)
    columns = min(3, len(study.starts))
    rows = -(-len(study.starts) // columns)
    with drawing_style():
        figure, grid = sheet(rows, columns, 4.2 if columns > 1 else 6.0, 3.8)
        panels = [axes for row in grid for axes in row]
        for axes, start in zip(panels, study.starts, strict=False):
            groups = [(m,) for m in study.roster.own] + _families(study)
            for members in groups:
                _times(axes, study, start, members, style[members[0].name])
            axes.set_xscale("log")
            axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes.xaxis.set_minor_locator(NullLocator())
            axes.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
            axes.set_xlabel("Median time a run (seconds)")
            axes.set_title(start.short.capitalize())
            recall_axis(axes)
        used = panels[: len(study.starts)]
        low, high = zip(*(axes.get_xlim() for axes in used), strict=True)
        for axes in used:
            axes.set_xlim(min(low), max(high))
        for axes in panels[len(study.starts) :]:
            axes.set_axis_off()
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4 if columns > 1 else 3)
        return Drawing.of(
            figure,
            "time-against-recall",
            "Recall against the median time of a run, all overlaps together: up and to the left is "
            "better. The settings of one peer are joined; small figures are the smallest and the "
            "largest threshold in metres. Times hold for the machine, and the number of workers "
            "beside each other, that the evaluation was run with.",
            "Scatter plot of recall against median time in seconds, one panel a start. The values "
            "are in the tables of recall and of iterations and time.",
        )


def _by_overlap(
    axes: Axes, study: Study, start: ReportedStart, methods: list[ReportedMethod]
) -> None:
    style = looks(study.roster.methods)
    for number, method in enumerate(methods):
        shares = [recall(study, method, Slice(start, d)) for d in range(DECILES)]
        moved = _middles() + _aside(number, len(methods), 0.032)
        _line(axes, moved, shares, style[method.name], method.label)
    axes.set_xlim(0.0, 1.0)
    axes.set_xticks(np.arange(0.0, 1.01, 0.1))
    axes.set_xlabel("Overlap")
    recall_axis(axes)


def _peers_by_overlap(axes: Axes, study: Study, start: ReportedStart) -> None:
    begun = study.runs.where(study.runs.begun_at(start))
    chosen = [best(begun, members, study.success) for members in _families(study)]
    if study.roster.own:
        chosen.append(study.headline)
    _by_overlap(axes, study, start, chosen)
    hindsight = study.hindsight(start)
    if hindsight is not None:
        shares = _oracle_by_decile(study, hindsight, start)
        _line(axes, _middles(), shares, ORACLE_LOOK, "oracle", interval=False)


def _oracle_from(study: Study, start: ReportedStart) -> Share:
    hindsight = study.hindsight(start)
    assert hindsight is not None
    oracle = hindsight.oracle(study.runs, study.success)
    return oracle.share(oracle.problems.begun_at(start))


def _oracle_by_decile(study: Study, hindsight: Hindsight, start: ReportedStart) -> list[Share]:
    oracle = hindsight.oracle(study.runs, study.success)
    return [oracle.share(Slice(start, d).of(oracle.problems)) for d in range(DECILES)]


def _line(
    axes: Axes,
    x: np.ndarray,
    shares: list[Share],
    look: Look,
    label: str,
    interval: bool = True,
) -> None:
    there = [i for i, share in enumerate(shares) if share.value is not None]
    if not there:
        return
    values = [shares[i].value or 0.0 for i in there]
    places = [float(x[i]) for i in there]
    axes.plot(places, values, label=shown(label), **look.arguments())
    if interval:
        low, high = zip(*(shares[i].interval for i in there), strict=True)
        axes.vlines(places, low, high, color=look.colour, linewidth=0.8, alpha=0.45)


def _times(
    axes: Axes, study: Study, start: ReportedStart, members: tuple[ReportedMethod, ...], look: Look
) -> None:
    points = []
    for method in members:
        mask = study.runs.begun_at(start) & study.runs.of(method.name)
        seconds = median(study.runs["seconds"][mask])
        share = recall(study, method, Slice(start))
        if seconds is not None and seconds > 0 and share.value is not None:
            points.append((seconds, share.value, method))
    if not points:
        return
    x, y, methods = zip(*points, strict=True)
    arguments = {**look.arguments(), "linewidth": 0.8, "markersize": 7.0, "alpha": 0.9}
    axes.plot(x, y, label=shown(family_label(members[0].family)), **arguments)
    for place in (0, -1) if len(points) > 1 else ():
        if methods[place].threshold is not None:
            axes.annotate(
                f"{methods[place].threshold:g}",
                (x[place], y[place]),
                textcoords="offset points",
                xytext=(5, 4),
                fontsize=7,
                color=look.colour,
            )


def _families(study: Study) -> list[tuple[ReportedMethod, ...]]:
    return list(study.roster.families.values())


def _middles() -> np.ndarray:
    return (np.arange(DECILES) + 0.5) / DECILES


def _aside(number: int, count: int, width: float) -> float:
    return width * ((number + 0.5) / count - 0.5) * 2


def _words(share: Share) -> str:
    return "not run" if share.value is None else f"{share.value:.2f}"


def _low_and_high(study: Study, method: ReportedMethod) -> str:
    words = []
    for start in study.starts:
        low = study.runs.begun_at(start) & study.runs.of(method.name)
        below = Share.of(study.solved[low & (study.runs["overlap"] < 0.2)])
        above = Share.of(study.solved[low & (study.runs["overlap"] >= 0.2)])
        words.append(
            f"{method.label}, {start.short}: {_words(below)} below 0.2 of overlap, "
            f"{_words(above)} from there up."
        )
    return " ".join(words)
