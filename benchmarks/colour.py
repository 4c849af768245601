"""Colour where surfaces say nothing: two views of a flat wall with a texture, from starts along it.

python benchmarks/colour.py [--seeds 6] [--desk]

Each view has 160 x 120 points of a depth camera 1.5 m before the wall, with noise of 2 mm, and an
intensity (0 to 1) with noise of 0.02; they share about 0.8 of what they see. The texture is a
random sum of waves of 0.15 m and more. The source is slid along the wall; a pose is right within
0.01 m and 0.01 rad. ``darker`` is the same with the source at 0.9 of its brightness. ``--desk`` is
six pairs of painted views of the rendered desk instead, which their surfaces hold, with a depth
camera's noise, from 0.08 rad off. Needs Open3D.
"""

from __future__ import annotations

import argparse

import numpy as np

import hmrf_icp
from hmrf_icp import PinholeCamera, PointCloud, se3
from hmrf_icp.evaluate.peers import catalogue
from hmrf_icp.evaluate.prepared import Prepared
from hmrf_icp.synthetic.render import render, sensor_noise
from hmrf_icp.synthetic.scenes import CAMERA as DESK_CAMERA
from hmrf_icp.synthetic.scenes import SCENES, trajectory

CAMERA = PinholeCamera(160, 120, 146.0, 146.0, 79.5, 59.5)
AWAY, APART, NOISE, GRAIN = 1.5, 0.3, 0.002, 0.02
SLIDES = (0.02, 0.05, 0.1, 0.2)
WAVES = 12
DESK_PAIRS = ((0, 4), (10, 15), (20, 26), (30, 34), (40, 46), (50, 54))


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


def desk_view(pose: np.ndarray, seed: int) -> PointCloud:
    """Return every third pixel of a view of the desk, painted by where a place is in the world."""
    rng = np.random.default_rng(seed)
    clean = render(SCENES["desk"](), DESK_CAMERA, pose)
    exact = PointCloud.from_depth(clean, DESK_CAMERA)
    x, y, z = np.moveaxis(se3.transform(pose, exact.points.reshape(-1, 3)), -1, 0)
    value = 0.5 + 0.2 * np.sin(17.0 * x + 8.0 * z) + 0.2 * np.cos(18.0 * y - 5.0 * x)
    value = value.reshape(exact.shape) + rng.normal(0.0, GRAIN, exact.shape)
    noisy = PointCloud.from_depth(sensor_noise(clean, DESK_CAMERA, rng), DESK_CAMERA)
    return PointCloud(noisy.points, DESK_CAMERA, attributes={"intensity": value}).subsample(3)


def desk() -> None:
    """Print the errors on the desk."""
    poses = trajectory("desk", 60)
    print("| metric | median error | largest |")
    for name in ("symmetric", "colour", "o3d-plane@0.1", "o3d-colour@0.1"):
        errors = []
        for number, (first, second) in enumerate(DESK_PAIRS):
            target = desk_view(poses[first], 2 * number)
            source = desk_view(poses[second], 2 * number + 1)
            truth = se3.inverse(poses[first]) @ poses[second]
            centre = se3.transform(truth, source.observed_points.mean(axis=0))
            init = se3.rotation_about((0.0, 1.0, 0.0), 0.08, centre) @ truth
            errors.append(se3.error(pose_of(name, source, target, init), truth))
        (metres, turns), (most, _) = 1e3 * np.median(errors, axis=0), 1e3 * np.max(errors, axis=0)
        print(f"| {name} | {metres:.1f} mm, {turns:.1f} mrad | {most:.1f} mm |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--desk", action="store_true")
    options = parser.parse_args()
    if options.desk:
        desk()
        return
    seeds = range(options.seeds)
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
