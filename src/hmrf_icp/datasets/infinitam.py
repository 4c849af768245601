"""InfiniTAM recordings (Kähler et al., 2015), the kind the paper's shark sequence is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.distorted_camera import Camera
from hmrf_icp.datasets.folders import (
    camera_from_file,
    files_in,
    find_camera_file,
    image_size,
    numbered,
)
from hmrf_icp.datasets.formats import Format
from hmrf_icp.datasets.poses import pair, read_poses
from hmrf_icp.datasets.sequence import DepthMap, Frame, Scan, Sequence
from hmrf_icp.datasets.tables import LARGEST_NUMBER, Row, read_rows
from hmrf_icp.errors import InputError
from hmrf_icp.se3 import Array

DEPTH_SCALE = 1000.0
"""Units of the depth maps per metre, where the calibration file does not say otherwise."""

DEPTH_FOLDERS = (".", "Frames", "frames", "depth")
POSE_FOLDERS = (".", "Frames", "frames", "poses", "pose")
POSE_FILES = ("poses.txt", "pose.txt", "trajectory.txt")

_CALIBRATION = (
    "InfiniTAM's calibration: size, focal lengths and centre of the colour camera, the same six "
    "of the depth camera, 3 x 4 numbers from colour to depth, and two for the depth values after "
    "'kinect' or 'affine'"
)


@dataclass(frozen=True)
class RawDepthMap:
    """A depth map of raw values r, of which InfiniTAM's calibration makes metres.

    Parameters
    ----------
    path
        The image.
    camera
        The depth camera.
    kind
        ``"affine"``: a r + b; ``"kinect"``: 8 b f_x / (a - r), the disparity of the
        first Kinect.
    a, b
        The calibration's two numbers.
    """

    path: Path
    camera: PinholeCamera
    kind: str
    a: float
    b: float

    def load(self) -> PointCloud:
        """Unproject the file into an organised cloud; raw 0 and 65535 are unobserved.

        Raises
        ------
        InputError
            The file is missing, damaged, or of another size than the camera's.
        """
        from hmrf_icp.io import read_depth

        raw = read_depth(self.path).astype(np.float64)
        observed = (raw > 0) & (raw < 65535)
        if self.kind == "affine":
            metres = self.a * raw + self.b
        else:
            disparity = self.a - raw
            observed &= disparity > 0
            metres = 8.0 * self.b * self.camera.fx / np.where(observed, disparity, 1.0)
        try:
            return PointCloud.from_depth(np.where(observed, metres, np.nan), self.camera)
        except InputError as error:
            raise InputError(f"{self.path}: {error}") from None


def open_infinitam(folder: Path) -> Sequence:
    """Open a recording with numbered 16-bit PGM depth maps.

    They stand in the folder itself, in ``Frames/`` or in ``depth/``. The
    camera comes from InfiniTAM's ``calib.txt``, or from an intrinsics file (then
    depths are millimetres). Poses, camera to world, stand in one file
    (``poses.txt``, ``trajectory.txt`` or ``*.poses``, in any form that
    `hmrf_icp.datasets.poses.read_poses` knows; the seven comma-separated
    numbers of the paper's own ``shark_bot_01.poses`` among them), or in one
    text file a frame with the number of its depth map, as InfiniTAM's file-based tracker reads
    them.

    Raises
    ------
    InputError
        No poses or no camera, a file is malformed, a pose is not rigid, or has no depth map.
    """
    depth = _depth_maps(folder)
    frames_at, notes = _poses(folder, depth)
    make, camera = _scans(folder, depth[0][1])
    frames = tuple(Frame(index, pose, make(file)) for index, file, pose in frames_at)
    return Sequence(folder.name, FORMAT.name, frames, "depth camera", camera, folder, notes)


def _depth_maps(folder: Path) -> list[tuple[int, Path]]:
    found = (files_in(folder / name, ".pgm") for name in DEPTH_FOLDERS)
    return numbered(next((files for files in found if files), []))


def _poses(
    folder: Path, depth: list[tuple[int, Path]]
) -> tuple[list[tuple[int, Path, Array]], tuple[str, ...]]:
    """Find number, file and pose of each depth map; say what was left out."""
    from hmrf_icp.io import read_pose

    single = [folder / name for name in POSE_FILES if (folder / name).is_file()]
    single += files_in(folder, ".poses")
    if single:
        return pair(depth, read_poses(single[0])), ()
    maps = dict(depth)
    for name in POSE_FOLDERS:
        files = [
            path
            for path in files_in(folder / name, ".txt")
            if path != _calibration(folder)
            and path != find_camera_file(folder)
            and any(letter.isdigit() for letter in path.stem)
        ]
        if not files:
            continue
        poses = dict(numbered(files))
        orphan = next((poses[number] for number in poses if number not in maps), None)
        if orphan is not None:
            raise InputError(f"{orphan}: a pose whose depth map is not in {depth[0][1].parent}")
        kept = [(n, file, read_pose(poses[n])) for n, file in depth if n in poses]
        lost = len(depth) - len(kept)
        note = f"{lost} of {len(depth)} depth maps left out: no pose"
        return kept, (note,) if lost else ()
    raise InputError(
        f"{folder}: {len(depth)} depth maps without poses; expected {', '.join(POSE_FILES)} or "
        "*.poses with a pose a line, or a numbered text file a frame with a 4 x 4 matrix"
    )


def _calibration(folder: Path) -> Path:
    return folder / "calib.txt"


def _scans(folder: Path, first: Path) -> tuple[Callable[[Path], Scan], Camera]:
    """How to make scans of files, and the camera."""
    if _calibration(folder).is_file():
        camera, kind, a, b = read_calibration(_calibration(folder))
        return _ScanMaker(camera, kind, a, b), camera
    file = find_camera_file(folder)
    if file is None:
        size = image_size(first)
        raise InputError(
            f"{folder}: no calib.txt and no intrinsics file for depth maps of {size[0]} x "
            f"{size[1]} pixels; put K as a 3 x 3 matrix into camera-intrinsics.txt there"
        )
    lens = camera_from_file(file, first)
    return partial(DepthMap, camera=lens, depth_scale=DEPTH_SCALE), lens


@dataclass(frozen=True)
class _ScanMaker:
    camera: PinholeCamera
    kind: str
    a: float
    b: float

    def __call__(self, file: Path) -> Scan:
        if self.kind == "affine" and self.b == 0.0:
            return DepthMap(file, self.camera, 1.0 / self.a)
        return RawDepthMap(file, self.camera, self.kind, self.a, self.b)


def read_calibration(path: Path) -> tuple[PinholeCamera, str, float, float]:
    """Read InfiniTAM's calibration file.

    Returns
    -------
    The depth camera; ``"affine"`` or ``"kinect"``; the two numbers of the depth values. Two
    zeros stand for millimetres.

    Raises
    ------
    InputError
        The file is missing or malformed.
    """
    words = [(row, word) for row in read_rows(path) for word in row.words]
    kind = "kinect"
    if len(words) == 27 and words[24][1] in ("kinect", "affine"):
        kind = words.pop(24)[1]
    numbers = [_number(row, word) for row, word in words]
    if len(numbers) != 26:
        raise InputError(f"{path}: {len(words)} numbers, expected the 26 of {_CALIBRATION}")
    width, height, fx, fy, cx, cy = numbers[6:12]
    try:
        camera = PinholeCamera(round(width), round(height), fx, fy, cx, cy)
    except InputError as error:
        raise InputError(f"{path}: depth {error}; expected {_CALIBRATION}") from None
    a, b = numbers[24:]
    if a == 0.0 and b == 0.0:
        kind, a = "affine", 1.0 / DEPTH_SCALE
    if a <= 0.0 or (kind == "kinect" and b <= 0.0):
        raise InputError(f"{path}: depth values of {kind} {a:g} {b:g} give no positive depth")
    return camera, kind, a, b


def _number(row: Row, word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = np.nan
    if not abs(value) <= LARGEST_NUMBER:  # nor is NaN
        raise InputError(f"{row.place}: found {word!r} among the numbers; expected {_CALIBRATION}")
    return value


FORMAT = Format(
    "InfiniTAM",
    "numbered .pgm depth maps with calib.txt and poses.txt",
    lambda folder: bool(_depth_maps(folder)),
    open_infinitam,
)
