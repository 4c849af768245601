"""How often each kind of hypothesis from nowhere holds the right pose, how early, at what cost.

    OMP_NUM_THREADS=1 python benchmarks/hypotheses.py ../shared/data --judges 3dlomatch

The kinds are those of `search/everywhere.py`, in their order, every one asked whether or not an
earlier one convinces; the pairs are those of `judges.py`. A pose counts as near where it lays the
source within 0.15 of its size of where the truth does (root mean square), which is what the coarse
level of the search brings to the truth. "Annealed": after that level. Each row: the share of pairs
with a near pose among the first n, and CPU seconds of one thread, medians.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from pathlib import Path

import numpy as np

import judges
from hmrf_icp import PointCloud, prepare, se3
from hmrf_icp.search.candidates import Annealer
from hmrf_icp.search.coarse_to_fine import COARSE
from hmrf_icp.search.everywhere import everywhere

FIRST = (1, 5, 10, 20, 50, 200)
NEAR = 0.15
KINDS = ("planes", "features", "features, no side")


def ranks(pair, points):
    """Yield kind, rank of the first near pose as it comes and annealed, number, seconds of each."""
    clouds = [pair.source(), pair.target()]
    if points:
        clouds = [PointCloud(cloud.observed_points) for cloud in clouds]
    source, target = (prepare(cloud).viewed.downsampled(20_000) for cloud in clouds)
    surfaces = source.surface, target.surface
    anneal = Annealer(source, target, COARSE)
    truth = pair.truth.copy()
    truth[:3, 3] += truth[:3, :3] @ source.origin - target.origin
    where = se3.transform(truth, surfaces[0].points)
    limit = NEAR * surfaces[0].size

    def first_near(poses):
        for rank, pose in enumerate(poses):
            apart = se3.transform(pose, surfaces[0].points) - where
            if np.sqrt((apart**2).sum(axis=1).mean()) < limit:
                return rank
        return np.inf

    begun = time.process_time()
    for kind, poses in zip(KINDS, everywhere(source, target), strict=False):
        found = time.process_time() - begun
        if len(poses) == 0:
            yield kind, np.inf, np.inf, 0, found, 0.0
        else:
            begun = time.process_time()
            ends = anneal(poses, 1)
            spent = time.process_time() - begun
            yield kind, first_near(poses), first_near(ends), len(poses), found, spent
        begun = time.process_time()


def main():
    words = lambda text: text.split(",")  # noqa: E731
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="folder with the judges' data")
    parser.add_argument("--judges", type=words, default=list(judges.JUDGES))
    parser.add_argument("--pairs", type=int, default=24, help="of a judge, 0 = all; default 24")
    parser.add_argument("--seed", type=int, default=0, help="of the choice of pairs")
    parser.add_argument("--points", action="store_true", help="as points alone, (N, 3)")
    asked = parser.parse_args()
    print("| pairs | kind | poses | order |", " | ".join(map(str, FIRST)), "| CPU s |")
    print("|---|---|---:|---|" + "---:|" * (len(FIRST) + 1))
    for judge in asked.judges:
        rows = defaultdict(list)
        pairs = judges.spread(list(judges.JUDGES[judge](asked.data)), asked.pairs, asked.seed)
        for pair in pairs:
            for kind, *values in ranks(pair, asked.points):
                rows[kind].append(values)
        for kind, values in rows.items():
            come, annealed, count, found, spent = np.array(values, dtype=np.float64).T
            for order, rank, seconds in (
                ("as they come", come, found),
                ("annealed", annealed, spent),
            ):
                shares = [f"{np.sum(rank < n) / len(pairs):.2f}" for n in FIRST]
                name = f"{judge} ({len(pairs)})"
                cells = [name, kind, f"{np.median(count):.0f}", order, *shares]
                print(f"| {' | '.join(cells)} | {np.median(seconds):.2f} |", flush=True)


if __name__ == "__main__":
    main()
