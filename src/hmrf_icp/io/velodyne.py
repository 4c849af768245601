"""Scans of a spinning LiDAR as bare numbers: KITTI's ``.bin``, and nuScenes' ``.pcd.bin``."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.errors import InputError
from hmrf_icp.io.files import reading

FARTHEST = 1e6
"""Metres that no such sensor measures: a file with more holds other numbers."""

_KITTI = ("x", "y", "z", "reflectance")
_NUSCENES = (*_KITTI, "ring")


def read_velodyne(path: Path) -> PointCloud:
    """Read x, y, z in metres and the reflectance, float32 each, seen from the origin.

    A file by the name of ``*.pcd.bin`` has the number of the laser behind them, as nuScenes'
    have. The reflectance is the attribute ``intensity``, that number ``ring``. A shot that met
    nothing is unobserved.

    Raises
    ------
    InputError
        Cut short, or not such numbers.
    """
    names = _NUSCENES if path.name.lower().endswith(".pcd.bin") else _KITTI
    record = 4 * len(names)
    with reading(path, "a Velodyne scan"):
        size = path.stat().st_size
        if size % record:
            raise InputError(
                f"{path}: {size} bytes are not a whole number of points of {record} bytes "
                f"({', '.join(names)} as float32); the file is cut short or something else"
            )
        table = np.fromfile(path, dtype="<f4").astype(np.float32).reshape(-1, len(names))
        with np.errstate(invalid="ignore"):  # a NaN that signals is as good as any
            points = table[:, :3].astype(np.float64)
        far = np.isfinite(points) & (np.abs(points) > FARTHEST)
        if far.any():
            raise InputError(
                f"{path}: a coordinate of {points[far][0]:.3g} m; expected {', '.join(names)} as "
                "float32, and nothing else"
            )
        rest = {"intensity": table[:, 3]}
        if len(names) > 4:
            rest["ring"] = table[:, 4]
        return PointCloud(points, viewpoint=np.zeros(3), attributes=rest)
