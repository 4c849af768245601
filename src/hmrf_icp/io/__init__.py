"""Files: depth maps, clouds, cameras and poses, read into memory and written whole."""

from hmrf_icp.io.camera import parse_intrinsics, read_camera, read_intrinsics
from hmrf_icp.io.cloud import READABLE, WRITABLE, read_cloud, write_cloud
from hmrf_icp.io.depth import read_depth
from hmrf_icp.io.intrinsics import Intrinsics
from hmrf_icp.io.pose import read_pose, write_pose

__all__ = [
    "READABLE",
    "WRITABLE",
    "Intrinsics",
    "parse_intrinsics",
    "read_camera",
    "read_cloud",
    "read_depth",
    "read_intrinsics",
    "read_pose",
    "write_cloud",
    "write_pose",
]
