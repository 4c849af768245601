"""Small matrices as text."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.errors import InputError
from hmrf_icp.io.files import reading


def read_matrix(path: Path, shape: tuple[int, int], expected: str) -> NDArray[np.float64]:
    """Read a matrix, a row a line.

    The numbers stand apart by white space, commas or semicolons; brackets (a
    matrix as NumPy prints it) and what follows a ``#`` do not count.

    Parameters
    ----------
    path
        An existing file.
    shape
        Of the matrix.
    expected
        What the error message says it should be.

    Raises
    ------
    InputError
        Not text, a word that is no number, NaN or infinity, or another shape.
    """
    with reading(path, "a text matrix"):
        text = path.read_text(encoding="utf-8-sig")
    bare = re.sub(r"#.*", "", text)
    rows = [line for line in re.sub(r"[\[\](),;]", " ", bare).splitlines() if line.strip()]
    values: list[list[float]] = []
    for row in rows:
        try:
            values.append([float(word) for word in row.split()])
        except ValueError:
            raise InputError(
                f"{path}: found {row.strip()[:60]!r} among the numbers; {expected}"
            ) from None
    lengths = [len(row) for row in values]
    if lengths != [shape[1]] * shape[0]:
        found = f"{len(lengths)} rows of {' '.join(str(n) for n in lengths[:6])} numbers"
        raise InputError(f"{path}: found {found if lengths else 'no numbers'}; {expected}")
    matrix = np.array(values)
    if not np.isfinite(matrix).all():
        raise InputError(f"{path}: found NaN or infinity; {expected}")
    return matrix
