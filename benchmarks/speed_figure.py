"""The picture of `speed.py`: time by stage, against size, and against recall beside the peers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

PROFILED = {
    "depth": "depth pair",
    "points": "points alone",
    "lidar": "LiDAR",
    "fragments": "fragments, no start",
    "millions": "5 million points",
}
STAGES = 9
"""With a colour of their own; the rest is one."""

GREY = "0.8"


def draw(rows: dict[str, Any], path: Path) -> None:
    """Draw what of the three there is."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, (stages, size, recall) = plt.subplots(
        1, 3, figsize=(15, 4.6), layout="constrained", width_ratios=(1.5, 1, 1)
    )
    by_stage(stages, rows)
    by_size(size, rows)
    by_recall(recall, rows)
    for axes in (stages, size, recall):
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def by_stage(axes: Any, rows: dict[str, Any]) -> None:
    """Share of the own time of each stage, a bar for each kind of pair."""
    from matplotlib import colormaps

    found = {
        label: rows[name]["details"]["profile"]
        for name, label in PROFILED.items()
        if name in rows and "profile" in rows[name]["details"]
    }
    shares = {
        label: {stage: spent / sum(profile.values()) for stage, spent in profile.items()}
        for label, profile in found.items()
    }
    every = {stage for profile in shares.values() for stage in profile}
    most = sorted(every, key=lambda stage: -sum(p.get(stage, 0.0) for p in shares.values()))
    labels = [f"{label}\n{sum(found[label].values()):.2f} s" for label in shares]
    left = [0.0] * len(shares)
    colours = colormaps["tab10"].colors
    for place, stage in enumerate(most[:STAGES]):
        width = [profile.get(stage, 0.0) for profile in shares.values()]
        axes.barh(labels, width, left=left, color=colours[place], label=stage)
        left = [a + b for a, b in zip(left, width, strict=True)]
    axes.barh(labels, [1.0 - there for there in left], left=left, color=GREY, label="the rest")
    axes.invert_yaxis()
    axes.set(title="Own time by stage, all threads", xlim=(0, 1), xlabel="share")
    if labels:
        axes.legend(ncols=4, fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.14))


def by_size(axes: Any, rows: dict[str, Any]) -> None:
    """Time against pixels, both presets."""
    for name, label in (("size", 'preset="paper", 5 iterations'), ("size-own", "the default")):
        if name in rows:
            about = rows[name]["details"]
            slope = f"{label}: exponent {rows[name]['value']:.2f}"
            axes.loglog(about["pixels"], about["seconds"], "o-", label=slope)
            axes.legend(fontsize=8)
    axes.set(title="Time against size", xlabel="pixels", ylabel="s")
    axes.grid(which="major", alpha=0.3)


def by_recall(axes: Any, rows: dict[str, Any]) -> None:
    """Recall against median time, near a start and from nowhere."""
    peers = 0
    for name, marker in (("depth", "o"), ("fragments", "s")):
        if name not in rows:
            continue
        about = rows[name]["details"]
        for method, seconds in about["medians"].items():
            mine = method == "hmrf-icp"
            peers += not mine
            colour = "C3" if mine else f"C{(0, 9, 4)[(peers - 1) % 3]}"
            axes.plot(
                seconds,
                about["recall"][method],
                marker,
                ms=9,
                color=colour,
                alpha=0.8,
                label=f"{method}: {PROFILED[name]}",
            )
        axes.legend(fontsize=8, loc="lower left")
    axes.set(title="Recall against time", xlabel="s, median", ylabel="recall", ylim=(0, 1.05))
    axes.set_xscale("log")
    axes.margins(x=0.25)
    axes.grid(which="major", alpha=0.3)
