"""The screen of a film: the clouds large, the field small, words beside, a time line below."""

from __future__ import annotations

import math
from collections.abc import Sequence
from textwrap import wrap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.drawing import palette
from hmrf_icp.figures.shots import Shot
from hmrf_icp.figures.style import Lengths, Names, fitting, headline, scale_bar, warning
from hmrf_icp.result import RegistrationResult
from hmrf_icp.se3 import Array

DPI = 100

STAGE = (0.01, 0.12, 0.66, 0.775)
"""Where the clouds are: left, bottom, width, height."""

COLUMN = 0.69
"""Where the words begin."""

WIDEST = 34
"""Letters of a line that fit beside the clouds."""


class Screen:
    """A figure of matplotlib's whose parts are changed from picture to picture.

    Parameters
    ----------
    size
        Pixels.
    dark
        Whether on a dark ground.
    organised
        Whether there is a field to show as an image.
    candidates
        Whether candidates are shown, whose points have no labels.
    result, names, method, lengths
        What the words are about.
    """

    def __init__(
        self,
        size: tuple[int, int],
        dark: bool,
        organised: bool,
        candidates: bool,
        result: RegistrationResult,
        names: Names | None,
        method: str | None,
        lengths: Lengths,
    ) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        ground = palette.DARK_GROUND if dark else palette.LIGHT_GROUND
        self._ink = palette.LIGHT_INK if dark else palette.DARK_INK
        self._result, self._lengths = result, lengths
        inches = size[0] / DPI, size[1] / DPI
        self._figure = Figure(figsize=inches, dpi=DPI, facecolor=ground)
        self._canvas: Any = FigureCanvasAgg(self._figure)
        # Letters as large as the picture permits, whichever side is short.
        self._letter = 10.5 * min(size[0] / 960.0, size[1] / 540.0)
        self.stage = int(STAGE[2] * size[0]), int(STAGE[3] * size[1])
        """Pixels of the part that shows the clouds."""
        self._stage = self._axes(STAGE)
        self._image: Any = None
        self._map: Any = None
        self._field = self._axes((COLUMN, 0.12, 0.29, 0.36)) if organised else None
        # Bold letters are wider; the first line is as wide as the film.
        wide = 0.9 * size[0] / DPI * 72.0
        words, letter = fitting(headline("Registration", names, method), wide, self._letter)
        self._words(0.012, 0.985, words, "bold", letter / self._letter)
        self._title = self._words(COLUMN, 0.90, "", "bold", 1.2)
        self._text = self._words(COLUMN, 0.83, "", linespacing=1.5)
        self._colours(0.495 if organised else 0.30, candidates)
        self._line = self._axes((0.03, 0.025, 0.94, 0.06))
        self._cursor: Any = None
        self._banner: list[Any] = []

    def scale(self, limits: Array) -> None:
        """Say what part of space the stage shows."""
        self._stage.set_xlim(limits[0])
        self._stage.set_ylim(limits[1])
        scale_bar(self._stage, self._lengths)
        for text in self._stage.texts:
            text.set_fontsize(0.8 * self._letter)

    def timeline(self, places: Sequence[float], end: float) -> None:
        """Draw the time line with a mark for each state that was."""
        axes = self._line
        axes.set_axis_off()
        axes.set_xlim(-0.02 * end, 1.02 * end)
        axes.set_ylim(-1.0, 1.0)
        axes.plot([0.0, end], [0.0, 0.0], color=self._ink, linewidth=0.8, alpha=0.6)
        axes.plot(
            places, np.zeros(len(places)), "|", color=self._ink, markersize=0.8 * self._letter
        )
        (self._cursor,) = axes.plot([0.0], [0.0], "o", markersize=0.8 * self._letter, zorder=5)

    def show(self, picture: NDArray[np.uint8]) -> None:
        """Put the clouds (H, W, 4) on the stage."""
        if self._image is None:
            extent = (*self._stage.get_xlim(), *self._stage.get_ylim())
            self._image = self._stage.imshow(
                picture, extent=extent, aspect="auto", interpolation="nearest", zorder=1
            )
        else:
            self._image.set_data(picture)

    def map(self, image: NDArray[Any]) -> None:
        """Put the field (H, W, 4) beside it."""
        if self._field is None:
            return
        if self._map is None:
            self._map = self._field.imshow(image, interpolation="nearest", aspect="equal")
            self._field.set_anchor("SW")
        else:
            self._map.set_data(image)

    def say(self, shot: Shot, far: str) -> None:
        """Say what is shown, in words and on the time line."""
        result, iteration = self._result, shot.iteration
        title = {
            "start": "Start",
            "candidate": f"Candidate {shot.number} of {shot.of}",
            "between": f"Iteration {shot.number} to {shot.number + 1}"
            if shot.number
            else "Start to iteration 1",
            "iteration": f"Iteration {shot.number} of {shot.of}",
            "result": "Result",
        }[shot.kind]
        lines = []
        if shot.kind == "candidate":
            lines.append("tried, not kept")
        if shot.kind == "between":
            searched = not shot.number and result.confidence is not None
            lines.append("the search; interpolated" if searched else "interpolated")
        if shot.kind == "result":
            lines += [result.verdict.split(", ")[0], *self._confidence()]
        elif shot.probability is not None:
            lines.append(f"{np.mean(shot.probability > 0.5):.0%} inliers")
        if shot.kind == "iteration" and iteration is not None:
            lines.append(
                f"step {self._lengths.text(iteration.step_translation)}, "
                f"{math.degrees(iteration.step_rotation):.2f} deg"
            )
        lines += [far] if far else []
        if shot.kind == "result":
            lines.append(
                f"overlap {result.overlap:.0%}, RMSE {self._lengths.text(result.inlier_rmse)}"
            )
        self._title.set_text(title)
        self._text.set_text("\n".join(part for line in lines for part in wrap(line, WIDEST)))
        self._cursor.set_xdata([shot.place])
        hollow = shot.kind == "between"
        wrong = shot.kind == "result" and not result.believed
        colour = palette.VIOLATED if wrong else self._ink
        self._cursor.set_markeredgecolor(colour)
        self._cursor.set_markerfacecolor("none" if hollow else colour)
        self._warn(wrong)

    def pixels(self) -> NDArray[np.uint8]:
        """Return the picture (H, W, 3) as it is now."""
        self._canvas.draw()
        pixels: NDArray[np.uint8] = np.array(self._canvas.buffer_rgba(), dtype=np.uint8)[..., :3]
        return pixels

    def _confidence(self) -> list[str]:
        confidence = self._result.confidence
        return [] if confidence is None else [f"confidence {confidence:.2f}"]

    def _warn(self, wrong: bool) -> None:
        """Frame the stage and put a banner over it, where the result is not to be believed."""
        from matplotlib.patches import Rectangle

        for part in self._banner:
            part.set_visible(wrong)
        if wrong and not self._banner:
            left, bottom, width, height = STAGE
            common: dict[str, Any] = {
                "transform": self._figure.transFigure,
                "edgecolor": palette.VIOLATED,
                "zorder": 20,
            }
            low, high = bottom + height + 0.006, 0.042
            self._banner = [
                Rectangle((left, bottom), width, height, fill=False, linewidth=3.0, **common),
                Rectangle(
                    (left, low),
                    width,
                    high,
                    facecolor=self._figure.get_facecolor(),
                    hatch="/////",
                    **common,
                ),
            ]
            for part in self._banner:
                self._figure.add_artist(part)
            self._banner.append(
                self._figure.text(
                    left + width / 2.0,
                    low + high / 2.0,
                    warning(self._result),
                    ha="center",
                    va="center_baseline",
                    fontsize=0.9 * self._letter,
                    fontweight="bold",
                    color="white",
                    zorder=21,
                    bbox={"facecolor": palette.VIOLATED, "edgecolor": "none", "pad": 1.5},
                )
            )

    def _axes(self, place: tuple[float, float, float, float]) -> Any:
        axes = self._figure.add_axes(place, facecolor="none")
        axes.set_xticks([])
        axes.set_yticks([])
        for spine in axes.spines.values():
            spine.set_color(self._ink)
            spine.set_alpha(0.4)
            spine.set_linewidth(0.6)
        return axes

    def _words(
        self, x: float, y: float, text: str, weight: str = "normal", scale: float = 1.0, **more: Any
    ) -> Any:
        return self._figure.text(
            x,
            y,
            text,
            va="top",
            color=self._ink,
            fontweight=weight,
            fontsize=scale * self._letter,
            parse_math=False,
            **more,
        )

    def _colours(self, y: float, candidates: bool) -> None:
        """Say what the colours mean."""
        from matplotlib.lines import Line2D

        entries = [
            (palette.TARGET, "target"),
            (palette.INLIER, "source, inlier"),
            (palette.OUTLIER, "source, outlier"),
        ]
        if candidates:
            entries.append((palette.SOURCE, "source, a candidate"))
        self._figure.legend(
            handles=[
                Line2D([], [], marker="o", linestyle="", color=colour, label=label)
                for colour, label in entries
            ],
            loc="lower left",
            bbox_to_anchor=(COLUMN - 0.01, y),
            ncols=1,
            frameon=False,
            labelcolor=self._ink,
            fontsize=0.85 * self._letter,
            handletextpad=0.2,
            labelspacing=0.25,
            borderaxespad=0.0,
        )
