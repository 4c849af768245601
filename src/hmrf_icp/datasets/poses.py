"""Poses of a whole recording in one text file."""

from __future__ import annotations

from collections.abc import Sequence as SequenceOf
from pathlib import Path

import numpy as np

from hmrf_icp.datasets.tables import Row, read_rows
from hmrf_icp.errors import InputError
from hmrf_icp.se3 import Array, rigid

UNIT_TOLERANCE = 5e-3
"""How far the length of a quaternion may be from 1: four decimals a component, and some room."""

_FORMS = (
    "one pose a line as 16 numbers (4 x 4, row by row), 12 (3 x 4) or 7 (quaternion x y z w and "
    "position x y z, or the other way round), or stacked blocks of 4 lines with 4 numbers"
)


def quaternion_pose(row: Row, quaternion: Array, position: Array) -> Array:
    """Make a pose (4, 4) of a quaternion (x, y, z, w) and a position (3,), metres.

    Raises
    ------
    InputError
        The quaternion is not of unit length.
    """
    from scipy.spatial.transform import Rotation

    length = float(np.linalg.norm(quaternion))
    if abs(length - 1.0) > UNIT_TOLERANCE:
        raise InputError(
            f"{row.place}: a rotation is a quaternion of length 1, found length {length:.4g} "
            f"in {' '.join(row.words)[:100]!r}"
        )
    return rigid(Rotation.from_quat(quaternion).as_matrix(), position)


def read_poses(path: Path) -> list[tuple[Row, Array]]:
    """Read the poses of a recording, each with the line that it stands on.

    Numbers stand apart by white space or commas. 16 or 12 numbers a line are
    a matrix row by row; 7 are a quaternion (x, y, z, w) and a position, in
    whichever order makes the quaternions unit; lines of 4 numbers are stacked
    matrices, with or without their last rows 0 0 0 1.

    Returns
    -------
    Pairs of the pose's (first) line and the pose (4, 4).

    Raises
    ------
    InputError
        The file is missing, empty or malformed, or a pose is not rigid; the
        message names the line.
    """
    rows = read_rows(path)
    width = len(rows[0].words)
    if width not in (16, 12, 7, 4):
        raise rows[0].fail(_FORMS)
    for row in rows:
        if len(row.words) != width:
            raise row.fail(f"{width} numbers as on line {rows[0].line}")
    table = np.array([row.numbers(f"{width} numbers") for row in rows])
    if width == 7:
        return _from_quaternions(rows, table)
    if width == 4:
        return _from_blocks(rows, table)
    return [(row, row.rigid(line.reshape(-1, 4))) for row, line in zip(rows, table, strict=True)]


def _from_quaternions(rows: list[Row], table: Array) -> list[tuple[Row, Array]]:
    first = np.abs(np.linalg.norm(table[:, :4], axis=1) - 1.0)
    last = np.abs(np.linalg.norm(table[:, 3:], axis=1) - 1.0)
    # Positions on the unit sphere by chance, all of them, are not expected of any camera.
    if np.median(first) <= np.median(last):
        quaternions, positions = table[:, :4], table[:, 4:]
    else:
        quaternions, positions = table[:, 3:], table[:, :3]
    return [
        (row, quaternion_pose(row, quaternion, position))
        for row, quaternion, position in zip(rows, quaternions, positions, strict=True)
    ]


def _from_blocks(rows: list[Row], table: Array) -> list[tuple[Row, Array]]:
    homogeneous = np.abs(table[3::4] - (0.0, 0.0, 0.0, 1.0)).max(initial=0.0) < 1e-6
    height = 4 if homogeneous and len(rows) >= 4 else 3
    if len(rows) % height:
        raise InputError(
            f"{rows[-1].place}: {len(rows)} lines of 4 numbers are not a whole number of "
            f"{height} x 4 matrices; expected {_FORMS}"
        )
    return [
        (rows[at], rows[at].rigid(table[at : at + height])) for at in range(0, len(rows), height)
    ]


def pair(
    files: SequenceOf[tuple[int, Path]], poses: list[tuple[Row, Array]]
) -> list[tuple[int, Path, Array]]:
    """Give each numbered file its pose.

    As many files as poses: in order. Fewer files (a subset of a recording
    that was kept): the number of the file is that of the pose, from 0.

    Parameters
    ----------
    files
        Number and path of each.
    poses
        Of the recording, in its order.

    Returns
    -------
    Number, path and pose (4, 4) of each file.

    Raises
    ------
    InputError
        The counts leave open which pose belongs to which file.
    """
    if len(files) == len(poses):
        return [(n, file, pose) for (n, file), (_, pose) in zip(files, poses, strict=True)]
    numbers = [n for n, _ in files]
    if len(files) < len(poses) and max(numbers) < len(poses) and len(set(numbers)) == len(numbers):
        return [(n, file, poses[n][1]) for n, file in files]
    raise InputError(
        f"{poses[0][0].path}: {len(poses)} poses for {len(files)} files, {files[0][1].name} to "
        f"{files[-1][1].name} in {files[0][1].parent}; expected one pose a file, or files whose "
        "numbers count the poses from 0"
    )
