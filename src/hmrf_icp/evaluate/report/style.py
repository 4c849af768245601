"""How the figures of a report look, and how they are written."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from hmrf_icp.evaluate.report.dark import follows_the_page
from hmrf_icp.evaluate.report.methods import ReportedMethod

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 150

SETTINGS: Any = {
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e3e3e3",
    "grid.linewidth": 0.6,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "lines.linewidth": 1.6,
    "lines.markersize": 5.0,
    # Names of others stand in the figures, and a $ in them is a dollar.
    "text.parse_math": False,
    # The same results give the same bytes.
    "svg.hashsalt": "hmrf-icp",
    "figure.facecolor": "white",
}

# Okabe and Ito's palette, which people with any common colour blindness can tell apart.
BLUE, ORANGE, GREEN = "#0072b2", "#e69f00", "#009e73"
VERMILION, PURPLE, SKY, BLACK = "#d55e00", "#cc79a7", "#56b4e9", "#000000"
GREY = "#767676"

PAPER_COLOURS = {
    "all": "red",
    "percent": "green",
    "sigma": "blue",
    "x84": "cyan",
    "dynamic": "magenta",
    "hmrf": "black",
}
"""The colours of the paper's plots, used in its four panels alone."""


@dataclass(frozen=True)
class Look:
    """Colour, marker and line of a method; colour never alone tells two apart."""

    colour: str
    marker: str
    line: str = "-"
    width: float = 1.5
    hollow: bool = False

    def arguments(self) -> dict[str, Any]:
        """Keyword arguments for a line plot."""
        return {
            "color": self.colour,
            "marker": self.marker,
            "linestyle": self.line,
            "linewidth": self.width,
            "markerfacecolor": "white" if self.hollow else self.colour,
        }


PAPER_LOOKS = {
    "hmrf": Look(BLACK, "o", width=2.0),
    "all": Look(GREY, "X", "--", 1.1, hollow=True),
    "percent": Look(SKY, "^", "--", 1.1, hollow=True),
    "sigma": Look(PURPLE, "s", "--", 1.1, hollow=True),
    "x84": Look(GREEN, "D", "--", 1.1, hollow=True),
    "dynamic": Look(VERMILION, "v", "--", 1.1, hollow=True),
}
PRESET_LOOKS = (
    Look(BLUE, "*", width=2.4),
    Look(VERMILION, "X"),
    Look("#7a4a00", "h"),
    Look("#4b0092", "p"),
    Look("#005f4b", ">"),
)
PEER_LOOKS = (
    Look(ORANGE, "s"),
    Look(GREEN, "^"),
    Look(VERMILION, "D"),
    Look(PURPLE, "v"),
    Look(SKY, "P"),
    Look("#7a4a00", "X"),
    Look(GREY, "h"),
    Look("#4b0092", "p"),
    Look("#a1123f", "<"),
)
ORACLE_LOOK = Look(BLACK, "", ":", 2.0)


def looks(methods: Sequence[ReportedMethod]) -> dict[str, Look]:
    """Give every method its look, the same in all figures; peers share that of their family."""
    chosen: dict[str, Look] = {}
    presets = [method for method in methods if method.kind == "preset"]
    families = list(dict.fromkeys(method.family for method in methods if method.kind == "peer"))
    for method in methods:
        if method.kind == "paper":
            chosen[method.name] = PAPER_LOOKS[method.name]
        elif method.kind == "preset":
            chosen[method.name] = PRESET_LOOKS[presets.index(method) % len(PRESET_LOOKS)]
        else:
            place = families.index(method.family)
            chosen[method.name] = PEER_LOOKS[place % len(PEER_LOOKS)]
    return chosen


@dataclass(frozen=True, eq=False)
class Drawing:
    """A figure with the words that belong to it.

    Attributes
    ----------
    name
        File name without suffix, and anchor in the page.
    caption
        Under the figure.
    alternative
        What a reader who cannot see it is told.
    png, svg
        The two files.
    single
        Whether it is one panel, which needs no more room than a column of text.
    """

    name: str
    caption: str
    alternative: str
    png: bytes
    svg: bytes
    single: bool = False

    @classmethod
    def of(cls, figure: Figure, name: str, caption: str, alternative: str) -> Drawing:
        """Draw a figure in both formats.

        The layout is worked out once, and the canvases are asked directly:
        ``savefig`` would do both again for each format, which is most of its time.
        """
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.backends.backend_svg import FigureCanvasSVG

        engine = figure.get_layout_engine()
        if engine is not None:
            engine.execute(figure)
            figure.set_layout_engine("none")
        png, svg = io.BytesIO(), io.StringIO()
        canvases: tuple[Any, Any] = FigureCanvasAgg(figure), FigureCanvasSVG(figure)
        canvases[0].print_png(png, metadata={"Software": None})
        canvases[1].print_svg(svg, metadata={"Date": None})
        follows = follows_the_page(svg.getvalue()).encode("utf-8")
        single = len(figure.axes) == 1
        return cls(name, caption, alternative, png.getvalue(), follows, single)


@contextmanager
def drawing_style() -> Iterator[None]:
    """Apply the report's settings to what is drawn inside, and to nothing else."""
    import matplotlib

    with matplotlib.rc_context(SETTINGS):
        yield


def sheet(rows: int, columns: int, width: float, height: float) -> tuple[Figure, list[list[Axes]]]:
    """Return an empty figure of panels; sizes in inches, of one panel."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(columns * width, rows * height), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False)
    return figure, [list(row) for row in axes]


def shown(label: str) -> str:
    """Return a label that legends show: they leave out what begins with an underscore."""
    return f" {label}" if label.startswith("_") else label


def recall_axis(axes: Axes) -> None:
    """Label an axis of recall, the whole of [0, 1]."""
    axes.set_ylim(-0.03, 1.03)
    axes.set_ylabel("Recall")
