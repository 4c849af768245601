"""Recordings of Open3D and Redwood (Choi, Zhou and Koltun, CVPR 2015): ``trajectory.log``."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.clouds.distorted_camera import Camera
from hmrf_icp.datasets.folders import (
    camera_from_file,
    files_in,
    find_camera_file,
    image_size,
    numbered,
)
from hmrf_icp.datasets.formats import Format
from hmrf_icp.datasets.sequence import DepthMap, Frame, Sequence
from hmrf_icp.datasets.tables import Row, read_rows
from hmrf_icp.errors import InputError
from hmrf_icp.se3 import Array

PRIMESENSE = PinholeCamera(640, 480, 525.0, 525.0, 319.5, 239.5)
"""Open3D's ``PrimeSenseDefault``."""

DEPTH_SCALE = 1000.0
"""Units of the depth maps per metre."""

_LOGS = ("trajectory.log", "scene/trajectory.log")


def open_redwood(folder: Path) -> Sequence:
    """Open a recording of Open3D or Redwood.

    ``depth/`` holds 16-bit images in millimetres. ``trajectory.log`` (or
    ``scene/trajectory.log``, where Open3D's reconstruction puts it) has five
    lines a pose: three integers, of which the first counts the depth maps
    from 0 in the order of their names, and the matrix camera to world. Without an
    intrinsics JSON the camera is Open3D's PrimeSense default, and the notes
    say so.

    Raises
    ------
    InputError
        The log is missing or malformed, has a pose that is not rigid or one for
        a depth map that is not there; the depth maps are of another size than
        the intrinsics.
    """
    depth = [path for _, path in numbered(files_in(folder / "depth", ".png", ".tif", ".tiff"))]
    if not depth:
        raise InputError(f"{folder / 'depth'}: no depth maps (PNG or TIFF) in it")
    log = next((folder / name for name in _LOGS if (folder / name).is_file()), None)
    if log is None:
        raise InputError(f"{folder}: depth maps without poses: {_LOGS[0]} is not there")
    poses = _read_log(log, depth)
    camera, notes = _camera(folder, depth[0])
    if len(poses) < len(depth):
        notes += (f"{len(depth) - len(poses)} of {len(depth)} depth maps left out: no pose",)
    frames = tuple(
        Frame(index, poses[index], DepthMap(depth[index], camera, DEPTH_SCALE))
        for index in sorted(poses)
    )
    return Sequence(folder.name, FORMAT.name, frames, "depth camera", camera, folder, notes)


def _read_log(path: Path, depth: list[Path]) -> dict[int, Array]:
    """Pose (4, 4) of each depth map, by its place."""
    rows = read_rows(path)
    poses: dict[int, Array] = {}
    for start in range(0, len(rows), 5):
        head, matrix = rows[start], rows[start + 1 : start + 5]
        index = _index(head)
        if len(matrix) < 4:
            raise InputError(
                f"{rows[-1].place}: the file ends inside the pose that begins on line {head.line}"
            )
        for row in matrix:
            if len(row.words) != 4:
                raise row.fail("4 numbers, a row of a pose")
        pose = head.rigid(np.array([row.numbers("4 numbers, a row of a pose") for row in matrix]))
        if index in poses:
            raise InputError(f"{head.place}: a second pose for depth map {index}")
        if not 0 <= index < len(depth):
            raise InputError(
                f"{head.place}: a pose for depth map {index}, counted from 0, but there are only "
                f"{len(depth)} in {depth[0].parent}"
            )
        poses[index] = pose
    return poses


def _index(head: Row) -> int:
    # At most what an integer of 64 bits has: Python counts further, but nothing here does.
    if len(head.words) == 3 and all(re.fullmatch(r"-?[0-9]{1,18}", word) for word in head.words):
        return int(head.words[0])
    raise head.fail("three integers before a 4 x 4 matrix")


def _camera(folder: Path, depth: Path) -> tuple[Camera, tuple[str, ...]]:
    file = find_camera_file(folder)
    if file is not None:
        return camera_from_file(file, depth), ()
    size = image_size(depth)
    if size != (PRIMESENSE.width, PRIMESENSE.height):
        raise InputError(
            f"{folder}: no intrinsics JSON, and Open3D's PrimeSense default is for 640 x 480 "
            f"pixels, not {size[0]} x {size[1]}; put camera_intrinsic.json there"
        )
    return PRIMESENSE, (
        "no intrinsics JSON: Open3D's PrimeSense default 525, 525, 319.5, 239.5 used",
    )


FORMAT = Format(
    "Open3D/Redwood",
    "depth/ and trajectory.log, with or without camera_intrinsic.json",
    lambda folder: (
        (folder / "depth").is_dir()
        and (
            any((folder / name).is_file() for name in _LOGS)
            or bool(files_in(folder / "depth", ".png", ".tif", ".tiff"))
        )
    ),
    open_redwood,
)
