"""Milliseconds an EM iteration on a 640 x 480 grid, in both precisions, and how far they differ.

python benchmarks/em_iteration.py
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import hmrf_icp
from depth_pairs import machine, vga_pair
from hmrf_icp.field.paper import Grid, initial_labels
from hmrf_icp.loop.match import NearestNeighbour
from hmrf_icp.loop.placed import Placed


def distances(source, target, init):
    """Y on the source's grid at the start of the registration."""
    matches = NearestNeighbour().prepare(hmrf_icp.prepare(source), hmrf_icp.prepare(target))(
        Placed.at(init, source.observed_points)
    )
    return matches.distance


def timed(grid, y, z, beta, steps):
    """Wall and CPU time of one EM step, seconds, and the labels."""
    wall, cpu = time.perf_counter(), time.thread_time()
    labels = grid.em(y, z, beta, steps)
    wall, cpu = time.perf_counter() - wall, time.thread_time() - cpu
    return wall / labels.em_iterations, cpu / labels.em_iterations, labels


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--beta", type=float, default=2.0)
    options = parser.parse_args()
    name, source, target, _, init = vga_pair()
    y = distances(source, target, init)
    z = initial_labels(y, 0.1)
    print(machine())
    print(f"{name}: {source!r}, beta {options.beta:g}")
    print("| precision | steps | CPU ms: least | median | wall ms: least | median |")
    print("|---|---|---|---|---|---|")
    for precision in ("double", "single"):
        grid = Grid(source.observed, precision)
        timed(grid, y, z, options.beta, 2)  # compiles, or loads what was compiled
        runs = [timed(grid, y, z, options.beta, 600) for _ in range(options.repeats)]
        wall, cpu = (1e3 * np.array([run[i] for run in runs]) for i in (0, 1))
        print(
            f"| {precision} | {runs[0][2].em_iterations} | {cpu.min():.2f} | {np.median(cpu):.2f} "
            f"| {wall.min():.2f} | {np.median(wall):.2f} |"
        )
    print("\n| steps | largest difference of z | mean | signs that differ |")
    print("|---|---|---|---|")
    for steps in (1, 5, 20, 100, 600):
        double, single = (
            Grid(source.observed, precision).em(y, z, options.beta, steps)
            for precision in ("double", "single")
        )
        off = np.abs(double.z - single.z)
        flipped = np.count_nonzero(double.inlier != single.inlier)
        print(
            f"| {double.em_iterations} and {single.em_iterations} | {off.max():.1e} "
            f"| {off.mean():.1e} | {flipped} of {off.size} |"
        )


if __name__ == "__main__":
    main()
