"""Text files of a recording, read line by line so that an error can name the line."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hmrf_icp.errors import InputError
from hmrf_icp.se3 import Array, as_rigid

LARGEST_NUMBER = 1e100
"""No time or place is written with more; the squares of such numbers are finite."""


@dataclass(frozen=True)
class Row:
    """The words of one line that is neither blank nor a comment."""

    path: Path
    line: int
    words: tuple[str, ...]

    @property
    def place(self) -> str:
        """How a message calls the line."""
        return f"{self.path}, line {self.line}"

    def fail(self, expected: str) -> InputError:
        """Return the error for a line that is not what was expected."""
        found = " ".join(self.words)
        return InputError(f"{self.place}: expected {expected}, found {found[:80]!r}")

    def numbers(self, expected: str, start: int = 0) -> Array:
        """Return the words from ``start`` on as finite numbers (N,).

        Raises
        ------
        InputError
            A word is no number, or not finite, or as good as infinite.
        """
        try:
            values = np.array([float(word) for word in self.words[start:]])
        except ValueError:
            raise self.fail(expected) from None
        if not (np.abs(values) <= LARGEST_NUMBER).all():  # nor is NaN
            raise self.fail(f"{expected}, all finite")
        return values

    def rigid(self, matrix: Array) -> Array:
        """Return a (4, 4) or (3, 4) matrix as a pose.

        Raises
        ------
        InputError
            It is not a rigid motion.
        """
        if matrix.shape == (3, 4):
            matrix = np.vstack([matrix, (0.0, 0.0, 0.0, 1.0)])
        return as_rigid(matrix, self.place)


def read_rows(path: Path) -> list[Row]:
    """Read the lines of a text file, without blank ones and ``#`` comments.

    Words stand apart by white space, commas or semicolons.

    Raises
    ------
    InputError
        The file is missing, empty, no text, or holds comments only.
    """
    from hmrf_icp.io.files import existing_file, reading

    file = existing_file(path)
    with reading(file, "text"):
        text = file.read_text(encoding="utf-8-sig")
    rows = []
    for line, content in enumerate(text.splitlines(), 1):
        words = tuple(re.split(r"[\s,;]+", content.partition("#")[0].strip(" \t,;")))
        if words != ("",):
            rows.append(Row(file, line, words))
    if not rows:
        raise InputError(f"{path}: nothing in it but blank lines and comments")
    return rows


def require_increasing(rows: list[Row], times: Array) -> None:
    """Refuse timestamps (N,) that run backwards; equal ones pass.

    Raises
    ------
    InputError
        Naming the first line that is earlier than the one before.
    """
    backwards = np.flatnonzero(np.diff(times) < 0)
    if backwards.size:
        at = int(backwards[0]) + 1
        raise InputError(
            f"{rows[at].place}: timestamp {times[at]:.6f} is earlier than the {times[at - 1]:.6f} "
            f"of line {rows[at - 1].line}; expected timestamps in order: sort the file"
        )
