"""A folder of PLY or PCD clouds with their poses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.datasets.folders import files_in, numbered
from hmrf_icp.datasets.formats import Format
from hmrf_icp.datasets.poses import pair, read_poses
from hmrf_icp.datasets.sequence import Frame, Sequence
from hmrf_icp.errors import InputError

_SUFFIXES = (".ply", ".pcd")
_POSES = "poses.txt"


@dataclass(frozen=True)
class CloudFile:
    """A cloud in a file that `hmrf_icp.io.read_cloud` reads, in its sensor's frame."""

    path: Path

    def load(self) -> PointCloud:
        """Read the points, seen from the origin unless the file says from where.

        Raises
        ------
        InputError
            The file is missing or damaged.
        """
        from hmrf_icp.io import read_cloud

        cloud = read_cloud(self.path)
        if cloud.viewpoint is not None:
            return cloud
        return replace(cloud, viewpoint=np.zeros(3))


def open_clouds(folder: Path) -> Sequence:
    """Open a folder of ``*.ply`` or ``*.pcd`` with ``poses.txt``.

    The poses take each cloud's frame to the world and are those of the
    sensor, which saw its cloud from the origin. They may have any form that
    `hmrf_icp.datasets.poses.read_poses` knows.

    Raises
    ------
    InputError
        ``poses.txt`` is missing or malformed, or does not go with the clouds.
    """
    files = numbered(files_in(folder, *_SUFFIXES))
    if not (folder / _POSES).is_file():
        raise InputError(f"{folder}: {len(files)} clouds without poses: {_POSES} is not there")
    frames = tuple(
        Frame(index, pose, CloudFile(file))
        for index, file, pose in pair(files, read_poses(folder / _POSES))
    )
    notes = ("the poses are taken to be the sensor's: it saw each cloud from its origin",)
    return Sequence(folder.name, FORMAT.name, frames, "cloud", None, folder, notes)


FORMAT = Format(
    "clouds with poses",
    "*.ply or *.pcd with poses.txt",
    lambda folder: bool(files_in(folder, *_SUFFIXES)) and (folder / _POSES).is_file(),
    open_clouds,
)
