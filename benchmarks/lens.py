"""What a lens that distorts costs: the poses of pairs with it known, ignored, and not there.

    python benchmarks/lens.py ../shared/data/kitchen-exact

Depth maps are bent as a lens bends them (each pixel takes the depth of the ideal pixel nearest to
its ray), and registered from nowhere. Errors of the pose are degrees and millimetres.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path

import numpy as np

from hmrf_icp import DistortedCamera, Distortion, PinholeCamera, PointCloud, read_depth, register

PAIRS = ((0, 2), (5, 8), (10, 13), (20, 22), (30, 33), (41, 44))
LENS = Distortion("brown-conrady", (-0.12, 0.05, 5e-4, -5e-4, -0.01))


def bent(depth: np.ndarray, camera: DistortedCamera) -> np.ndarray:
    """Return the depth map that the camera would take where an ideal one takes ``depth``."""
    height, width = depth.shape
    columns, rows = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    u, v = camera.ideal(columns, rows)
    seen = (u > -0.5) & (u < width - 0.5) & (v > -0.5) & (v < height - 0.5)
    result = np.full(depth.shape, np.nan)
    result[seen] = depth[np.rint(v[seen]).astype(int), np.rint(u[seen]).astype(int)]
    return result


def error(found: np.ndarray, true: np.ndarray) -> str:
    """Say how far one motion is off the other."""
    off = np.linalg.inv(true) @ found
    angle = np.degrees(np.arccos(np.clip((np.trace(off[:3, :3]) - 1.0) / 2.0, -1.0, 1.0)))
    return f"{angle:.3f}, {1000.0 * np.linalg.norm(off[:3, 3]):.1f}"


def main() -> None:
    """Register each pair three times."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="frames, poses and camera-intrinsics.txt")
    folder = parser.parse_args().folder
    warnings.simplefilter("ignore")
    frames = sorted(folder.glob("*.depth.png"))
    matrix = np.loadtxt(folder / "camera-intrinsics.txt")
    print("| frames | no lens | lens known | lens ignored |\n|---|---|---|---|")
    for pair in PAIRS:
        poses = [np.loadtxt(str(frames[n]).replace("depth.png", "pose.txt")) for n in pair]
        true = np.linalg.inv(poses[1]) @ poses[0]
        maps = [read_depth(frames[n]) / 1000.0 for n in pair]
        maps = [np.where((each > 0.0) & (each < 60.0), each, np.nan) for each in maps]
        height, width = maps[0].shape
        ideal = PinholeCamera.from_matrix(matrix, width, height)
        lens = DistortedCamera(ideal, LENS)
        distorted = [bent(each, lens) for each in maps]
        cells = []
        for depths, camera in ((maps, ideal), (distorted, lens), (distorted, ideal)):
            source, target = (PointCloud.from_depth(each, camera) for each in depths)
            cells.append(error(register(source, target).transformation, true))
        print(f"| {pair[0]}, {pair[1]} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
