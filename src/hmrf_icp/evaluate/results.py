"""``results.csv``: rows that survive whatever stops the evaluation."""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.errors import InputError
from hmrf_icp.evaluate.plain import cell, plain
from hmrf_icp.evaluate.plan import Plan, Run
from hmrf_icp.evaluate.protocol import Start
from hmrf_icp.io.files import reading
from hmrf_icp.io.whole import written_whole

COLUMNS = (
    "pair",
    "target",
    "source",
    "overlap",
    "angle",
    "translation",
    "axis",
    "method",
    "error_m",
    "error_rad",
    "right",
    "iterations",
    "em_iterations",
    "seconds",
    "converged",
    "confidence",
    "fitness",
    "failure",
)

NUMBERS = (
    "error_m",
    "error_rad",
    "iterations",
    "em_iterations",
    "seconds",
    "confidence",
    "fitness",
)
"""Columns that hold a number or nothing."""

HEADER = (",".join(COLUMNS) + "\n").encode()


@dataclass(frozen=True)
class Row:
    """What came of one run; what a method does not tell is None, an empty cell in the file.

    Parameters
    ----------
    run
        Which.
    error_m, error_rad
        Of the pose, metres and radians; None for a run that gave no pose.
    right
        What the pair's own criterion says; None where the data set has none.
    seconds
        Preparation of the clouds included, compilation and imports not.
    failure
        Why there is no pose; empty where there is one.
    """

    run: Run
    seconds: float
    error_m: float | None = None
    error_rad: float | None = None
    right: bool | None = None
    iterations: int | None = None
    em_iterations: int | None = None
    converged: bool | None = None
    confidence: float | None = None
    fitness: float | None = None
    failure: str = ""

    def cells(self) -> tuple[str, ...]:
        """Return the row as text, in the order of the columns."""
        run = self.run
        return (
            run.pair.name,
            str(run.pair.target),
            str(run.pair.source),
            _short(run.pair.overlap),
            *run.start.cells,
            str(run.axis),
            run.method,
            _short(self.error_m),
            _short(self.error_rad),
            "" if self.right is None else str(self.right),
            "" if self.iterations is None else str(self.iterations),
            "" if self.em_iterations is None else str(self.em_iterations),
            f"{self.seconds:.6f}",
            "" if self.converged is None else str(self.converged),
            _short(self.confidence),
            _short(self.fitness),
            cell(self.failure),
        )


def _short(value: float | None) -> str:
    return "" if value is None or not math.isfinite(value) else f"{value:.9g}"


class Results:
    """The file while an evaluation writes it; use it in a ``with`` block.

    Rows are appended whole and flushed to the disk before the next are begun. A last
    line that a killed process left half-written is cut off on opening, a line that cannot be
    read (a disk or an editor broke it) is taken out, and their runs count as not done.

    Parameters
    ----------
    path
        ``results.csv``; made with its header if it is not there.
    plan
        What its rows may be about.

    Attributes
    ----------
    unreadable
        Number and beginning of the lines that were taken out.

    Raises
    ------
    InputError
        It holds rows that the plan has not got.
    """

    def __init__(self, path: Path, plan: Plan) -> None:
        self.path = path
        self.plan = plan
        self.done = bytearray(len(plan))
        self.count = 0
        self.unreadable: list[tuple[int, str]] = []
        # Appending only, whatever else happens to the file.
        self._stream: BinaryIO = path.open("a+b", buffering=0)
        try:
            self._recover()
        except BaseException:
            self._stream.close()
            raise

    def __enter__(self) -> Results:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._stream.close()

    def _recover(self) -> None:
        """Cut off what was torn, and note which runs are done."""
        end = 0
        with self.path.open("rb") as stream:
            for place, line in enumerate(stream):
                if not line.endswith(b"\n"):
                    break
                if place == 0 and line != HEADER:
                    raise InputError(
                        f"{self.path}: begins with {line[:60].decode(errors='replace').strip()!r}, "
                        f"expected the columns {', '.join(COLUMNS)}; give another --output, or "
                        "--fresh to begin anew"
                    )
                end += len(line)
                number = self._number(line, place + 1) if place > 0 else -1
                if number is None:
                    text = plain(line[:80].decode(errors="replace"))
                    self.unreadable.append((place + 1, text))
                elif number >= 0:
                    self._note(number)
        self._stream.truncate(end)
        if self.unreadable:
            self._take_out({place for place, _ in self.unreadable})
        if end == 0:
            self._write(HEADER)

    def _take_out(self, places: set[int]) -> None:
        """Write the file again without some of its lines."""
        with written_whole(self.path) as partial, partial.open("wb") as new:
            for _, place, line in _lines(self.path):
                if place not in places:
                    new.write(line)
            new.flush()
            os.fsync(new.fileno())
        self._stream.close()
        self._stream = self.path.open("a+b", buffering=0)

    def _number(self, line: bytes, place: int) -> int | None:
        """Return the number of the run that a line is about; None where it is not a whole row.

        Raises
        ------
        InputError
            A row, but of a run that is not in the plan.
        """
        try:
            (cells,) = csv.reader([line.decode()], strict=True)
            row = dict(zip(COLUMNS, cells, strict=True))
            start, axis = Start.of_cells(row["angle"], row["translation"]), int(row["axis"])
            for name in NUMBERS:
                float(row[name] or "nan")
        except (ValueError, csv.Error):
            return None
        try:
            return self.plan.number(row["pair"], start, axis, row["method"])
        except KeyError:
            raise InputError(
                f"{self.path}, line {place}: not a row of this evaluation: "
                f"{line[:80].decode(errors='replace').strip()!r}; remove the line and its run is "
                "done again, or begin anew with --fresh"
            ) from None

    def _note(self, number: int) -> None:
        self.count += not self.done[number]
        self.done[number] = 1

    def append(self, rows: Iterable[Row]) -> None:
        """Write rows to the disk; one whose run is done already is left out."""
        new = [row for row in rows if not self.done[row.run.number]]
        if not new:
            return
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows(row.cells() for row in new)
        self._write(text.getvalue().encode())
        for row in new:
            self._note(row.run.number)

    def _write(self, content: bytes) -> None:
        written = self._stream.write(content)
        if written != len(content):
            raise OSError(f"{self.path}: wrote {written} of {len(content)} bytes: disk full?")
        os.fsync(self._stream.fileno())

    def sort(self) -> None:
        """Put the rows in the order of the plan, first come first kept; the old file is replaced.

        One line is held in memory at a time, and eight bytes a run.
        """
        offset: NDArray[np.int64] = np.full(len(self.plan), -1, dtype=np.int64)
        for at, place, line in _lines(self.path):
            number = self._number(line, place) if place > 1 else None
            if number is not None and offset[number] < 0:
                offset[number] = at
        with (
            written_whole(self.path) as partial,
            self.path.open("rb") as old,
            partial.open("wb") as new,
        ):
            new.write(HEADER)
            for at in offset[offset >= 0].tolist():
                old.seek(at)
                new.write(old.readline())
            new.flush()
            os.fsync(new.fileno())


def _lines(path: Path) -> Iterator[tuple[int, int, bytes]]:
    """Offset, number from one, and content of every line."""
    at = 0
    with path.open("rb") as stream:
        for place, line in enumerate(stream, 1):
            yield at, place, line
            at += len(line)


def read_rows(path: Path, columns: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """Yield some columns of a file of rows, as text, one row at a time.

    Raises
    ------
    InputError
        It is not one.
    """
    with reading(path, "a file of results"), path.open(encoding="utf-8", newline="") as stream:
        reader = csv.reader(stream)
        header = next(reader)
        places = [header.index(name) for name in columns]
        for cells in reader:
            yield tuple(cells[place] for place in places)
