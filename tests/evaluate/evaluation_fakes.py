"""A short rendered recording, and methods that behave well, badly or not at all."""

from __future__ import annotations

import csv
import os
import signal
import time
from pathlib import Path

import numpy as np
from PIL import Image

from hmrf_icp import se3
from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.evaluate import Configuration, Estimate, NamedMethod, Start, evaluate
from hmrf_icp.synthetic.render import render
from hmrf_icp.synthetic.scenes import look_at, tabletop

CAMERA = PinholeCamera(48, 36, 43.5, 43.5, 23.5, 17.5)
FRAMES = 8


def write_recording(folder: Path) -> Path:
    """Depth maps from a walk past a table, in the layout of 7-Scenes; overlaps of 0.3 to 0.9."""
    folder.mkdir(parents=True)
    scene = tabletop()
    for k in range(FRAMES):
        turn = 0.12 * k
        eye = (1.0 * np.sin(turn), -1.0 * np.cos(turn), 1.25)
        pose = look_at(eye, (0.25 * (k - 3), 0.075 * (k - 3), 0.75))
        depth = np.nan_to_num(render(scene, CAMERA, pose))
        Image.fromarray(np.rint(1000 * depth).astype(np.uint16)).save(
            folder / f"frame-{k:06d}.depth.png"
        )
        np.savetxt(folder / f"frame-{k:06d}.pose.txt", pose, fmt="%.12g")
    np.savetxt(folder / "camera-intrinsics.txt", CAMERA.matrix)
    return folder


def asked(dataset: Path, **changes: object) -> Configuration:
    """A small evaluation: four pairs or so, two starts, two axes."""
    settings: dict[str, object] = {
        "dataset": str(dataset),
        "methods": ("x84",),
        "peers": (),
        "targets": (3,),
        "frames_per_decile": 1,
        "starts": (Start(0.05), Start(0.1, 0.02)),
        "axes": 2,
    }
    return Configuration(**{**settings, **changes})


def _stay(source, target, init):
    return Estimate(init, iterations=0)


def quick(source, target, init):
    """Says the same as the slow one."""
    return Estimate(se3.rigid(np.eye(3), source.centroid), iterations=1, fitness=0.5)


def _slow(source, target, init):
    time.sleep(0.05)
    return quick(source, target, init)


def _raise(source, target, init):
    raise ZeroDivisionError("no point\nis left")


def _lose_its_mind(source, target, init):
    return Estimate(np.full((4, 4), np.nan))


def _kill_its_process(source, target, init):
    os.kill(os.getpid(), signal.SIGKILL)


STAY = NamedMethod("stay", _stay)
SLOW = NamedMethod("slow", _slow)
RAISES = NamedMethod("raises", _raise)
NOT_A_NUMBER = NamedMethod("not-a-number", _lose_its_mind)
KILLS = NamedMethod("kills", _kill_its_process)


def rows(folder: Path, without: tuple[str, ...] = ("seconds",)) -> list[dict[str, str]]:
    """Rows of an evaluation, but for what may differ from one run to the next."""
    with (folder / "results.csv").open(newline="") as stream:
        return [
            {name: cell for name, cell in row.items() if name not in without}
            for row in csv.DictReader(stream)
        ]


def asked_at_length(dataset: Path) -> Configuration:
    """Some hundred runs: enough to be interrupted in the middle."""
    return asked(dataset, methods=(), axes=20)


def run_slowly(dataset: str, output: str) -> None:
    """Evaluate a method that takes its time, until somebody comes."""
    evaluate(asked_at_length(Path(dataset)), output, workers=2, extra_methods=(SLOW,))
