"""How figures look on any ground, what stands over them, and how a wrong result looks wrong."""

from __future__ import annotations

from dataclasses import dataclass
from textwrap import wrap
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from hmrf_icp.drawing import palette
from hmrf_icp.errors import InputError
from hmrf_icp.result import RegistrationResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 150

BANNER = "not-believed"
"""What the parts of the banner are called (``gid``), in figures of results not to be believed."""

BANNER_HEIGHT = 17.0
"""Points, 1/72 inch."""

Names = tuple[str, str]
"""What source and target are called on a figure."""


@dataclass(frozen=True)
class Lengths:
    """Lengths as text. Metres are assumed; where that is not so, nothing is claimed.

    Attributes
    ----------
    unit
        ``"m"``, metres: short ones are told in millimetres. None: "units", as they come.
    """

    unit: str | None = "m"

    def __post_init__(self) -> None:
        """Refuse what is not known.

        Raises
        ------
        InputError
            Another unit.
        """
        if self.unit not in ("m", None):
            raise InputError(
                f'unit: expected "m" or None (not known), got {self.unit!r}; scale the clouds '
                "to metres, or leave the unit open"
            )

    def text(self, value: float) -> str:
        """Say a length, with three digits at the most."""
        if self.unit is None:
            return f"{value:.3g} units"
        return f"{1000.0 * value:.3g} mm" if abs(value) < 0.1 else f"{value:.3g} m"

    @property
    def short(self) -> tuple[float, str]:
        """Factor and name for small lengths: millimetres, or units."""
        return (1.0, "units") if self.unit is None else (1000.0, "mm")

    @property
    def plain(self) -> str:
        """Name of the unit that the numbers are in."""
        return "units" if self.unit is None else "m"


TITLE = 10.0
"""Size of a title's letters, points."""

LETTER = 0.58
"""Width of a letter, of its size."""

SMALLER = 0.83
"""Of the size are the letters of a title that takes two lines."""


def own_figure(width: float, height: float) -> Figure:
    """Return an empty figure without a ground, inches, that no pyplot knows of."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=DPI, facecolor="none")
    FigureCanvasAgg(figure)
    return figure


def above(result: RegistrationResult) -> float:
    """Room that the title wants, and the banner where there is one, inches."""
    return 0.6 if result.believed else 0.65 + BANNER_HEIGHT / 72.0


def axes_or_new(
    ax: Axes | None,
    width: float,
    height: float,
    room: tuple[float, float, float] | None = None,
) -> Axes:
    """Return the axes given, or those of a new figure of pyplot's.

    Parameters
    ----------
    ax
        Axes, or None.
    width, height
        Of the new figure, inches.
    room
        Beside, below and above its axes, inches; None leaves it to matplotlib's layout, which
        comes last: a picture that is painted to fit wants to know its place before.
    """
    if ax is not None:
        return ax
    from matplotlib import pyplot

    if room is None:
        return pyplot.subplots(figsize=(width, height), layout="constrained")[1]
    beside, below, over = room
    box = beside / width, below / height, 1 - 2 * beside / width, 1 - (below + over) / height
    return pyplot.figure(figsize=(width, height)).add_axes(box)


def ink(ax: Axes) -> str:
    """Choose the colour of lines and letters for the ground that the axes stand on.

    In a figure without a ground the axes get none either.
    """
    figure: Any = ax.figure
    grounds = [figure.get_facecolor()]
    while figure.figure is not figure:  # a part of a figure
        figure = figure.figure
        grounds.append(figure.get_facecolor())
    if grounds[-1][3] == 0.0:
        ax.set_facecolor("none")
    for red, green, blue, alpha in (ax.get_facecolor(), *grounds):
        if alpha > 0.5:
            light = 0.2126 * red + 0.7152 * green + 0.0722 * blue > 0.4
            return palette.DARK_INK if light else palette.LIGHT_INK
    return palette.MIDDLE_INK


def inked(ax: Axes) -> str:
    """Draw frame, ticks and labels of the axes in the ink of their ground, and return it."""
    colour = ink(ax)
    for spine in ax.spines.values():
        spine.set_color(colour)
        spine.set_linewidth(0.6)
    ax.tick_params(colors=colour, which="both")
    for label in (ax.xaxis.label, ax.yaxis.label):
        label.set_color(colour)
    return colour


def entitled(
    ax: Axes,
    result: RegistrationResult,
    what: str,
    names: Names | None = None,
    method: str | None = None,
    title: str | None = None,
) -> None:
    """Put a title over the axes: what is shown, of what, and how far to believe it.

    Parameters
    ----------
    ax
        The axes.
    result
        What is shown.
    what
        In a few words.
    names, method
        What the clouds and the method are called; None leaves them out.
    title
        One of the caller's own instead, such as for a panel of a larger figure that says it
        all once; an empty one for none. Then no banner is drawn either.
    """
    colour = ink(ax)
    if title is not None:
        ax.set_title(title, loc="left", fontsize="medium", fontweight="bold", color=colour)
        return
    pad = 6.0 if result.believed else 10.0 + BANNER_HEIGHT
    words, size = fitting(headline(what, names, method), 72.0 * inches(ax), TITLE)
    ax.set_title(
        f"{words}\n{result.verdict}",
        loc="left",
        fontsize=size,
        color=colour,
        pad=pad,
        parse_math=False,
    )
    if not result.believed:
        banner(ax, result)


def headline(what: str, names: Names | None, method: str | None) -> str:
    """Say what is shown, of which clouds, found by which method."""
    words = [what]
    if names is not None:
        words.append(f"{names[0]} to {names[1]}")
    if method is not None:
        words.append(f"by {method}")
    return ", ".join(words)


def inches(ax: Axes) -> float:
    """Width of axes as they are laid out now."""
    figure: Any = ax.figure
    return float(ax.get_window_extent().width / figure.dpi)


def fitting(words: str, wide: float, size: float) -> tuple[str, float]:
    """Break a headline that is too long for its width into two lines of smaller letters.

    ``wide`` and ``size`` are in points, as the size that comes back. What two lines do not hold
    is left out, and an ellipsis says so.
    """
    if len(words) * LETTER * size <= wide:
        return words, size
    size *= SMALLER
    most = max(20, int(wide / (LETTER * size)))
    return "\n".join(wrap(words, most, max_lines=2, placeholder=" …")), size


def warning(result: RegistrationResult) -> str:
    """Say why a result is not to be believed, in the room that a banner has."""
    if result.confidence is None:
        return "NOT BELIEVED: did not converge"
    return f"NOT BELIEVED: confidence {result.confidence:.2f}"


def banner(ax: Axes, result: RegistrationResult) -> None:
    """Frame the axes in the colour of what cannot be, under a hatched banner that says so."""
    from matplotlib.patches import Rectangle
    from matplotlib.transforms import ScaledTranslation, blended_transform_factory

    ax.add_patch(
        Rectangle(
            (0.0, 0.0),
            1.0,
            1.0,
            transform=ax.transAxes,
            fill=False,
            edgecolor=palette.VIOLATED,
            linewidth=3.0,
            clip_on=False,
            zorder=20,
            gid=BANNER,
        )
    )
    figure = ax.figure
    above = figure.dpi_scale_trans + ScaledTranslation(0.0, 1.0, cast("Any", ax.transAxes))
    place = blended_transform_factory(ax.transAxes, above)
    low, high = 3.0 / 72.0, (3.0 + BANNER_HEIGHT) / 72.0
    ax.add_patch(
        Rectangle(
            (0.0, low),
            1.0,
            high - low,
            transform=place,
            facecolor="none",
            edgecolor=palette.VIOLATED,
            hatch="/////",
            linewidth=1.0,
            clip_on=False,
            zorder=20,
            gid=BANNER,
        )
    )
    ax.text(
        0.5,
        (low + high) / 2.0,
        warning(result),
        transform=place,
        ha="center",
        va="center_baseline",
        color="white",
        fontweight="bold",
        fontsize=9.0,
        bbox={"facecolor": palette.VIOLATED, "edgecolor": "none", "pad": 2.5},
        zorder=21,
        gid=BANNER,
    )


def scale_bar(ax: Axes, lengths: Lengths) -> None:
    """Draw a bar of a round length, about a fifth of the width, in the lower left corner."""
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    width, height, colour = right - left, high - low, ink(ax)
    about = 0.2 * width
    decade = 10.0 ** np.floor(np.log10(about))
    length = float(max(f * decade for f in (1.0, 2.0, 5.0) if f * decade <= about))
    start, base = left + 0.03 * width, low + 0.04 * height
    ax.plot([start, start + length], [base, base], color=colour, linewidth=2.5, zorder=4)
    ax.text(
        start + length / 2.0,
        base + 0.015 * height,
        lengths.text(length),
        ha="center",
        va="bottom",
        fontsize=8,
        color=colour,
        zorder=4,
    )


def legend(ax: Axes, entries: list[tuple[str, str]], below: float = -0.01) -> None:
    """Put a legend of colours and their meaning under the axes, in shares of their height."""
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], marker="o", linestyle="", markersize=7, color=colour, label=label)
        for colour, label in entries
    ]
    ax.legend(
        handles=handles,
        loc="upper center",
        bbox_to_anchor=(0.5, below),
        ncols=len(entries),
        frameon=False,
        fontsize=8.5,
        labelcolor=ink(ax),
        handletextpad=0.3,
        columnspacing=1.6,
        borderaxespad=0.2,
    )
