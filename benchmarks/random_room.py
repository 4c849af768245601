"""A room that nobody has seen: furnished at random, rendered, written as a sequence to evaluate.

    python benchmarks/random_room.py room-3 --seed 3
    hmrf-icp evaluate room-3 --frames-per-decile 1 --minimum-overlap 0.03 --axes 1

Floor, walls and ceiling, furniture by the walls with things on it, things on the floor, and a
walk that looks all round: 160 x 120 pixels, exact to a millimetre, or with ``--noise``
as a structured-light camera of four times that resolution would see it.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from PIL import Image

from hmrf_icp import PinholeCamera, se3
from hmrf_icp.synthetic import render, scenes
from hmrf_icp.synthetic.primitives import Box, Frustum, Primitive, Rectangle, Sphere

CAMERA = PinholeCamera(width=160, height=120, fx=146.25, fy=146.25, cx=79.5, cy=59.5)

FOUR_TIMES_FINER = render.StructuredLight(
    disparity_step=1 / 32, disparity_sigma=1 / 192, lateral_sigma=0.125
)
"""A VGA sensor's noise, in the pixels of an image that keeps every fourth of its own."""


def placed(x: float, y: float, z: float, yaw: float = 0.0) -> np.ndarray:
    """Pose of a shape at (x, y, z), turned about the upright axis, radians."""
    return se3.rigid(se3.rotation_exp([0.0, 0.0, yaw]), [x, y, z])


def shell(width: float, depth: float, height: float) -> list[Primitive]:
    """Build floor, ceiling and walls of a room centred at the origin."""
    upright, turned = se3.rotation_exp([np.pi / 2, 0, 0]), se3.rotation_exp([0, np.pi / 2, 0])
    return [
        Rectangle(placed(0, 0, 0), (width, depth)),
        Rectangle(placed(0, 0, height), (width, depth)),
        *(
            Rectangle(se3.rigid(upright, [0, y, height / 2]), (width, height))
            for y in (-depth / 2, depth / 2)
        ),
        *(
            Rectangle(se3.rigid(turned, [x, 0, height / 2]), (height, depth))
            for x in (-width / 2, width / 2)
        ),
    ]


def thing(rng: np.random.Generator, x: float, y: float, level: float, size: float) -> Primitive:
    """Make something of about ``size`` metres that stands at (x, y) on ``level``."""
    kind = rng.integers(3)
    if kind == 0:
        return Sphere(placed(x, y, level + size / 2), size / 2)
    if kind == 1:
        bottom, top = rng.uniform(0.3, 0.6, 2) * size
        return Frustum(placed(x, y, level), bottom, top, size * rng.uniform(0.7, 1.6))
    box = size * rng.uniform(0.5, 1.5, 3)
    return Box(placed(x, y, level + box[2] / 2, rng.uniform(0, np.pi)), tuple(box))


def furniture(rng: np.random.Generator, width: float, depth: float) -> list[Primitive]:
    """Make a cupboard, chest or table by a wall, with things on it."""
    wide, deep, tall = rng.uniform(0.5, 1.6), rng.uniform(0.35, 0.8), rng.uniform(0.4, 1.9)
    side = rng.integers(4)
    if side < 2:
        yaw, x, y = 0.0, rng.uniform(-0.4, 0.4) * width, (side - 0.5) * (depth - deep)
    else:
        yaw, x, y = np.pi / 2, (side - 2.5) * (width - deep), rng.uniform(-0.4, 0.4) * depth
    if rng.random() < 0.4:  # a table top and its pedestal
        tall = rng.uniform(0.45, 0.8)
        parts: list[Primitive] = [
            Box(placed(x, y, tall - 0.02, yaw), (wide, deep, 0.04)),
            Box(placed(x, y, tall / 2 - 0.02, yaw), (0.3 * wide, 0.3 * deep, tall - 0.04)),
        ]
    else:
        parts = [Box(placed(x, y, tall / 2, yaw), (wide, deep, tall))]
    for _ in range(rng.integers(1, 5)):
        along = rng.uniform(-0.35, 0.35) * wide
        at = x + along * np.cos(yaw), y + along * np.sin(yaw)
        parts.append(thing(rng, *at, tall, rng.uniform(0.1, 0.35)))
    return parts


def room(seed: int) -> tuple[scenes.Scene, float, float]:
    """Furnish a room; return it with its width and its depth, metres."""
    rng = np.random.default_rng(seed)
    width, depth, height = rng.uniform(4.0, 6.5), rng.uniform(4.0, 6.5), rng.uniform(2.4, 3.0)
    parts = shell(width, depth, height)
    for _ in range(rng.integers(10, 19)):
        parts += furniture(rng, width, depth)
    for _ in range(rng.integers(3, 8)):
        x, y = rng.uniform(-0.35, 0.35, 2) * (width, depth)
        parts.append(thing(rng, x, y, 0.0, rng.uniform(0.15, 0.45)))
    return scenes.Scene(f"room-{seed}", tuple(parts)), width, depth


def walk(seed: int, width: float, depth: float, count: int) -> list[np.ndarray]:
    """Poses (4, 4), camera to world, of somebody who walks about and looks all round."""
    rng = np.random.default_rng([seed, 1])
    phase = rng.uniform(0, 2 * np.pi, 6)
    poses = []
    for time in np.linspace(0.0, 2.0 * np.pi, count, endpoint=False):
        eye = np.array(
            [
                0.18 * width * np.cos(time + phase[0]),
                0.18 * depth * np.sin(2 * time + phase[1]),
                1.45 + 0.15 * np.sin(3 * time + phase[2]),
            ]
        )
        azimuth = time + 0.4 * np.sin(3 * time + phase[3])
        elevation = np.radians(-18.0 + 12.0 * np.sin(4 * time + phase[4]))
        ahead = np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)])
        poses.append(scenes.look_at(eye, eye + ahead, 0.08 * np.sin(5 * time + phase[5])))
    return poses


def write(folder: Path, seed: int, count: int, noise: bool) -> None:
    """Render the walk into a folder that ``hmrf-icp evaluate`` reads."""
    scene, width, depth = room(seed)
    folder.mkdir(parents=True)
    np.savetxt(folder / "camera-intrinsics.txt", CAMERA.matrix)
    for index, pose in enumerate(walk(seed, width, depth, count)):
        image = render.render(scene, CAMERA, pose)
        if noise:
            rng = np.random.default_rng([seed, index])
            millimetres = render.sensor_noise(image, CAMERA, rng, FOUR_TIMES_FINER)
        else:
            millimetres = np.round(np.nan_to_num(image) * 1000).astype(np.uint16)
        Image.fromarray(millimetres).save(folder / f"frame-{index:06d}.depth.png")
        np.savetxt(folder / f"frame-{index:06d}.pose.txt", pose)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--frames", type=int, default=48)
    parser.add_argument("--noise", action="store_true")
    asked = parser.parse_args()
    write(asked.folder, asked.seed, asked.frames, asked.noise)
