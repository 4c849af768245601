"""What the paper's preset does as the overlap shrinks, as a Markdown table.

    python benchmarks/paper_preset.py ../shared/data/kitchen-exact ../shared/data/tabletop-exact

Three target frames of each sequence; source frames drawn from every tenth of
overlap; each pair started from the true pose turned by pi/30 about a random
axis through the source's centroid, as in the paper's experiment.
"""

from __future__ import annotations

import argparse
import math
import time
import warnings
from pathlib import Path

import numpy as np

import hmrf_icp
from hmrf_icp import datasets, se3
from hmrf_icp.evaluate import protocol

BINS = ((0.0, 0.1), (0.1, 0.2), (0.2, 0.4), (0.4, 0.6), (0.6, 0.8), (0.8, 1.01))
RECALL = (0.05, 0.05)  # metres, radians


def runs(sequence, rejectors, step, per_decile, seed):
    """Yield (rejector, overlap, metres, radians, iterations, seconds) of every registration."""
    clouds = {frame.index: frame.load().subsample(step) for frame in sequence.frames}
    pose = {frame.index: frame.pose for frame in sequence.frames}
    axes = protocol.Axes.random(16, seed)
    start = protocol.Start(math.pi / 30)
    for target in protocol.spread_targets(clouds, 3):
        overlaps = {
            index: protocol.overlap(
                cloud, clouds[target], protocol.true_transformation(pose[index], pose[target])
            )
            for index, cloud in clouds.items()
            if index != target
        }
        for pair in protocol.select(target, overlaps, per_decile, seed).pairs:
            source = clouds[pair.source]
            truth = protocol.true_transformation(pose[pair.source], pose[target])
            centroid = source.observed_points.mean(axis=0)
            init = protocol.perturbed(truth, centroid, axes, pair.source % len(axes), start)
            for rejector in rejectors:
                began = time.process_time()
                result = hmrf_icp.register(
                    source, clouds[target], init, preset="paper", rejector=rejector
                )
                seconds = time.process_time() - began
                error = se3.error(result.transformation, truth)
                yield rejector, pair.overlap, *error, result.iterations, seconds


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sequences", nargs="+", type=Path)
    parser.add_argument("--rejectors", nargs="+", default=["hmrf", "x84", "all"])
    parser.add_argument("--step", type=int, default=4, help="keep every so many pixels")
    parser.add_argument("--per-decile", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    warnings.simplefilter("ignore", hmrf_icp.RegistrationWarning)
    print("| sequence | rejector | overlap | runs | recall | median error | iterations | CPU s |")
    print("|---|---|---|---|---|---|---|---|")
    for folder in options.sequences:
        sequence = datasets.open_sequence(folder)
        rows = list(
            runs(sequence, options.rejectors, options.step, options.per_decile, options.seed)
        )
        for rejector in options.rejectors:
            for low, high in BINS:
                chosen = [row[2:] for row in rows if row[0] == rejector and low <= row[1] < high]
                if not chosen:
                    continue
                table = np.array(chosen)
                recall = np.mean((table[:, 0] < RECALL[0]) & (table[:, 1] < RECALL[1]))
                metres, radians, iterations, seconds = np.median(table, axis=0)
                print(
                    f"| {sequence.name} | {rejector} | {low:.1f} to {min(high, 1):.1f} "
                    f"| {len(table)} | {recall:.2f} | {metres:.3f} m, {radians:.3f} rad "
                    f"| {iterations:.0f} | {seconds:.2f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
