"""Pairs of clouds with a known pose that hypotheses are measured on, group by group."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

import numpy as np

from hmrf_icp import datasets, io, se3
from hmrf_icp.clouds.cloud import PointCloud

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@dataclass(frozen=True, eq=False)
class Pair:
    """Two clouds, the true pose (source to target), and how wrong a pose is.

    ``information`` is the benchmark's own (6, 6) where there is one; elsewhere the source
    points that have a target point near them at the true pose are what is measured on.
    """

    name: str
    source: PointCloud
    target: PointCloud
    truth: np.ndarray
    size: float
    information: np.ndarray | None = None
    overlap: float = float("nan")

    @cached_property
    def _overlapping(self):
        return _shared_points(self.source, self.target, self.truth)[0]

    def rmse(self, poses):
        """Root mean square error (K,) of poses (K, 4, 4) over what overlaps, metres."""
        if self.information is None:
            points = self._overlapping
            true = se3.transform(self.truth, points)
            return np.array(
                [
                    np.sqrt(((se3.transform(pose, points) - true) ** 2).sum(axis=1).mean())
                    for pose in poses
                ]
            )
        errors = np.array([_vector(se3.inverse(self.truth) @ pose) for pose in poses])
        squares = np.einsum("ki,ij,kj->k", errors, self.information, errors)
        return np.sqrt(np.maximum(squares, 0.0) / self.information[0, 0])


def _vector(error):
    """Give translation and vector part of the quaternion, as the benchmark takes them."""
    rotation = error[:3, :3]
    w = 0.5 * np.sqrt(max(1.0 + np.trace(rotation), 0.0))
    axis = np.array(
        [
            rotation[2, 1] - rotation[1, 2],
            rotation[0, 2] - rotation[2, 0],
            rotation[1, 0] - rotation[0, 1],
        ]
    )
    length = np.linalg.norm(axis)
    sine = np.sqrt(max(1.0 - min(w, 1.0) ** 2, 0.0))
    if length < 1e-9:
        _, vectors = np.linalg.eigh(0.5 * (rotation + rotation.T))
        axis, length = vectors[:, -1], 1.0
    return np.concatenate([error[:3, 3], sine * axis / length])


def _shared_points(source, target, truth, count=2000):
    from scipy.spatial import cKDTree

    points = source.observed_points[:: max(1, len(source) // count)]
    onto = target.observed_points
    tree = cKDTree(onto)
    spacing = np.median(tree.query(onto[:: max(1, len(onto) // count)], k=2)[0][:, 1])
    distance, _ = tree.query(se3.transform(truth, points))
    near = distance < 3.0 * spacing
    return points[near], float(near.mean())


@cache
def cloud(path):
    """Read a cloud of points once."""
    return PointCloud(io.read_cloud(path).observed_points)


def _log(path):
    lines = path.read_text().split("\n")
    rows, step = {}, 5 if path.suffix == ".log" else 7
    for k in range(0, len(lines) - step + 1, step):
        i, j = (int(n) for n in lines[k].split()[:2])
        rows[i, j] = np.array([line.split() for line in lines[k + 1 : k + step]], dtype=float)
    return rows


def three_d_match(scene, benchmark, count, seed=0):
    """Sample pairs of a scene of 3DMatch or 3DLoMatch, those that the benchmark counts."""
    folder = DATA / "3dmatch" / scene
    truths, information = (_log(folder / benchmark / f"gt.{end}") for end in ("log", "info"))
    every = [pair for pair in truths if pair[1] > pair[0] + 1]
    chosen = np.random.default_rng(seed).permutation(len(every))[:count]
    for k in sorted(chosen):
        i, j = every[k]
        target, source = (cloud(folder / f"cloud_bin_{n}.ply") for n in (i, j))
        points = target.observed_points
        size = float(np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean()))
        yield Pair(f"{scene} {j}>{i}", source, target, truths[i, j], size, information[i, j])


def fragments(count, seed=0):
    """Sample pairs of fused fragments that share a tenth or more."""
    folder = DATA / "fragments-exact"
    names = sorted(folder.glob("*.ply"))
    world = [np.loadtxt(name.with_suffix(".pose.txt")) for name in names]
    pairs = [(i, j) for i in range(len(names)) for j in range(len(names)) if i < j]
    yield from _overlapping_pairs(
        pairs,
        lambda i: cloud(names[i]),
        lambda i, j: se3.inverse(world[j]) @ world[i],
        "fragments",
        count,
        seed,
    )


def depth_pairs(name, count, step, seed=0):
    """Sample pairs of depth maps, every ``step``-th pixel, that share a tenth or more."""
    frames = datasets.open_sequence(DATA / name).frames

    @cache
    def load(i):
        return frames[i].load().subsample(step)

    pairs = [(i, j) for i in range(len(frames)) for j in range(len(frames)) if i != j]
    yield from _overlapping_pairs(
        pairs,
        load,
        lambda i, j: se3.inverse(frames[j].pose) @ frames[i].pose,
        name,
        count,
        seed,
    )


def _overlapping_pairs(pairs, load, truth, name, count, seed):
    for k in np.random.default_rng(seed).permutation(len(pairs)):
        if count == 0:
            return
        i, j = pairs[k]
        source, target = load(i), load(j)
        _, overlap = _shared_points(source, target, truth(i, j))
        if overlap >= 0.1:
            count -= 1
            points = target.observed_points
            size = float(np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean()))
            yield Pair(f"{name} {i}>{j}", source, target, truth(i, j), size, None, overlap)


def real_pairs():
    """Give the pairs from public projects, thinned out to 40,000 points."""
    for folder in sorted((DATA / "real").iterdir()):
        meta = json.loads((folder / "meta.json").read_text())
        clouds = []
        for end in ("source", "target"):
            points = np.load(folder / f"{end}.npz")["points"].astype(float).reshape(-1, 3)
            points = points[np.isfinite(points).all(axis=1) & (points != 0.0).any(axis=1)]
            points = points[:: max(1, len(points) // 40_000)]
            viewpoint = meta.get("viewpoint")
            if viewpoint is None and meta.get("camera"):
                viewpoint = np.zeros(3)
            clouds.append(PointCloud(points, None, viewpoint))
        truth = np.loadtxt(folder / "gt.txt")
        yield Pair(folder.name, clouds[0], clouds[1], truth, float(meta["size"]))
