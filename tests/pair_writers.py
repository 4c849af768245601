"""Small data sets of pairs, written in the layouts that the readers know."""

from __future__ import annotations

import functools
import json
from pathlib import Path

import numpy as np

from hmrf_icp import PinholeCamera, PointCloud, se3, write_cloud
from hmrf_icp.synthetic.render import render
from hmrf_icp.synthetic.scenes import look_at, tabletop

CAMERA = PinholeCamera(48, 36, 43.5, 43.5, 23.5, 17.5)
COUNT = 4


@functools.cache
def views() -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """Organised points (36, 48, 3) of a table from four places, and the poses, camera to world."""
    made = []
    for k in range(COUNT):
        turn = 0.35 * k
        pose = look_at((np.sin(turn), -np.cos(turn), 1.25), (0.1 * k, 0.0, 0.75))
        made.append((CAMERA.unproject(render(tabletop(), CAMERA, pose)), pose))
    return tuple(made)


def truth(target: int, source: int) -> np.ndarray:
    """Source to target."""
    return se3.inverse(views()[target][1]) @ views()[source][1]


def information(points: np.ndarray) -> np.ndarray:
    """The benchmark's matrix (6, 6) for matches at these points (N, 3)."""
    total = np.zeros((6, 6))
    for point in points:
        g = np.hstack([np.eye(3), -se3.skew(point)])
        total += g.T @ g
    return total


def write_block(stream, i: int, j: int, matrix: np.ndarray) -> None:
    stream.write(f"{i}\t {j}\t {COUNT}\t\n")
    stream.writelines("\t ".join(f"{x:.9e}" for x in row) + "\t\n" for row in matrix)


def write_scene(folder: Path, lists: tuple[str, ...] = ("3DMatch",), overlaps: bool = True) -> Path:
    """A scene of fragments; every pair of them in each list, an overlap of 0.9, 0.8 or 0.7."""
    folder.mkdir(parents=True)
    for k, (points, _) in enumerate(views()):
        seen = points.reshape(-1, 3)
        write_cloud(folder / f"cloud_bin_{k}.ply", PointCloud(seen[~np.isnan(seen[:, 0])]))
    pairs = [(i, j) for i in range(COUNT) for j in range(i + 1, COUNT)]
    for name in lists:
        (folder / name).mkdir(exist_ok=True)
        with (folder / name / "gt.log").open("w") as log:
            for i, j in pairs:
                write_block(log, i, j, truth(i, j))
        with (folder / name / "gt.info").open("w") as info:
            for i, j in pairs:
                seen = views()[i][0].reshape(-1, 3)
                write_block(info, i, j, information(seen[~np.isnan(seen[:, 0])][::9]))
        if overlaps:
            lines = [f"{i},{j},{1 - 0.1 * (j - i):.4f}\n" for i, j in pairs]
            (folder / name / "gt_overlap.log").write_text("".join(lines))
    return folder


def write_pair(folder: Path, scale: float = 1.0, organised: bool = True, **about: object) -> Path:
    """One pair of clouds, ``scale`` units a metre."""
    folder.mkdir(parents=True)
    for name, k in (("source", 2), ("target", 0)):
        points = scale * views()[k][0]
        np.savez(folder / f"{name}.npz", points=points if organised else points.reshape(-1, 3))
    pose = truth(0, 2)
    pose[:3, 3] *= scale
    np.savetxt(folder / "gt.txt", pose)
    (folder / "meta.json").write_text(json.dumps({"camera": None, "viewpoint": None, **about}))
    return folder


def write_fragments(folder: Path) -> Path:
    """Clouds with a pose file each."""
    folder.mkdir(parents=True)
    for k, (points, pose) in enumerate(views()):
        write_cloud(folder / f"fragment-{k:02d}.ply", PointCloud(points.reshape(-1, 3)))
        np.savetxt(folder / f"fragment-{k:02d}.pose.txt", pose)
    return folder
