"""Colour where surfaces say nothing: two views of a flat wall with a texture, from starts along it.

python benchmarks/colour.py [--seeds 6]

Each view has 160 x 120 points of a depth camera 1.5 m before the wall, with noise of 2 mm, and an
intensity (0 to 1) with noise of 0.02; they share about 0.8 of what they see. The texture is a
random sum of waves of 0.15 m and more. The source is slid along the wall; a pose is right within
0.01 m and 0.01 rad. ``darker`` is the same with the source at 0.9 of its brightness. Needs Open3D.
"""

from __future__ import annotations

import argparse

import numpy as np

import hmrf_icp
from hmrf_icp import PinholeCamera, PointCloud, se3
from hmrf_icp.evaluate.peers import catalogue
from hmrf_icp.evaluate.prepared import Prepared

CAMERA = PinholeCamera(160, 120, 146.0, 146.0, 79.5, 59.5)
AWAY, APART, NOISE, GRAIN = 1.5, 0.3, 0.002, 0.02
SLIDES = (0.02, 0.05, 0.1, 0.2)
WAVES = 12


def view(seed: int, offset: float, noise: int, bright: float = 1.0) -> PointCloud:
    """Return the view of a camera straight before the wall, ``offset`` metres to the right."""
    texture, sensor = np.random.default_rng(seed), np.random.default_rng(noise)
    depth = np.full((CAMERA.height, CAMERA.width), AWAY)
    points = CAMERA.unproject(depth)
    x, y = points[..., 0] + offset, points[..., 1]
    value = np.full(depth.shape, 0.5)
    for _ in range(WAVES):
        angle, length, phase = texture.uniform(0.0, [np.pi, 1.0, 2 * np.pi])
        k = 2.0 * np.pi / (0.15 + 0.85 * length)
        value += 0.07 * np.sin(k * (np.cos(angle) * x + np.sin(angle) * y) + phase)
    value = bright * value + sensor.normal(0.0, GRAIN, depth.shape)
    points = CAMERA.unproject(depth + sensor.normal(0.0, NOISE, depth.shape))
    return PointCloud(points, CAMERA, attributes={"intensity": np.clip(value, 0.0, 1.0)})


def pose_of(name: str, source: PointCloud, target: PointCloud, init: np.ndarray) -> np.ndarray:
    """Register with one of this package's metrics, or with a peer."""
    if name in ("symmetric", "colour"):
        return hmrf_icp.register(source, target, init, aligner=name).transformation
    return catalogue()[name].register(Prepared(source), Prepared(target), init).transformation


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=6)
    seeds = range(parser.parse_args().seeds)
    truth = np.eye(4)
    truth[0, 3] = APART
    for kind, bright in (("same exposure", 1.0), ("darker", 0.9)):
        print(f"| {kind} | " + " | ".join(f"{slide:g} m" for slide in SLIDES) + " |")
        for name in ("symmetric", "colour", "o3d-plane@0.1", "o3d-colour@0.1", "o3d-colour@0.4"):
            cells = []
            for slide in SLIDES:
                errors = []
                for seed in seeds:
                    target = view(seed, 0.0, 1000 + seed)
                    source = view(seed, APART, 2000 + seed, bright)
                    angle = 2.0 * np.pi * seed / len(seeds)
                    init = truth.copy()
                    init[:2, 3] += slide * np.array([np.cos(angle), np.sin(angle)])
                    errors.append(se3.error(pose_of(name, source, target, init), truth))
                metres, turns = np.array(errors).T
                right = np.mean((metres < 0.01) & (turns < 0.01))
                cells.append(f"{right:.2f}, {1e3 * np.median(metres):.1f} mm")
            print(f"| {name} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
