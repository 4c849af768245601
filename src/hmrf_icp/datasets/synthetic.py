"""The embedded data set: analytic scenes, rendered when a frame is loaded."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.datasets.formats import Collection
from hmrf_icp.datasets.sequence import Frame, Progress, Sequence
from hmrf_icp.se3 import Array

FRAMES = 60
"""Frames of a sequence: its walk, sampled closely enough that every decile of overlap has some."""

SEED = 2017
"""Of the sensor noise."""


@dataclass(frozen=True, eq=False)
class RenderedView:
    """A view of a scene, seen by a noisy sensor.

    Parameters
    ----------
    scene
        A key of ``hmrf_icp.synthetic.scenes.SCENES``.
    index
        Number of the frame; with the scene and the seed it decides the noise.
    pose
        (4, 4), camera to world.
    seed
        Of the noise; None for an exact depth map.
    """

    scene: str
    index: int
    pose: Array
    seed: int | None = SEED

    def load(self) -> PointCloud:
        """Render the view as an organised cloud; the same every time."""
        from hmrf_icp.synthetic.render import render, sensor_noise
        from hmrf_icp.synthetic.scenes import CAMERA, SCENES

        depth = render(SCENES[self.scene](), CAMERA, self.pose)
        if self.seed is None:
            return PointCloud.from_depth(depth, CAMERA)
        rng = np.random.default_rng([self.seed, zlib.crc32(self.scene.encode()), self.index])
        return PointCloud.from_depth(sensor_noise(depth, CAMERA, rng), CAMERA)


def open_synthetic(member: str, progress: Progress | None = None) -> Sequence:  # noqa: ARG001
    """Open ``synthetic:MEMBER``; nothing is rendered until a frame is loaded."""
    from hmrf_icp.synthetic.scenes import CAMERA, trajectory

    frames = tuple(
        Frame(index, pose, RenderedView(member, index, pose))
        for index, pose in enumerate(trajectory(member, FRAMES))
    )
    notes = ("rendered with a model of a structured-light sensor; the poses are exact",)
    return Sequence(f"synthetic:{member}", "synthetic", frames, "depth camera", CAMERA, None, notes)


COLLECTION = Collection("synthetic", ("desk", "tabletop"), open_synthetic, default="desk")
