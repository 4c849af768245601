"""A short recording of a rendered table, written in the formats that the readers know."""

from __future__ import annotations

import functools
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.se3 import inverse, rigid, rotation_exp, transform
from hmrf_icp.synthetic.render import render, render_lidar
from hmrf_icp.synthetic.scenes import look_at, tabletop

CAMERA = PinholeCamera(160, 120, 146.0, 147.0, 79.5, 60.5)
START = 1305031453.374112
"""A timestamp as long as real ones: differences of it are what readers have to get right."""

LIDAR_TO_CAMERA = rigid(
    rotation_exp((0.02, -0.01, 0.03)) @ np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]]),
    (-0.004, -0.08, -0.27),
)


def walk(seconds: float) -> np.ndarray:
    """Pose, camera to world, of a hand that moves evenly: the interpolation of it is exact."""
    pose = look_at((-0.3, -0.95, 1.25), (0.0, 0.0, 0.75))
    turn = rotation_exp(seconds * np.array([0.05, -0.30, 0.08]))
    return rigid(pose[:3, :3] @ turn, pose[:3, 3] + seconds * np.array([0.35, 0.05, 0.04]))


@dataclass(frozen=True)
class Recording:
    """Depth maps (metres, NaN where nothing is seen) and where they were taken from."""

    camera: PinholeCamera
    seconds: tuple[float, ...]
    poses: tuple[np.ndarray, ...]
    depths: tuple[np.ndarray, ...]

    def points(self, index: int) -> np.ndarray:
        """Points (H, W, 3) in the camera's frame."""
        return self.camera.unproject(self.depths[index])


@functools.cache
def recording(camera: PinholeCamera = CAMERA, count: int = 3) -> Recording:
    seconds = tuple(0.0333 * k + 0.3 * k for k in range(count))
    poses = tuple(walk(t) for t in seconds)
    scene = tabletop()
    return Recording(camera, seconds, poses, tuple(render(scene, camera, p) for p in poses))


def raw(depth: np.ndarray, scale: float) -> np.ndarray:
    return np.rint(np.nan_to_num(depth) * scale).astype(np.uint16)


def write_png(path: Path, depth: np.ndarray, scale: float) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(raw(depth, scale)).save(path)


def write_pgm(path: Path, values: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    height, width = values.shape
    header = f"P5\n{width} {height}\n65535\n".encode()
    path.write_bytes(header + values.astype(">u2").tobytes())


def write_matrix(path: Path, matrix: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savetxt(path, matrix, fmt="%.12g")


def tum_line(seconds: float, pose: np.ndarray, digits: int = 9) -> str:
    numbers = [*pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_quat()]
    return f"{START + seconds:.6f} " + " ".join(f"{n:.{digits}f}" for n in numbers)


def write_tum(folder: Path, shot: Recording, intrinsics: bool = True) -> Path:
    """TUM RGB-D; motion capture at 100 Hz that hits no shutter time."""
    lines = ["# depth maps", "# file: 'made.bag'", "# timestamp filename"]
    for seconds, depth in zip(shot.seconds, shot.depths, strict=True):
        name = f"depth/{START + seconds:.6f}.png"
        write_png(folder / name, depth, 5000.0)
        lines.append(f"{START + seconds:.6f} {name}")
    (folder / "depth.txt").write_text("\n".join(lines) + "\n")
    ticks = np.arange(-0.0137, shot.seconds[-1] + 0.03, 0.01)
    truth = ["# ground truth trajectory", "# timestamp tx ty tz qx qy qz qw"]
    truth += [tum_line(t, walk(t)) for t in ticks]
    (folder / "groundtruth.txt").write_text("\n".join(truth) + "\n")
    if intrinsics:
        write_matrix(folder / "camera-intrinsics.txt", shot.camera.matrix)
    return folder


def write_seven_scenes(folder: Path, shot: Recording) -> Path:
    for k, (pose, depth) in enumerate(zip(shot.poses, shot.depths, strict=True)):
        write_png(folder / f"frame-{10 * k:06d}.depth.png", depth, 1000.0)
        write_matrix(folder / f"frame-{10 * k:06d}.pose.txt", pose)
    write_matrix(folder / "camera-intrinsics.txt", shot.camera.matrix)
    return folder


def write_redwood(folder: Path, shot: Recording, intrinsics: bool = True) -> Path:
    lines = []
    for k, (pose, depth) in enumerate(zip(shot.poses, shot.depths, strict=True)):
        write_png(folder / "depth" / f"{k + 1:05d}.png", depth, 1000.0)
        lines.append(f"{k} {k} {k + 1}")
        lines += [" ".join(f"{n:.10f}" for n in row) for row in pose]
    (folder / "trajectory.log").write_text("\n".join(lines) + "\n")
    if intrinsics:
        camera = shot.camera
        content = {
            "width": camera.width,
            "height": camera.height,
            "intrinsic_matrix": camera.matrix.T.ravel().tolist(),
        }
        (folder / "camera_intrinsic.json").write_text(json.dumps(content))
    return folder


def infinitam_calibration(camera: PinholeCamera, depth_values: str = "affine 0.001 0.0") -> str:
    sizes = f"{camera.width} {camera.height}\n"
    colour = "100 101\n70 50\n"  # another camera: only the depth camera's may be used
    depth = f"{camera.fx} {camera.fy}\n{camera.cx} {camera.cy}\n"
    extrinsics = "1 0 0 0.02\n0 1 0 0\n0 0 1 0\n"
    return f"{sizes}{colour}\n{sizes}{depth}\n{extrinsics}\n{depth_values}\n"


def write_infinitam(folder: Path, shot: Recording) -> Path:
    for k, depth in enumerate(shot.depths):
        write_pgm(folder / "Frames" / f"{k:04d}.pgm", raw(depth, 1000.0))
    (folder / "calib.txt").write_text(infinitam_calibration(shot.camera))
    np.savetxt(folder / "poses.txt", [p.ravel() for p in shot.poses], fmt="%.10g")
    return folder


@functools.cache
def lidar_scan(index: int) -> np.ndarray:
    """Points (N, 3) of a LiDAR that rides with the camera, in its own frame."""
    pose = recording().poses[index] @ LIDAR_TO_CAMERA
    beams = np.radians(np.linspace(20.0, -20.0, 48))
    return render_lidar(tabletop(), pose, beams, azimuths=360).observed_points


def write_kitti(folder: Path, shot: Recording) -> Path:
    (folder / "velodyne").mkdir(parents=True)
    for k in range(len(shot.poses)):
        points = lidar_scan(k)
        table = np.column_stack([points, np.full(len(points), 0.3)])
        table.astype("<f4").tofile(folder / "velodyne" / f"{k:06d}.bin")
    first = inverse(shot.poses[0])  # KITTI's world is the first camera
    rows = [(first @ pose)[:3].ravel() for pose in shot.poses]
    np.savetxt(folder / "poses.txt", rows, fmt="%.10g")
    lines = [f"P{k}: " + " ".join("7.1" for _ in range(12)) for k in range(4)]
    lines.append("Tr: " + " ".join(f"{n:.12e}" for n in LIDAR_TO_CAMERA[:3].ravel()))
    (folder / "calib.txt").write_text("\n".join(lines) + "\n")
    np.savetxt(folder / "times.txt", shot.seconds, fmt="%.6e")
    return folder


def write_clouds(folder: Path, shot: Recording) -> Path:
    from hmrf_icp import PointCloud
    from hmrf_icp.io import write_cloud

    folder.mkdir(parents=True, exist_ok=True)
    for k in range(len(shot.poses)):
        suffix = ".pcd" if k else ".ply"
        write_cloud(folder / f"scan_{k:03d}{suffix}", PointCloud(shot.points(k).reshape(-1, 3)))
    np.savetxt(folder / "poses.txt", [p[:3].ravel() for p in shot.poses], fmt="%.10g")
    return folder


def to_world(points: np.ndarray, pose: np.ndarray) -> np.ndarray:
    moved = transform(pose, points.reshape(-1, 3))
    return moved[np.isfinite(moved).all(axis=1)]
