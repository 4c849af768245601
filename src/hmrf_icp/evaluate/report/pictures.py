"""A picture of one run: the two clouds at the start, as the method left them, and as is right."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3
from hmrf_icp.drawing import palette
from hmrf_icp.evaluate.report.style import Drawing, drawing_style, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_POINTS = 6000
"""Points drawn of one cloud: more only blacken the picture."""

FEW_POINTS = 4000
"""Of fewer points each is drawn larger."""

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Scene:
    """What a picture is drawn from.

    Attributes
    ----------
    source, target
        (N, 3) and (M, 3) points, metres, each in its own frame.
    start, end, truth
        (4, 4) source to target; ``end`` None where the run gave no pose.
    from_camera
        Whether the frame is a camera's (z ahead, y down), not a LiDAR's (z up).
    """

    source: Array
    target: Array
    start: Array
    end: Array | None
    truth: Array
    from_camera: bool


def draw_scene(scene: Scene, name: str, about: str, caption: str = "") -> Drawing:
    """Draw both clouds of a run that failed, from two sides, in three columns.

    They are the start, the end, in a frame that says that it is wrong, and the true pose.
    """
    poses = [("Start", scene.start), ("End: missed", scene.end), ("True pose", scene.truth)]
    views = (
        (("from the target's sensor", 0, 1, True), ("from above", 0, 2, False))
        if scene.from_camera
        else (("from above", 0, 1, False), ("from the side", 0, 2, False))
    )
    source, target = _thinned(scene.source), _thinned(scene.target)
    around = np.concatenate(
        [target, se3.transform(scene.truth, source), se3.transform(scene.start, source)]
    )
    low, high = np.quantile(around, (0.005, 0.995), axis=0)
    margin = 0.06 * (high - low)
    low, high = low - margin, high + margin
    ratios = [float((high[b] - low[b]) / (high[a] - low[a])) for _, a, b, _ in views]
    width = 3.3
    with drawing_style():
        figure, grid = sheet(2, 3, width, 0.5 + width * min(1.2, max(0.35, sum(ratios) / 2)))
        for row, (view, a, b, downwards) in zip(grid, views, strict=True):
            for axes, (title, pose) in zip(row, poses, strict=True):
                _cloud(axes, target[:, a], target[:, b], palette.TARGET, "target")
                if pose is not None:
                    moved = se3.transform(pose, source)
                    _cloud(axes, moved[:, a], moved[:, b], palette.SOURCE, "source")
                axes.set_xlim(low[a], high[a])
                axes.set_ylim(*((high[b], low[b]) if downwards else (low[b], high[b])))
                axes.set_aspect("equal")
                axes.grid(visible=False)
                if row is grid[0]:
                    axes.set_title(title, color=palette.MIDDLE_INK)
                _on_any_page(axes)
                if axes is row[1]:
                    _wrong(axes)
                if axes is row[0]:
                    axes.set_ylabel(f"{view} (m)")
                else:
                    axes.tick_params(labelleft=False)
        handles, labels = grid[0][0].get_legend_handles_labels()
        legend = figure.legend(handles, labels, loc="outside lower center", ncols=2, markerscale=8)
        figure.set_facecolor("none")
        for text in legend.get_texts():
            text.set_color(palette.MIDDLE_INK)
        for handle in legend.legend_handles:
            if handle is not None:
                handle.set_alpha(1.0)
        return Drawing.of(
            figure,
            name,
            caption,
            "Two rows of three pictures of the target's points in orange and the source's in blue: "
            f"at the start, at the end, which is framed, and under the true pose. {about}",
        )


def _on_any_page(axes: Axes) -> None:
    """Draw without a ground, in ink that is read on a light page and on a dark one."""
    axes.set_facecolor("none")
    axes.tick_params(colors=palette.MIDDLE_INK)
    for spine in axes.spines.values():
        spine.set_color(palette.MIDDLE_INK)
    for text in (axes.xaxis.label, axes.yaxis.label):
        text.set_color(palette.MIDDLE_INK)


def _wrong(axes: Axes) -> None:
    """Frame what is not where it belongs, in the colour of what cannot be."""
    for spine in axes.spines.values():
        spine.set(visible=True, color=palette.VIOLATED, linewidth=2.5)


def _cloud(axes: Axes, x: Array, y: Array, colour: str, label: str) -> None:
    size = 0.8 * max(1.0, FEW_POINTS / max(len(x), 1))
    axes.scatter(x, y, s=size, c=colour, alpha=0.6, linewidths=0, label=label, rasterized=True)


def _thinned(points: Array) -> Array:
    step = max(1, -(-len(points) // MOST_POINTS))
    return points[::step]
