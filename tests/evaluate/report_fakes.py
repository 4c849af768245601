"""Results that look like an evaluation's, for the tests of the report."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hmrf_icp.evaluate.results import COLUMNS

THRESHOLDS = (0.05, 0.1, 0.2, 0.4, 0.8)

SKILLS: Mapping[str, tuple[float, float, float]] = {
    # overlap that half of the runs are solved at from pi/30, what a radian of start costs, seconds
    "hmrf": (0.45, 0.3, 0.35),
    "all": (0.85, 0.3, 0.06),
    "percent": (0.75, 0.3, 0.07),
    "sigma": (0.75, 0.3, 0.07),
    "x84": (0.55, 0.4, 0.08),
    "dynamic": (0.55, 0.35, 0.08),
    "field-gicp": (0.08, 0.1, 0.12),
    **{f"gicp@{t:g}": (0.1 + 0.5 * t, 0.6 - 0.6 * t, 0.03 + 0.01 * t) for t in THRESHOLDS},
    **{f"o3d-plane@{t:g}": (0.2 + 0.5 * t, 0.6 - 0.6 * t, 0.05 + 0.01 * t) for t in THRESHOLDS},
    **{f"o3d-tukey@{t:g}": (0.25 + 0.4 * t, 0.5 - 0.5 * t, 0.06 + 0.02 * t) for t in THRESHOLDS},
    "fricp": (0.5, 0.3, 0.4),
    **{f"kiss-gicp@{t:g}": (0.3 + 0.2 * t, 0.0, 0.3) for t in THRESHOLDS},
}


def row(**values: Any) -> dict[str, Any]:
    """Return one run; what is not given is a plain success."""
    defaults = {
        "target": 0,
        "source": 10,
        "overlap": 0.5,
        "angle": math.pi / 30,
        "translation": 0.0,
        "axis": 0,
        "method": "hmrf",
        "error_m": 0.01,
        "error_rad": 0.01,
        "iterations": 10,
        "em_iterations": 100,
        "seconds": 0.5,
        "converged": True,
        "confidence": "",
        "fitness": "",
        "failure": "",
    }
    made = {**defaults, **values}
    made.setdefault("pair", f"{made['target']:0>6}-{made['source']:0>6}")
    return made


def write_folder(
    folder: Path, rows: Iterable[Mapping[str, Any]], config: Mapping[str, Any] | None = None
) -> Path:
    """Write an evaluation's three files."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = list(rows)
    with (folder / "results.csv").open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    pairs = {r["pair"]: (r["target"], r["source"], r["overlap"]) for r in rows}
    with (folder / "pairs.csv").open("w", newline="", encoding="utf-8") as stream:
        writing = csv.writer(stream, lineterminator="\n")
        writing.writerow(("pair", "target", "source", "overlap"))
        writing.writerows((name, *values) for name, values in pairs.items())
    if config is not None:
        (folder / "config.json").write_text(json.dumps(config), encoding="utf-8")
    return folder


STARTS = ((math.pi / 30, 0.0), (math.pi / 10, 0.0), (math.pi / 6, 0.3))


def invented(
    pairs: int = 40,
    axes: int = 4,
    starts: Sequence[tuple[float, float]] = STARTS,
    methods: Iterable[str] = tuple(SKILLS),
    seed: int = 0,
) -> list[dict[str, Any]]:
    """Make up a whole evaluation whose recalls fall with overlap and start as real ones do."""
    rng = np.random.default_rng(seed)
    skills = {name: SKILLS[name] for name in methods}
    rows = []
    for number in range(pairs):
        overlap = 0.03 + 0.97 * (number + rng.random()) / pairs
        for angle, shift in starts:
            for axis in range(axes):
                luck = rng.logistic()
                for method, (half, cost, seconds) in skills.items():
                    margin = (overlap - half - cost * (angle + shift)) / 0.08
                    solved = margin + 0.7 * luck + 0.4 * rng.logistic() > 0
                    error = rng.lognormal(-5.5 if solved else -1.3, 0.5)
                    own = "@" not in method and method not in ("fricp",)
                    failed = method.startswith("kiss") and not solved and rng.random() < 0.3
                    guess = 1 / (1 + math.exp(-(4.0 if solved else -4.0) - 2.0 * rng.logistic()))
                    rows.append(
                        row(
                            target=100 * (number % 2),
                            source=10 * number + 5,
                            overlap=round(overlap, 6),
                            angle=angle,
                            translation=shift,
                            axis=axis,
                            method=method,
                            error_m="" if failed else error,
                            error_rad="" if failed else error * rng.uniform(0.5, 2.0),
                            iterations="" if not own else int(rng.integers(5, 50)),
                            em_iterations=int(rng.integers(50, 900)) if method == "hmrf" else "",
                            seconds=seconds * rng.lognormal(0, 0.3) * (1.5 - overlap / 2),
                            converged=(rng.random() < 0.8) if own else "",
                            confidence=guess if method == "field-gicp" else "",
                            fitness=""
                            if failed
                            else float(np.clip(rng.normal(overlap, 0.1), 0, 1)),
                            failure="no consistent matches" if failed else "",
                        )
                    )
    return rows


CONFIG = {
    "dataset": "/somewhere/kitchen-invented",
    "command": ["hmrf-icp", "evaluate", "kitchen-invented", "--axes", "4"],
    "methods": ["hmrf", "all", "percent", "sigma", "x84", "dynamic", "field-gicp"],
    "peers": ["gicp", "o3d-plane", "o3d-tukey", "fricp", "kiss-gicp"],
    "seed": 0,
    "subsample": 4,
    "axes": 4,
    "versions": {"hmrf-icp": "0.1.0", "numpy": "2.0.0"},
    "machine": {"processor": "an abacus", "cores": 2},
    "notes": ["o3d-multiscale: skipped, open3d is not installed (pip install 'hmrf-icp[peers]')"],
}
