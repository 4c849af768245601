"""The pair of VGA depth maps that the benchmarks run on."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from hmrf_icp import datasets, se3
from hmrf_icp.evaluate import protocol

KITCHEN = Path(__file__).resolve().parents[2] / "shared" / "data" / "kitchen-exact"


def vga_pair(folder=KITCHEN):
    """Load two overlapping 640 x 480 clouds, the true pose, and a start turned by pi/30.

    Frames 200 and 230 of the rendered kitchen beside the checkout where it is
    there, otherwise two views of the package's own desk.

    Returns
    -------
    name, source, target, truth, init
    """
    if folder.is_dir():
        sequence = datasets.open_sequence(folder)
        name = f"{sequence.name}, frames 230 to 200"
        free, fixed = sequence.frame(230), sequence.frame(200)
    else:
        sequence = datasets.open_sequence("synthetic:desk")
        free, fixed = sequence.frames[len(sequence.frames) // 6], sequence.frames[0]
        name = f"{sequence.name}, frames {free.index} to {fixed.index}"
    source, target = free.load(), fixed.load()
    truth = protocol.true_transformation(free.pose, fixed.pose)
    centroid = source.observed_points.mean(axis=0)
    axes = protocol.Axes.random(1, seed=0)
    init = protocol.perturbed(truth, centroid, axes, 0, protocol.Start(math.pi / 30))
    return name, source, target, truth, init


def machine() -> str:
    """Say what this is measured on."""
    import os
    import platform

    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [line for line in cpuinfo.read_text().splitlines() if line.startswith("model name")]
        model = names[0].partition(":")[2].strip() if names else model
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return (
        f"{model}, {os.cpu_count()} cores{load}; Python {platform.python_version()}, "
        f"NumPy {np.__version__}"
    )


def error_text(estimate, truth) -> str:
    """Error of a pose, readable."""
    metres, radians = se3.error(estimate, truth)
    return f"{metres:.4f} m, {radians:.4f} rad"
