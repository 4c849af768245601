"""The rows of `speed.py` that take turns with their peer in one process."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

import hmrf_icp
import speed_pairs
import speed_peers
from hmrf_icp.evaluate.protocol import Start
from speed_measure import Measured, Row, Setting, Task, against, in_turn
from speed_pairs import Timed, fresh

FAR = Start(math.pi / 6, 0.3)

Poses = dict[str, list[bool]]


def ours(pair: Timed, setting: Setting, **named: Any) -> hmrf_icp.RegistrationResult:
    """Register a pair near its start, from clouds of which nothing is worked out."""
    named = {"num_threads": setting.threads} | named
    return hmrf_icp.register(fresh(pair.source), fresh(pair.target), pair.init, **named)


def bare(pair: Timed, setting: Setting, **named: Any) -> hmrf_icp.RegistrationResult:
    """Register the points (N, 3) alone."""
    points = pair.source.observed_points, pair.target.observed_points
    return hmrf_icp.register(*points, pair.init, num_threads=setting.threads, **named)


def judged(pair: Timed, name: str, kept: Poses, pose: Callable[[], np.ndarray]) -> Task:
    """Make a task that keeps whether its pose is right; a method that gives up is wrong."""
    right = kept.setdefault(name, [])
    place = len(right)
    right.append(False)

    def task() -> None:
        right[place] = pair.right(pose())

    return task


def shares(kept: Poses) -> dict[str, float]:
    """Recall by name."""
    return {name: float(np.mean(right)) for name, right in kept.items()}


def profile_of(task: Callable[[], hmrf_icp.RegistrationResult], repeats: int) -> dict[str, float]:
    """Median of the own seconds of each stage."""
    runs = [{stage.name: stage.seconds for stage in task().profile or ()} for _ in range(repeats)]
    return {name: float(np.median([run.get(name, 0.0) for run in runs])) for name in runs[0]}


# --- near a start -------------------------------------------------------------------------------


def depth(setting: Setting) -> Measured:
    """640 x 480 over all overlaps, beside GICP."""
    speed_peers.need("small_gicp")
    name, pairs = speed_pairs.all_deciles(setting)
    kept: Poses = {}

    def group(pair: Timed) -> tuple[Task, ...]:
        points = pair.source.observed_points, pair.target.observed_points

        def gicp(voxel: float) -> Task:
            reach = 5 * voxel
            call = lambda: speed_peers.gicp(*points, pair.init, voxel, reach, setting.threads)  # noqa: E731
            return judged(pair, f"GICP {voxel:g} m", kept, call)

        mine = judged(pair, "hmrf-icp", kept, lambda: ours(pair, setting).transformation)
        return mine, gicp(0.02), gicp(0.05)

    times = in_turn([group(pair) for pair in pairs], setting.some(3, 1))
    half = len(pairs) // 2
    return against(
        times,
        f"{name}, all overlaps, start pi/30",
        recall=shares(kept),
        medians=dict(zip(kept, np.median(times, axis=0).tolist(), strict=True)),
        overlap=[pair.overlap for pair in pairs],
        profile=profile_of(lambda: ours(pairs[half], setting, profile=True), 5),
    )


def low(setting: Setting) -> Measured:
    """Little overlap beside much."""
    count = setting.some(8, 2)
    name, little = speed_pairs.pairs_within(setting, 0.1, 0.3, count)
    _, much = speed_pairs.pairs_within(setting, 0.85, 0.96, count)
    tasks = [
        (lambda a=a: ours(a, setting), lambda b=b: ours(b, setting))
        for a, b in zip(little, much, strict=False)
    ]
    return against(in_turn(tasks, setting.some(3, 1)), name)


def prepared(setting: Setting) -> Measured:
    """One target for many sources."""
    name, pairs = speed_pairs.pairs_within(setting, 0.3, 0.96, setting.some(8, 2))

    def further(pair: Timed) -> Task:
        target = hmrf_icp.prepare(pair.target)
        return lambda: hmrf_icp.register(
            fresh(pair.source), target, pair.init, num_threads=setting.threads
        )

    tasks = [(further(pair), lambda pair=pair: ours(pair, setting)) for pair in pairs]
    return against(in_turn(tasks, setting.some(3, 1)), name)


def points(setting: Setting) -> Measured:
    """Points alone beside the depth map with its camera."""
    name, pairs = speed_pairs.pairs_within(setting, 0.1, 0.96, setting.some(8, 2))
    tasks = [
        (lambda pair=pair: bare(pair, setting), lambda pair=pair: ours(pair, setting))
        for pair in pairs
    ]
    profile = profile_of(lambda: bare(pairs[0], setting, profile=True), 3)
    return against(in_turn(tasks, setting.some(3, 1)), name, profile=profile)


def lidar(setting: Setting) -> Measured:
    """LiDAR scans beside GICP."""
    speed_peers.need("small_gicp")
    pairs = speed_pairs.lidar_pairs(setting)

    def group(pair: Timed) -> tuple[Task, ...]:
        both = pair.source.observed_points, pair.target.observed_points
        return (
            lambda: ours(pair, setting),
            lambda: speed_peers.gicp(*both, pair.init, 0.25, 1.0, setting.threads),
        )

    times = in_turn([group(pair) for pair in pairs], setting.some(3, 1))
    profile = profile_of(lambda: ours(pairs[0], setting, profile=True), 3)
    each = [pair.name for pair in pairs]
    return against(times, "start pi/30", pairs=each, profile=profile)


def threads(setting: Setting) -> Measured:
    """Two threads beside one."""
    name, pairs = speed_pairs.pairs_within(setting, 0.1, 0.96, setting.some(8, 2))
    tasks = [
        (
            lambda pair=pair: ours(pair, setting, num_threads=2),
            lambda pair=pair: ours(pair, setting, num_threads=1),
        )
        for pair in pairs
    ]
    return against(in_turn(tasks, setting.some(5, 1)), name)


def starts(setting: Setting) -> Measured:
    """Start farther off, and without a start, beside pi/30."""
    name, pairs = speed_pairs.pairs_within(setting, 0.1, 0.96, setting.some(6, 2))

    def group(pair: Timed) -> tuple[Task, ...]:
        far = replace(pair, init=speed_pairs.started(pair.source, pair.truth, 0, FAR))
        nowhere = replace(pair, init=None)
        return tuple(lambda pair=one: ours(pair, setting) for one in (far, pair, nowhere))

    times = in_turn([group(pair) for pair in pairs], 1)
    without = float(np.median(times[:, 2]))
    return against(times, f"{name}; without a start {without:.2f} s")


# --- from nowhere -------------------------------------------------------------------------------


def fragments(setting: Setting) -> Measured:
    """Fused fragments without a start, beside KISS-Matcher and GICP."""
    speed_peers.need("kiss_matcher", "small_gicp")
    pairs = speed_pairs.fragment_pairs(setting)
    kept: Poses = {}

    def group(pair: Timed) -> tuple[Task, ...]:
        both = pair.source.observed_points, pair.target.observed_points
        nowhere = lambda: hmrf_icp.register(*both, num_threads=setting.threads).transformation  # noqa: E731
        kiss = lambda: speed_peers.kiss_gicp(*both, 0.05, setting.threads)  # noqa: E731
        return (
            judged(pair, "hmrf-icp", kept, nowhere),
            judged(pair, "KISS-Matcher, GICP", kept, kiss),
        )

    times = in_turn([group(pair) for pair in pairs], 1)

    def profiled() -> hmrf_icp.RegistrationResult:
        both = pairs[0].source.observed_points, pairs[0].target.observed_points
        return hmrf_icp.register(*both, num_threads=setting.threads, profile=True)

    return against(
        times,
        "no start",
        recall=shares(kept),
        medians=dict(zip(kept, np.median(times, axis=0).tolist(), strict=True)),
        profile=profile_of(profiled, 1),
    )


ROWS = {
    "depth": Row(
        "depth pair 640 x 480, all overlaps", "small_gicp GICP, 0.02 m voxels", 0.5, depth
    ),
    "low": Row("the same, overlap 0.1 to 0.3", "itself at 0.9", 1.5, low),
    "prepared": Row("each further source of a prepared target", "a pair", 0.5, prepared),
    "points": Row("the same pair as points (N, 3)", "with its camera", 2.0, points),
    "lidar": Row("LiDAR pair", "small_gicp GICP, 0.25 m voxels", 3.0, lidar),
    "fragments": Row("fragments from nowhere", "KISS-Matcher and GICP", 2.0, fragments),
    "threads": Row("two threads", "one", 0.65, threads),
    "starts": Row("depth pair from pi/6 + 0.3 m", "from pi/30", None, starts),
}
