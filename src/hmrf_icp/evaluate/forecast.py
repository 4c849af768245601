"""About how long an evaluation will take, before it begins."""

from __future__ import annotations

from hmrf_icp.evaluate import peers
from hmrf_icp.evaluate.plan import Plan

POINTS = 20_000
"""Of the clouds that the seconds below were measured with."""

SECONDS = {
    "robust": 2.0,
    "gicp": 0.4,
    "gicp-chain": 1.5,
    "o3d-multiscale": 0.6,
    "fricp": 1.0,
    "fricp-plane": 1.0,
    "kiss-gicp": 0.6,
    "fpfh": 1.2,
    "fpfh-gicp": 1.6,
    "colour": 2.5,
    "cpd": 2.0,
}
"""Seconds of one core a run: kitchens, tables and fragments, on a server of 2025."""

USUAL = 0.6
"""Of any other method."""


def seconds(plan: Plan, done: int, points: int, workers: int) -> float:
    """Estimate the wall-clock time of what is left.

    A guess within a factor of three or so, meant to tell minutes from days. A peer that looks at no
    start is counted once a pair.

    Parameters
    ----------
    plan
        All runs.
    done
        How many of them are done.
    points
        Of a typical cloud.
    workers
        Processes that share the work.
    """
    begun = len(plan) // max(1, len(plan.pairs) * len(plan.methods))
    families = [name.partition("@")[0] for name in plan.methods]
    of_a_pair = sum(
        SECONDS.get(family, USUAL) * (1 if family in peers.START_FREE else begun)
        for family in families
    )
    left = 1 - done / max(1, len(plan))
    return left * len(plan.pairs) * of_a_pair * points / POINTS / workers


def words(duration: float) -> str:
    """Write a duration as people do: ``40 seconds``, ``12 minutes``, ``3 hours``, ``2 days``."""
    for unit, length in (("day", 86400.0), ("hour", 3600.0), ("minute", 60.0)):
        if duration >= 1.5 * length:
            return f"{round(duration / length)} {unit}s"
    return f"{max(1, round(duration))} seconds" if duration >= 1.5 else "a second"
