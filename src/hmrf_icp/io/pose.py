"""Rigid motions as text, four rows of four numbers."""

from __future__ import annotations

import os

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmrf_icp.io.files import existing_file
from hmrf_icp.io.matrix import read_matrix
from hmrf_icp.io.whole import written_whole
from hmrf_icp.se3 import as_rigid


def read_pose(path: str | os.PathLike[str]) -> NDArray[np.float64]:
    """Read a (4, 4) rigid motion.

    Raises
    ------
    InputError
        The file is missing, empty or malformed, or the matrix is not rigid.
    """
    file = existing_file(path)
    return as_rigid(
        read_matrix(file, (4, 4), "expected a 4 x 4 matrix as text, a row a line"), str(file)
    )


def write_pose(path: str | os.PathLike[str], pose: ArrayLike) -> None:
    """Write a (4, 4) rigid motion, every digit of it, whole or not at all.

    Raises
    ------
    InputError
        The matrix is not rigid, or the file cannot be written.
    """
    matrix = as_rigid(pose, "pose")
    with written_whole(path) as partial:
        np.savetxt(partial, matrix, fmt="%24.17g", encoding="ascii")
