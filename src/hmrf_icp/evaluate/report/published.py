"""What the paper says: the maxima in its text, and its released rows where a user has them.

Stechschulte and Heckman, *Hidden Markov Random Field Iterative Closest Point*
(2017), section Results; the rows of 2019 belong to the follow-up at ICRA.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.errors import InputError
from hmrf_icp.evaluate.plain import plain
from hmrf_icp.io.files import reading

PAPER_ANGLE = math.pi / 30
"""Rotation of the starts in the paper's plots, radians."""

PAPER_ORDER = ("all", "percent", "sigma", "x84", "dynamic", "hmrf")
"""The paper's six, in the order of its legends."""

COLUMN_PREFIXES = {
    "all": "all",
    "pct": "percent",
    "sigma": "sigma",
    "x84": "x84",
    "dynamic": "dynamic",
    "hmrf": "hmrf",
    "goicp": "Go-ICP",
    "s4pcs": "Super4PCS",
}
"""How the released files call the methods, and how a report does."""


@dataclass(frozen=True)
class Maximum:
    """Largest error of HMRF-ICP that the paper reports for a range of overlap.

    Attributes
    ----------
    sequence
        ``shark`` or ``desk``.
    regime
        The range in words.
    low, high
        Overlap at least ``low`` and below ``high``.
    metres, radians
        The two maxima, each over all frames and axes of the range.
    """

    sequence: str
    regime: str
    low: float
    high: float
    metres: float
    radians: float


ABOVE_ALL = 1.01
"""An upper bound of overlap that an overlap of exactly 1 is below."""

PUBLISHED_MAXIMA = (
    Maximum("shark", "60 % or more", 0.6, ABOVE_ALL, 0.017, 0.0776),
    Maximum("shark", "all (35 % or more)", 0.35, ABOVE_ALL, 0.036, 0.196),
    Maximum("desk", "50 % or more", 0.5, ABOVE_ALL, 0.077, 0.109),
    Maximum("desk", "20 % or more", 0.2, ABOVE_ALL, 0.386, 0.317),
    Maximum("desk", "below 20 %", 0.0, 0.2, 1.55, 1.97),
)


@dataclass(frozen=True, eq=False)
class PaperRows:
    """Rows that the authors released.

    Attributes
    ----------
    name
        The file's name without its suffix, in characters that anchors and files may have.
    overlap
        (N,) in [0, 1].
    angle
        (N,) rotation of the start, radians; None where the file does not say.
    metres, radians, seconds
        Method to (N,) errors and times, NaN where that run failed.
    """

    name: str
    overlap: NDArray[np.float64]
    angle: NDArray[np.float64] | None
    metres: Mapping[str, NDArray[np.float64]]
    radians: Mapping[str, NDArray[np.float64]]
    seconds: Mapping[str, NDArray[np.float64]]

    @property
    def methods(self) -> tuple[str, ...]:
        """Methods in the order of the file."""
        return tuple(self.metres)

    def started_at(self, angle: float) -> NDArray[np.bool_]:
        """Rows whose start was turned by ``angle``; all rows of a file that does not say."""
        if self.angle is None:
            return np.ones(self.overlap.size, dtype=np.bool_)
        mask: NDArray[np.bool_] = np.isclose(self.angle, angle, rtol=0.0, atol=1e-4)
        return mask


def read_paper_rows(path: Path) -> PaperRows:
    """Read a released file of rows, in any of its three layouts.

    The layouts differ in what names a row (``frame`` and ``angle``, two
    frames, or a data set and two frames) and in the methods; a method is there
    when it has a column ``..._t_err`` in metres and ``..._r_err`` in radians.

    Raises
    ------
    InputError
        Not such a file.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file; expected a file of the paper's result rows (CSV)")
    with reading(path, "rows"), path.open(encoding="utf-8", newline="") as stream:
        reader = csv.DictReader(stream, skipinitialspace=True)
        header = [name.strip() for name in reader.fieldnames or ()]
        reader.fieldnames = header
        rows = list(reader)
    prefixes = [name.removesuffix("_t_err") for name in header if name.endswith("_t_err")]
    if "overlap" not in header or not prefixes:
        raise InputError(
            f"{path}: expected columns overlap and, a method, NAME_time, NAME_t_err and "
            f"NAME_r_err; found {', '.join(header) or 'nothing'}"
        )
    if not rows:
        raise InputError(f"{path}: a header and no rows")

    def named(suffix: str) -> dict[str, NDArray[np.float64]]:
        return {
            COLUMN_PREFIXES.get(prefix, prefix): _column(path, rows, f"{prefix}_{suffix}")
            for prefix in prefixes
        }

    return PaperRows(
        name=re.sub(r"[^\w.-]+", "-", plain(path.stem)),
        overlap=_column(path, rows, "overlap"),
        angle=_column(path, rows, "angle") if "angle" in header else None,
        metres=named("t_err"),
        radians=named("r_err"),
        seconds=named("time"),
    )


def _column(path: Path, rows: Sequence[Mapping[str, str | None]], name: str) -> NDArray[np.float64]:
    values = []
    for number, row in enumerate(rows, start=2):
        word = row.get(name)
        try:
            values.append(float(word if word is not None else ""))
        except ValueError:
            found = "nothing" if word is None else repr(word)
            raise InputError(
                f"{path}, line {number}: {name} is {found}, expected a number or NaN"
            ) from None
    return np.array(values, dtype=np.float64)
