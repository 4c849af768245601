"""TUM RGB-D benchmark (Sturm et al., IROS 2012): Kinect depth, motion capture at 100 Hz."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.clouds.distorted_camera import Camera
from hmrf_icp.datasets.folders import camera_from_file, find_camera_file
from hmrf_icp.datasets.formats import Format
from hmrf_icp.datasets.poses import quaternion_pose
from hmrf_icp.datasets.sequence import DepthMap, Frame, Sequence
from hmrf_icp.datasets.tables import LARGEST_NUMBER, Row, read_rows, require_increasing
from hmrf_icp.errors import InputError
from hmrf_icp.se3 import Array, rigid

DEPTH_SCALE = 5000.0
"""Units of the depth maps per metre."""

CAMERAS = {
    "freiburg1": PinholeCamera(640, 480, 517.3, 516.5, 318.6, 255.3),
    "freiburg2": PinholeCamera(640, 480, 520.9, 521.0, 325.1, 249.7),
    "freiburg3": PinholeCamera(640, 480, 535.4, 539.2, 320.1, 247.6),
}
"""The benchmark's calibration of each colour camera, to which its depth maps are registered."""

MAX_GAP = 0.02
"""Seconds between a shutter time and the motion capture on either side of it. At 100 Hz it is
0.01 at most; the double forgives one lost sample."""


def open_tum(folder: Path) -> Sequence:
    """Open a TUM RGB-D sequence.

    Poses are interpolated at the shutter times, spherically in rotation and
    linearly in position, as in the paper (Experiments). Frames without
    motion capture around them are left out and counted in the notes.

    Raises
    ------
    InputError
        ``depth.txt`` or ``groundtruth.txt`` is missing or malformed, runs
        backwards in time or names a file that is not there; the camera is unknown.
    """
    rows, shutter, files = _read_depth_list(folder)
    times, poses = _read_groundtruth(folder / "groundtruth.txt")
    camera = _camera(folder, files[0])
    tracked = _is_tracked(times, shutter)
    at_shutter = _interpolate(times, poses, shutter[tracked])
    frames = tuple(
        Frame(int(index), pose, DepthMap(files[index], camera, DEPTH_SCALE), float(shutter[index]))
        for index, pose in zip(np.flatnonzero(tracked), at_shutter, strict=True)
    )
    lost = len(rows) - len(frames)
    notes = (
        f"{lost} of {len(rows)} depth maps left out: no ground truth within {MAX_GAP * 1e3:.0f} ms "
        "before and after the shutter time",
    )
    return Sequence(
        folder.name,
        FORMAT.name,
        frames,
        "depth camera",
        camera,
        folder,
        notes if lost else (),
    )


def _read_depth_list(folder: Path) -> tuple[list[Row], Array, list[Path]]:
    """Lines of ``depth.txt``, shutter times (N,) in seconds, and the files that it names."""
    rows = read_rows(folder / "depth.txt")
    for row in rows:
        if len(row.words) != 2:
            raise row.fail("a timestamp and the name of a depth map")
    try:
        shutter = np.array([float(row.words[0]) for row in rows])
    except ValueError:
        from hmrf_icp.io.text_header import is_number

        row = next(row for row in rows if not is_number(row.words[0]))
        raise row.fail("a timestamp in seconds and the name of a depth map") from None
    finite = np.abs(shutter) <= LARGEST_NUMBER
    if not finite.all():
        raise rows[int(finite.argmin())].fail("a finite timestamp")
    require_increasing(rows, shutter)
    from hmrf_icp.io.files import is_file

    files = [folder / row.words[1] for row in rows]
    for row, file in zip(rows, files, strict=True):
        if not is_file(file):
            raise InputError(f"{row.place}: names {row.words[1]}, but there is no {file}")
    return rows, shutter, files


def _read_groundtruth(path: Path) -> tuple[Array, Array]:
    """Read the motion capture: times (M,), strictly increasing, and poses (M, 4, 4)."""
    rows = read_rows(path)
    expected = "timestamp tx ty tz qx qy qz qw"
    for row in rows:
        if len(row.words) != 8:
            raise row.fail(expected)
    table = np.array([row.numbers(expected) for row in rows])
    require_increasing(rows, table[:, 0])
    poses = np.array(
        [quaternion_pose(row, line[4:], line[1:4]) for row, line in zip(rows, table, strict=True)]
    )
    # A sample written twice is no contradiction, but nothing can be interpolated between the two.
    first = np.r_[True, np.diff(table[:, 0]) > 0]
    return table[first, 0], poses[first]


def _is_tracked(times: Array, shutter: Array) -> NDArray[np.bool_]:
    """Which shutter times (N,) have motion capture close by on both sides."""
    before = np.searchsorted(times, shutter, side="right") - 1
    after = np.searchsorted(times, shutter, side="left")
    inside = (before >= 0) & (after < len(times))
    before, after = np.maximum(before, 0), np.minimum(after, len(times) - 1)
    near = np.maximum(shutter - times[before], times[after] - shutter) <= MAX_GAP + 1e-6
    return np.asarray(inside & near)


def _interpolate(times: Array, poses: Array, at: Array) -> list[Array]:
    """Poses (4, 4) at times within the range of ``times``."""
    from scipy.spatial.transform import Rotation, Slerp

    if len(times) < 2:  # the one pose, at its very time
        return [poses[0]] * len(at)
    rotations = Slerp(times, Rotation.from_matrix(poses[:, :3, :3]))(at).as_matrix()
    positions = np.stack([np.interp(at, times, poses[:, k, 3]) for k in range(3)], axis=-1)
    return [rigid(r, t) for r, t in zip(rotations, positions, strict=True)]


def _camera(folder: Path, depth: Path) -> Camera:
    file = find_camera_file(folder)
    if file is not None:
        return camera_from_file(file, depth)
    for name in (folder.name, folder.resolve().name):
        match = re.search(r"freiburg[123]", name.lower())
        if match:
            return CAMERAS[match.group()]
    raise InputError(
        f"{folder}: which camera took these depth maps is not known: the folder's name has none of "
        f"{', '.join(CAMERAS)} in it, and there is no intrinsics file; put K as a 3 x 3 matrix "
        "into camera-intrinsics.txt there"
    )


FORMAT = Format(
    "TUM RGB-D",
    "depth.txt and groundtruth.txt",
    lambda folder: (
        (folder / "depth.txt").is_file()
        or ((folder / "groundtruth.txt").is_file() and (folder / "depth").is_dir())
    ),
    open_tum,
)
