"""Microsoft 7-Scenes (Shotton et al., CVPR 2013): Kinect depth, poses of KinectFusion."""

from __future__ import annotations

from pathlib import Path

from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.clouds.distorted_camera import Camera
from hmrf_icp.datasets.folders import camera_from_file, files_in, find_camera_file, number_of
from hmrf_icp.datasets.formats import Format
from hmrf_icp.datasets.sequence import DepthMap, Frame, Sequence
from hmrf_icp.errors import InputError

CAMERA = PinholeCamera(640, 480, 585.0, 585.0, 320.0, 240.0)
"""What the data set's page gives for all of its recordings."""

DEPTH_SCALE = 1000.0
"""Units of the depth maps per metre; 0 and 65535 are unobserved."""


def open_seven_scenes(folder: Path) -> Sequence:
    """Open a 7-Scenes sequence.

    ``frame-NNNNNN.depth.png`` in millimetres with ``frame-NNNNNN.pose.txt``, camera to world. A
    ``camera-intrinsics.txt`` (3 x 3) is heeded. Depth maps without a pose are left out
    and counted in the notes.

    Raises
    ------
    InputError
        A pose is malformed, not rigid, or has no depth map.
    """
    from hmrf_icp.io import read_pose

    depth = {_stem(file): file for file in files_in(folder, ".depth.png")}
    poses = {_stem(file): file for file in files_in(folder, ".pose.txt")}
    orphan = next((name for name in poses if name not in depth), None)
    if orphan is not None:
        raise InputError(f"{poses[orphan]}: its depth map {orphan}.depth.png is not there")
    kept = [name for name in depth if name in poses]
    notes = []
    if len(kept) < len(depth):
        notes.append(f"{len(depth) - len(kept)} of {len(depth)} depth maps left out: no .pose.txt")
    file = find_camera_file(folder)
    if file is None:
        camera: Camera = CAMERA
        notes.append("no camera-intrinsics.txt: the 7-Scenes Kinect's 585, 585, 320, 240 used")
    else:
        camera = camera_from_file(file, next(iter(depth.values())))
    frames = [
        Frame(
            _number(depth[name]),
            read_pose(poses[name]),
            DepthMap(depth[name], camera, DEPTH_SCALE),
        )
        for name in kept
    ]
    return Sequence(
        folder.name,
        FORMAT.name,
        tuple(sorted(frames, key=lambda frame: frame.index)),
        "depth camera",
        camera,
        folder,
        tuple(notes),
    )


def _stem(path: Path) -> str:
    return path.name.rpartition(".")[0].rpartition(".")[0]


def _number(path: Path) -> int:
    number = number_of(path)
    if number is None:
        raise InputError(f"{path}: expected a frame number in its name, as in frame-000012")
    return number


FORMAT = Format(
    "7-Scenes",
    "frame-*.depth.png with frame-*.pose.txt",
    lambda folder: bool(files_in(folder, ".depth.png")),
    open_seven_scenes,
)
