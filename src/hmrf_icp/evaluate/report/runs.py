"""The rows of ``results.csv`` as columns, with what a report asks of them."""

from __future__ import annotations

import csv
import math
import sys
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.errors import InputError
from hmrf_icp.evaluate.plain import plain
from hmrf_icp.evaluate.progress import Progress, silent
from hmrf_icp.evaluate.protocol import NONE
from hmrf_icp.evaluate.report.statistics import decile
from hmrf_icp.io.files import reading
from hmrf_icp.lazy import cached_property

Mask: TypeAlias = NDArray[np.bool_]

TEXT = ("pair", "target", "source", "axis", "method", "failure")
NUMBERS = (
    "overlap",
    "angle",
    "translation",
    "error_m",
    "error_rad",
    "right",
    "iterations",
    "em_iterations",
    "seconds",
    "converged",
    "confidence",
    "fitness",
)
LINES_AT_ONCE = 10_000
"""Lines read from one word about the progress to the next."""

HIGHEST = {"overlap": 1.0, "angle": math.inf, "translation": math.inf, "seconds": math.inf}
"""The largest that a column may hold; none of them, nor an error, is below zero."""

REQUIRED = ("overlap", "angle", "method", "error_m", "error_rad", "iterations", "seconds")


class Success(NamedTuple):
    """When a run counts as solved: both errors at most these."""

    metres: float = 0.05
    radians: float = 0.05

    def __str__(self) -> str:
        return f"{self.metres:g} m and {self.radians:g} rad"


NO_START = "without a start"


class ReportedStart(NamedTuple):
    """How far from the true pose a run began: a rotation in radians, a translation in metres.

    An infinite rotation stands for no start.
    """

    angle: float
    translation: float

    @property
    def given(self) -> bool:
        """Whether there was one."""
        return self.angle != math.inf

    @property
    def begun(self) -> str:
        """Within a sentence: ``started π/30 from the true pose``, ``without a start``."""
        return f"started {self.label} from the true pose" if self.given else NO_START

    @property
    def short(self) -> str:
        """In a heading: ``started π/30 off``, ``without a start``."""
        return f"started {self.label} off" if self.given else NO_START

    @property
    def begins(self) -> str:
        """At the head of a sentence: ``From π/30``, ``Without a start``."""
        return f"From {self.label}" if self.given else NO_START.capitalize()

    @property
    def label(self) -> str:
        """For people: ``π/30``, ``π/6 + 0.3 m``, ``true pose``, ``none``."""
        if not self.given:
            return NONE
        if self.angle == 0 and self.translation == 0:
            return "true pose"
        if self.translation == 0:
            return angle_label(self.angle)
        return f"{angle_label(self.angle)} + {self.translation:g} m"

    @property
    def slug(self) -> str:
        """For file names: ``pi-30``, ``pi-6-0.3m``, ``none``."""
        if not self.given:
            return NONE
        angle = angle_label(self.angle).replace("π", "pi").replace("/", "-").replace(" ", "")
        return angle if self.translation == 0 else f"{angle}-{self.translation:g}m"


def angle_label(angle: float) -> str:
    """Write an angle as the fraction of π that it is, or in radians where it is none."""
    share = Fraction(angle / math.pi).limit_denominator(60)
    if angle <= 0 or not math.isclose(float(share) * math.pi, angle, rel_tol=1e-4):
        return f"{angle:.3g} rad"
    numerator = "π" if share.numerator == 1 else f"{share.numerator}π"
    return numerator if share.denominator == 1 else f"{numerator}/{share.denominator}"


@dataclass(frozen=True, eq=False)
class Runs:
    """Runs as columns of equal length.

    Attributes
    ----------
    text
        Columns of words: pair, target, source, axis, method, failure. Empty
        strings where the file has no such column.
    numbers
        Columns of numbers: overlap, angle (rad), translation (m), error_m,
        error_rad, right (0 or 1), iterations, em_iterations, seconds, converged (0
        or 1), confidence, fitness. NaN where a row has none: a method that failed has
        no error.
    line
        Line of the file that each run stands on.
    """

    text: Mapping[str, NDArray[np.str_]]
    numbers: Mapping[str, NDArray[np.float64]]
    line: NDArray[np.intp]

    def __len__(self) -> int:
        return int(self.line.size)

    def __getitem__(self, column: str) -> NDArray[Any]:
        """One column by its name in the file."""
        return self.text[column] if column in self.text else self.numbers[column]

    def where(self, keep: NDArray[Any]) -> Runs:
        """Return the runs under a mask or at some indices."""
        return Runs(
            {name: column[keep] for name, column in self.text.items()},
            {name: column[keep] for name, column in self.numbers.items()},
            self.line[keep],
        )

    @cached_property
    def starts(self) -> tuple[ReportedStart, ...]:
        """The different starts, the smallest rotation first."""
        both = {*zip(self["angle"].tolist(), self["translation"].tolist(), strict=True)}
        return tuple(ReportedStart(*start) for start in sorted(both))

    def begun_at(self, start: ReportedStart) -> Mask:
        """Mask the runs from one start."""
        mask: Mask = (self["angle"] == start.angle) & (self["translation"] == start.translation)
        return mask

    @cached_property
    def methods(self) -> tuple[str, ...]:
        """Names of the methods, in the order in which they first appear."""
        return tuple(dict.fromkeys(self["method"].tolist()))

    def of(self, method: str) -> Mask:
        """Mask the runs of one method."""
        if method not in self._of:
            self._of[method] = self["method"] == method
        return self._of[method]

    @cached_property
    def _of(self) -> dict[str, Mask]:
        """Masks by method: every table and figure asks for all of them."""
        return {}

    def solved(self, success: Success) -> Mask:
        """Mask the runs that succeeded; a run without a pose did not.

        What the pair's own criterion says goes first, both thresholds hold where there is none.
        """
        mask: Mask = (self["error_m"] <= success.metres) & (self["error_rad"] <= success.radians)
        right = self["right"]
        return np.asarray(np.where(np.isfinite(right), right == 1, mask))

    @cached_property
    def failed(self) -> Mask:
        """Runs that gave no pose at all."""
        mask: Mask = ~(np.isfinite(self["error_m"]) & np.isfinite(self["error_rad"]))
        return mask

    @cached_property
    def decile(self) -> NDArray[np.intp]:
        """Decile of overlap of each run, 0 to 9."""
        return decile(self["overlap"])

    @cached_property
    def problem(self) -> NDArray[np.intp]:
        """Number of the problem that each run tried: same pair, same start, same axis."""
        keys = zip(
            self["pair"].tolist(),
            self["angle"].tolist(),
            self["translation"].tolist(),
            self["axis"].tolist(),
            strict=True,
        )
        numbers: dict[tuple[Any, ...], int] = {}
        return np.array([numbers.setdefault(key, len(numbers)) for key in keys], dtype=np.intp)


def read_results(path: Path, report: Progress = silent) -> Runs:
    """Read ``results.csv``.

    A last line that a killed evaluation left half-written is left out, as the
    evaluation does when it goes on.

    Parameters
    ----------
    path
        The file.
    report
        Told how many of its bytes are read.

    Raises
    ------
    InputError
        The file is missing or empty, lacks a column, holds no number where one is needed, or
        one out of its range; the message names the line.
    """
    if not path.is_file():
        raise InputError(
            f"{path}: no such file; expected the results.csv that `hmrf-icp evaluate` writes "
            "(give the folder that was its --output)"
        )
    with reading(path, "results"), path.open(encoding="utf-8", newline="") as stream:
        reader = csv.reader(_whole_lines(stream, path, report))
        header = [name.strip() for name in next(reader, [])]
        if not header:
            raise InputError(f"{path}: empty; run `hmrf-icp evaluate` again")
        missing = [name for name in REQUIRED if name not in header]
        if missing:
            raise InputError(
                f"{path}: no column {', '.join(missing)}; expected at least "
                f"{', '.join(REQUIRED)}, found {', '.join(header)}"
            )
        return _columns(path, header, reader)


def _whole_lines(stream: Iterable[str], path: Path, report: Progress) -> Iterator[str]:
    """Yield the lines that have an end."""
    stage, size, read = f"Reading {path.name}", path.stat().st_size, 0
    for number, line in enumerate(stream):
        if number % LINES_AT_ONCE == 0:
            report(stage, read, size)
        read += len(line)
        if line.endswith("\n"):
            yield line


def _columns(path: Path, header: Sequence[str], rows: Iterator[list[str]]) -> Runs:
    """Sort the cells into columns as they are read: a row at a time is in memory as text."""
    place = {name: index for index, name in enumerate(header)}
    text: dict[str, list[str]] = {name: [] for name in TEXT if name in place}
    numbers = {name: array("d") for name in NUMBERS if name in place}
    lines = array("q")
    for line, row in enumerate(rows, 2):
        if not row:
            continue
        if len(row) != len(header):
            raise InputError(
                f"{path}, line {line}: {len(row)} values, the header has {len(header)}"
            )
        lines.append(line)
        for name, words in text.items():
            words.append(sys.intern(plain(row[place[name]])))
        for name, values in numbers.items():
            word = row[place[name]]
            try:
                values.append(math.inf if word == NONE and name == "angle" else _number(word))
            except ValueError:
                raise InputError(
                    f"{path}, line {line}: {name} is {word!r}, expected a number"
                ) from None
    if not lines:
        raise InputError(f"{path}: a header and no runs; run `hmrf-icp evaluate` again")
    return _checked(path, text, numbers, np.array(lines, dtype=np.intp))


def _checked(
    path: Path,
    text: Mapping[str, Sequence[str]],
    numbers: Mapping[str, Sequence[float]],
    lines: NDArray[np.intp],
) -> Runs:
    """Fill in the columns that the file has not got, and refuse rows that say too little."""
    words = {
        name: np.array(text[name]) if name in text else np.full(lines.size, "") for name in TEXT
    }
    absent = {"translation": 0.0}
    values = {
        name: np.array(numbers[name], dtype=np.float64)
        if name in numbers
        else np.full(lines.size, absent.get(name, math.nan))
        for name in NUMBERS
    }
    for name in ("overlap", "angle", "translation"):
        bad = np.flatnonzero(np.isnan(values[name]))
        if bad.size:
            raise InputError(f"{path}, line {lines[bad[0]]}: no {name}")
    for name in (*HIGHEST, "error_m", "error_rad"):
        high = HIGHEST.get(name, math.inf)
        bad = np.flatnonzero((values[name] < 0) | (values[name] > high))
        if bad.size:
            expected = "0 or more" if high == math.inf else f"0 to {high:g}"
            found = f"{name} is {values[name][bad[0]]:g}, expected {expected}"
            raise InputError(f"{path}, line {lines[bad[0]]}: {found}")
    nameless = np.flatnonzero(words["method"] == "")
    if nameless.size:
        raise InputError(f"{path}, line {lines[nameless[0]]}: no method")
    if not words["pair"].any():
        words["pair"] = np.char.add(np.char.add(words["target"], "-"), words["source"])
    return Runs(words, values, lines)


def _number(word: str) -> float:
    word = word.strip()
    if word in ("True", "False"):
        return float(word == "True")
    number = float(word) if word else math.nan
    return number if math.isfinite(number) else math.nan
