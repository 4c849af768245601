"""The rows of `speed.py` about size: millions of points, the paper's preset on every pixel."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import speed_pairs
import speed_peers
from hmrf_icp import Criteria, PointCloud
from speed_measure import Measured, Row, Setting, against, in_turn, seconds
from speed_pairs import Timed
from speed_rows import bare, ours, profile_of

ITERATIONS = 5
"""Of the paper's preset and of Open3D, which has a distance to choose: 0.1 m."""

SIZES = ((320, 240), (640, 480), (1280, 960), (1920, 1440))
MILLIONS = 5_000_000


def millions(setting: Setting) -> Measured:
    """Five million points a side, as bare points and as images."""
    large = speed_pairs.rendered(2800, 2100)
    clouds = (large.source, large.target)
    some = [PointCloud(cloud.observed_points[:MILLIONS]) for cloud in clouds]
    pair = Timed("5 million", *some, large.truth, large.init)
    small = speed_pairs.rendered(320, 240)
    bare(small, setting), ours(small, setting)
    repeats = setting.some(3, 1)
    alone = float(np.median([seconds(lambda: bare(pair, setting)) for _ in range(repeats)]))
    image = float(np.median([seconds(lambda: ours(large, setting)) for _ in range(repeats)]))
    result = bare(pair, setting, profile=True)
    count = min(len(cloud) for cloud in some)
    return Measured(
        alone,
        alone,
        None,
        1,
        f"rendered, {count:,} points (N, 3); as images of 2800 x 2100 {image:.2f} s",
        {
            "image": image,
            "right": pair.right(result.transformation),
            "profile": {stage.name: stage.seconds for stage in result.profile or ()},
        },
    )


def paper(setting: Setting) -> Measured:
    """Run the paper's preset beside Open3D, the same number of iterations."""
    speed_peers.need("open3d")
    pair = speed_pairs.vga_pair(setting)
    both = pair.source.observed_points, pair.target.observed_points
    tasks = (
        lambda: ours(pair, setting, preset="paper", criteria=Criteria(0.0, 0.0, ITERATIONS)),
        lambda: speed_peers.open3d_point_to_point(*both, pair.init, 0.1, ITERATIONS),
    )
    times = in_turn([tasks], setting.some(3, 1))
    profile = profile_of(
        lambda: ours(
            pair, setting, preset="paper", criteria=Criteria(0.0, 0.0, ITERATIONS), profile=True
        ),
        1,
    )
    note = f"{pair.name}, {ITERATIONS} iterations each"
    return against(times, note, profile=profile)


def exponent(preset: str) -> Callable[[Setting], Measured]:
    """How time grows with pixels: the slope of a line through the logarithms."""

    def run(setting: Setting) -> Measured:
        named: dict[str, Any] = {"preset": preset}
        if preset == "paper":
            named["criteria"] = Criteria(0.0, 0.0, ITERATIONS)
        pixels, took = [], []
        for width, height in SIZES[: setting.some(4, 3)]:
            pair = speed_pairs.rendered(width, height)
            if not took:
                ours(pair, setting, **named)
            repeats = setting.some(3, 1) if width < 1000 or preset != "paper" else 1
            times = [
                seconds(lambda pair=pair: ours(pair, setting, **named)) for _ in range(repeats)
            ]
            pixels.append(width * height)
            took.append(float(np.median(times)))
        slope = float(np.polyfit(np.log(pixels), np.log(took), 1)[0])
        note = "rendered desk: " + ", ".join(f"{time:.2f}" for time in took) + " s"
        return Measured(slope, None, None, len(took), note, {"pixels": pixels, "seconds": took})

    return run


def bandwidth(setting: Setting) -> Measured:
    """Measure what this machine's memory gives: a copy and a triad of arrays beyond its caches."""
    a, b, c = (np.full(30_000_000 // setting.some(1, 3), value) for value in (1.0, 2.0, 3.0))

    def triad() -> None:
        np.multiply(b, 3.0, out=a)
        np.add(a, c, out=a)

    copied = min(seconds(lambda: np.copyto(a, b)) for _ in range(7))
    added = min(seconds(triad) for _ in range(7))
    rate = 2 * a.nbytes / copied / 1e9
    details = {"copy": rate, "triad": 5 * a.nbytes / added / 1e9}
    note = f"one thread, copy; multiply and add {details['triad']:.1f}"
    return Measured(rate, None, None, 1, note, details)


ROWS = {
    "millions": Row("5 million points a side", "", 5.0, millions, "s"),
    "paper": Row('preset="paper", 640 x 480', "Open3D point-to-point, 0.1 m", 1.0, paper),
    "size": Row('preset="paper", 320 x 240 to 1920 x 1440', "exponent", 1.1, exponent("paper")),
    "size-own": Row("the default, the same sizes", "exponent", None, exponent("robust")),
    "bandwidth": Row("memory bandwidth", "", None, bandwidth, "GB/s"),
}
