"""How often poses from nowhere hold one near the truth, at which rank, and what they cost.

python benchmarks/plane_hypotheses.py [DATASET ...] [--held-out] [--bare] [--each N]
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from hmrf_icp.kernels.view import AGREE, FRONT

import pairs_from_nowhere as data
from hmrf_icp import PointCloud, se3
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.search.candidates import Annealer, Level, distinct
from hmrf_icp.search.confidence import log_odds
from hmrf_icp.search.plane_hypotheses import plane_hypotheses, sampled
from hmrf_icp.search.surprise import surprise
from hmrf_icp.search.visibility import NearSurface, Sample, Visibility

MOST = 100
RANKS = (1, 5, 10, 20, 50, 100)
LEVEL = Level(400, 2500, 40, 8, (0.1, 0.05, 0.03, 0.02), 3)
ASKED = 500
EACH = {"3DMatch": 10, "3DLoMatch": 16, "fragments-exact": 7, "real": 99}


class Clock:
    """CPU seconds of this thread between calls."""

    def __init__(self):
        self.last = time.thread_time()

    def __call__(self):
        """Return the seconds since the last call."""
        before, self.last = self.last, time.thread_time()
        return self.last - before


def verdicts(source: PointCloud, target: PointCloud, poses: np.ndarray) -> np.ndarray:
    """Ask either cloud's view about the other's points under each pose: (K, M)."""
    sides = []
    one, other = PreparedCloud(source), PreparedCloud(target)
    seen = one.range_image is not None or other.range_image is not None
    for free, fixed, motions in (
        (one, other, poses),
        (other, one, np.array([se3.inverse(pose) for pose in poses])),
    ):
        view = fixed.range_image if seen else NearSurface(fixed)
        if view is not None:
            asked = Sample.of(free.surface, ASKED)
            sides.append([view.ask(asked.points, asked.normals, pose) for pose in motions])
    return np.concatenate([np.array(side) for side in sides], axis=1)


def first(right: np.ndarray) -> float:
    rows = np.flatnonzero(right)
    return float(rows[0]) if len(rows) else np.inf


def measure(pair: data.Pair):
    """Ranks of the first right pose by each order, and seconds by stage."""
    clock = Clock()
    surfaces = [PreparedCloud(cloud).surface for cloud in (pair.source, pair.target)]
    seconds = [clock()]
    samples = [
        sampled(s.points, s.normals, s.area, s.oriented, cloud.viewpoint)
        for s, cloud in zip(surfaces, (pair.source, pair.target), strict=True)
    ]
    poses, _ = plane_hypotheses(*samples, MOST)
    seconds.append(clock())
    size = surfaces[1].size
    annealer = Annealer(pair.source, pair.target, LEVEL)
    clock()
    ends = annealer(poses)
    ends = ends[list(distinct(ends, -np.arange(len(ends)), [], 0.06, 0.06 * size))]
    seconds.append(clock())
    said = verdicts(pair.source, pair.target, ends)
    agree, front = said == AGREE, said == FRONT
    seen = pair.source.viewpoint is not None or pair.target.viewpoint is not None
    odds = [
        log_odds(Visibility(*(int(n) for n in np.bincount(row, minlength=5)), seen)) for row in said
    ]
    seldom = surprise(agree, front)
    seconds.append(clock())
    orders = {
        "as they come": poses,
        "annealed": ends,
        "annealed, by log-odds": ends[np.argsort(-np.array(odds), kind="stable")],
        "annealed, by surprise": ends[np.argsort(-seldom, kind="stable")],
    }
    return {name: first(pair.near(some, size)) for name, some in orders.items()}, seconds


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("names", nargs="*", default=[*data.DEVELOP, "real"])
    arguments.add_argument("--held-out", action="store_true")
    arguments.add_argument("--bare", action="store_true", help="without camera and viewpoint")
    arguments.add_argument("--each", type=int, help="pairs a target frame or scene")
    arguments.add_argument("--verbose", action="store_true")
    options = arguments.parse_args()
    print("| pairs | order |", " | ".join(f"<= {n}" for n in RANKS), "| surface, poses, ... s |")
    for name in options.names:
        ranks, seconds = {}, []
        each = options.each or EACH.get(name, 9)
        for pair in data.pairs(name, options.held_out, each, options.bare):
            rank, spent = measure(pair)
            seconds.append(spent)
            for order, value in rank.items():
                ranks.setdefault(order, []).append(value)
            if options.verbose:
                print(pair.name, f"{pair.overlap:.2f}", *rank.values())
        spent = ", ".join(f"{s:.3f}" for s in np.median(seconds, axis=0)) if seconds else ""
        for order, values in ranks.items():
            shares = " | ".join(f"{np.mean(np.array(values) < n):.2f}" for n in RANKS)
            print(f"| {name} ({len(values)}) | {order} | {shares} | {spent} |", flush=True)


if __name__ == "__main__":
    main()
