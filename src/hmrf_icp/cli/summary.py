"""A registration's result as text: for people, and as JSON for programs."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from hmrf_icp import se3
from hmrf_icp.result import RegistrationResult, count
from hmrf_icp.stages import Stage

_NUMBERS = (
    "transformation",
    "believed",
    "confidence",
    "converged",
    "iterations",
    "em_iterations",
    "overlap",
    "fitness",
    "inlier_rmse",
    "seconds",
    "information",
    "centre",
)


def summary(
    result: RegistrationResult, source: str, target: str, written: Sequence[Path] = ()
) -> str:
    """Say the result to a person, in lines of less than 80 columns where names permit."""
    motion = result.transformation
    state = "converged" if result.converged else "did NOT converge"
    lines = [
        f"{source} to {target}: {result.verdict}",
        *([] if result.advice is None else [f"  {result.advice}"]),
        "",
        f"  {state} after {count(result.iterations, 'iteration')}",
        f"  overlap      {result.overlap:.1%} of the source's surface",
        f"  inlier RMSE  {length(result.inlier_rmse)}, {result.fitness:.1%} of the points",
        f"  motion       {length(se3.translation_norm(motion))}, "
        f"{math.degrees(se3.rotation_angle(motion)):.3f} deg",
        *_views(result),
        f"  time         {result.seconds:.2f} s, {count(result.em_iterations, 'EM step')}",
        *_left_alone(result),
        "",
        "  transformation, source to target:",
        *("  " + " ".join(f"{value:13.8f}" for value in row) for row in motion.tolist()),
    ]
    if result.profile is not None:
        lines += ["", *stages(result.profile)]
    if written:
        lines += ["", *(f"  written: {path}" for path in written)]
    return "\n".join(lines)


def json_text(result: RegistrationResult, also: Mapping[str, Any]) -> str:
    """Write the result as one strict JSON object, on one line.

    Parameters
    ----------
    result
        Of it the numbers; not what there is one of for each point.
    also
        More to say: which files, which preset.
    """
    content = {name: getattr(result, name) for name in _NUMBERS}
    content["visibility"] = None if result.visibility is None else asdict(result.visibility)
    content["source_view"], content["target_view"] = (
        {"kind": view.kind, "text": view.text} for view in (result.source_view, result.target_view)
    )
    content["degenerate"] = [
        {"motion": str(motion), "twist": motion.twist} for motion in result.degenerate
    ]
    if result.profile is not None:
        content["profile"] = [asdict(stage) for stage in result.profile]
    return json.dumps(plain(content | dict(also)), allow_nan=False)


def _views(result: RegistrationResult) -> list[str]:
    """Lines on where the clouds were seen from, for a method that asks."""
    if result.visibility is None:
        return []
    return [
        f"  source seen  {result.source_view}",
        f"  target seen  {result.target_view}",
    ]


def stages(profile: Sequence[Stage]) -> list[str]:
    """Lines of a table of the stages, the longest first."""
    total = sum(stage.seconds for stage in profile)
    rows = [
        f"  {stage.name:<15} {1e3 * stage.seconds:9.1f} ms {stage.seconds / total:6.1%} "
        f"{stage.calls:7d}"
        for stage in profile
    ]
    return [f"  {'stage':<15} {'own time':>12} {'share':>6} {'calls':>7}", *rows]


def _left_alone(result: RegistrationResult) -> list[str]:
    """Lines on what the surfaces could not tell."""
    if not result.degenerate:
        return []
    return [
        "",
        "  The surfaces slide along themselves: left as the start had it",
        *(f"    {motion}" for motion in result.degenerate),
    ]


def plain(value: Any) -> Any:
    """Reduce to what strict JSON has: no array, no path, null for NaN and infinity."""
    if hasattr(value, "tolist"):  # an array, or one of NumPy's own numbers
        value = value.tolist()
    if isinstance(value, dict):
        return {name: plain(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


def length(metres: float) -> str:
    """Write a length with its unit: millimetres below a decimetre."""
    return f"{1000 * metres:.3g} mm" if metres < 0.1 else f"{metres:.4g} m"
