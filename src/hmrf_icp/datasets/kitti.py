"""KITTI odometry (Geiger, Lenz and Urtasun, CVPR 2012): a spinning LiDAR on a car."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.datasets.folders import files_in, numbered
from hmrf_icp.datasets.formats import Format
from hmrf_icp.datasets.poses import pair, read_poses
from hmrf_icp.datasets.sequence import Frame, Sequence
from hmrf_icp.datasets.tables import read_rows, require_increasing
from hmrf_icp.errors import InputError
from hmrf_icp.se3 import Array

_TR = ("Tr", "Tr_velo_to_cam", "Tr_velo_cam")


@dataclass(frozen=True)
class VelodyneScan:
    """A scan in a ``.bin`` file: x, y, z in metres and reflectance, float32 each."""

    path: Path

    def load(self) -> PointCloud:
        """Read the points (N, 3), seen from the origin; a shot that met nothing is unobserved.

        Raises
        ------
        InputError
            The file is missing, empty or cut short.
        """
        from hmrf_icp.io.files import existing_file
        from hmrf_icp.io.velodyne import read_velodyne

        return read_velodyne(existing_file(self.path))


def open_kitti(folder: Path) -> Sequence:
    """Open a sequence of KITTI odometry: ``velodyne/*.bin``, ``calib.txt`` and ``poses.txt``.

    KITTI's poses are those of the left camera: with ``Tr``, LiDAR to camera,
    out of ``calib.txt`` they become the LiDAR's. Where the folder has no
    ``poses.txt``, KITTI's own place is looked at, ``../../poses/NN.txt``. Timestamps come from
    ``times.txt`` where there is one.

    Raises
    ------
    InputError
        A file is missing or malformed, or a pose is not rigid.
    """
    scans = numbered(files_in(folder / "velodyne", ".bin"))
    if not scans:
        raise InputError(f"{folder / 'velodyne'}: no .bin files in it")
    at_home = folder / "poses.txt"
    at_kitti = folder.parent.parent / "poses" / f"{folder.name}.txt"
    file = at_home if at_home.is_file() or not at_kitti.is_file() else at_kitti
    poses = read_poses(file)
    lidar_to_camera = _read_tr(folder / "calib.txt")
    times = _read_times(folder / "times.txt", len(poses))
    counted = len(poses) != len(scans)
    frames = []
    for place, (index, scan, pose) in enumerate(pair(scans, poses)):
        time = None if times is None else float(times[index if counted else place])
        frames.append(Frame(index, pose @ lidar_to_camera, VelodyneScan(scan), time))
    return Sequence(folder.name, FORMAT.name, tuple(frames), "lidar", None, folder)


def _read_tr(path: Path) -> Array:
    """LiDAR to camera (4, 4)."""
    rows = read_rows(path)
    for row in rows:
        if row.words[0].rstrip(":") in _TR:
            numbers = row.numbers("'Tr:' and 12 numbers, a 3 x 4 matrix", start=1)
            if len(numbers) != 12:
                raise row.fail("'Tr:' and 12 numbers, a 3 x 4 matrix")
            return row.rigid(numbers.reshape(3, 4))
    raise InputError(
        f"{path}: no line 'Tr:' (LiDAR to camera), found {', '.join(row.words[0] for row in rows)}"
    )


def _read_times(path: Path, count: int) -> Array | None:
    """Seconds (count,) of each pose, None without a file."""
    if not path.is_file():
        return None
    rows = read_rows(path)
    for row in rows:
        if len(row.words) != 1:
            raise row.fail("one timestamp, seconds")
    times = np.concatenate([row.numbers("one timestamp, seconds") for row in rows])
    require_increasing(rows, times)
    if len(times) != count:
        raise InputError(f"{path}: {len(times)} timestamps for {count} poses")
    return times


FORMAT = Format(
    "KITTI odometry",
    "velodyne/*.bin, calib.txt and poses.txt",
    lambda folder: (folder / "velodyne").is_dir(),
    open_kitti,
)
