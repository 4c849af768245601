"""The metrics near the truth: iterations, accuracy and time, beside small_gicp.

Pairs of kitchen-exact at 160 x 120 points with 0.3 or more of overlap, started from the
true pose turned by an angle. All metrics of this package run with the same matches and
the same labels (X84, hard), until a step is below 0.1 mm and 0.1 mrad; GICP of
small_gicp runs at its own threshold. Times are CPU times of one thread, of the
alignment without k-d trees and normals.
"""

from __future__ import annotations

import argparse
import math
import os
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

import hmrf_icp
from depth_pairs import KITCHEN, machine
from hmrf_icp import Criteria, datasets, presets, se3
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.evaluate import protocol

CRITERIA = Criteria(1e-4, 1e-4, 50)


def cases(count, angle, step=4):
    """Source, target, truth and start of ``count`` pairs, without a second draw of any."""
    sequence = datasets.open_sequence(KITCHEN)
    frames = {frame.index: frame for frame in sequence.frames}
    rng = np.random.default_rng(0)
    axes = protocol.Axes.random(16, seed=0)
    found = 0
    while found < count:
        free, fixed = (frames[i] for i in rng.choice(list(frames), 2, replace=False))
        source, target = free.load().subsample(step), fixed.load().subsample(step)
        truth = protocol.true_transformation(free.pose, fixed.pose)
        if protocol.overlap(source, target, truth) < 0.3:
            continue
        start = protocol.Start(angle)
        centroid = source.observed_points.mean(axis=0)
        yield source, target, truth, protocol.perturbed(truth, centroid, axes, found % 16, start)
        found += 1


def ours(name):
    def run(source, target, init):
        PreparedCloud(source).surface, PreparedCloud(target).surface
        started = time.process_time()
        result = hmrf_icp.register(
            source, target, init, rejector="x84", aligner=name, criteria=CRITERIA
        )
        return result.transformation, result.iterations, time.process_time() - started

    return run


def small_gicp_at(reach):
    import small_gicp

    def prepared(cloud):
        made = small_gicp.PointCloud(cloud.observed_points)
        tree = small_gicp.KdTree(made)
        small_gicp.estimate_normals_covariances(made, tree, num_neighbors=20)
        return made, tree

    def run(source, target, init):
        (moving, _), (staying, tree) = prepared(source), prepared(target)
        started = time.process_time()
        result = small_gicp.align(
            staying,
            moving,
            tree,
            init,
            registration_type="GICP",
            max_correspondence_distance=reach,
            max_iterations=50,
            rotation_epsilon=CRITERIA.rotation,
            translation_epsilon=CRITERIA.translation,
        )
        seconds = time.process_time() - started
        return result.T_target_source, result.iterations + 1, seconds

    return run


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=20)
    arguments = parser.parse_args()
    # Colour is measured in colour.py: these clouds have none.
    names = [name for name in presets.aligner_names() if name != "colour"]
    methods = {f"{name}, X84": ours(name) for name in names}
    try:
        methods |= {f"small_gicp GICP, {r} m": small_gicp_at(r) for r in (0.05, 0.1)}
    except ImportError:
        print("small_gicp is not installed: left out (pip install 'hmrf-icp[peers]')")
    print(machine())
    for angle in (math.pi / 90, math.pi / 30):
        rows = {name: [] for name in methods}
        for source, target, truth, init in cases(arguments.pairs, angle):
            for name, method in methods.items():
                estimate, iterations, seconds = method(source, target, init)
                rows[name].append((*se3.error(estimate, truth), iterations, seconds))
        print(f"\nstart turned by {math.degrees(angle):.0f} degrees, {arguments.pairs} pairs\n")
        print("| metric | recall | median error | iterations | CPU ms an iteration | ms in all |")
        print("|---|---|---|---|---|---|")
        for name, values in rows.items():
            metres, radians, iterations, seconds = np.array(values).T
            right = (metres < 0.05) & (radians < 0.05)
            print(
                f"| {name} | {right.mean():.2f} "
                f"| {1e3 * np.median(metres):.1f} mm, {1e3 * np.median(radians):.1f} mrad "
                f"| {np.median(iterations):.0f} | {1e3 * np.median(seconds / iterations):.1f} "
                f"| {1e3 * np.median(seconds):.0f} |"
            )


if __name__ == "__main__":
    main()
