"""Register random geometry in every way there is, and count what should never happen.

    python benchmarks/fuzz/registrations.py --count 2000 --state /tmp/registrations.json

Small clouds of all kinds (random, planes, lines, duplicates, holes, images, constants; any
scale, any offset, NaN and infinity among them), starts good and bad, every preset, rejector
and aligner. Each case is made from the seed and its number alone. They run in a child process:
one that dies, hangs or fills the memory is counted, and the next one goes on after it. The state
file remembers where it was, so that the same command goes on after an interruption, and with a
larger ``--count`` after the end. The table says how often what happened; every case that is not
"registered" or "refused" is listed, and ``--case N`` runs one here, with its traceback.
"""

from __future__ import annotations

import argparse
import collections
import json
import queue
import resource
import subprocess
import sys
import threading
import time
import traceback
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import hmrf_icp
from hmrf_icp import presets, se3

HANG = 300.0
"""Seconds after which a case hangs; the first of a child compiles, and has ten times as long."""

SLOW = 30.0
"""Seconds of the processor that small clouds may take, compilation among them."""

MEMORY = 2.0
"""Gigabytes that a process may have had at its peak."""

SAVED = 25
"""Cases after which the state is written."""

FINE = ("registered", "refused")


@dataclass(frozen=True)
class Case:
    """One call of ``hmrf_icp.register``."""

    source: Any
    target: Any
    arguments: dict[str, Any]
    told: str


def case(seed: int, number: int) -> Case:
    """Make a case from its number."""
    rng = np.random.default_rng([seed, number])
    arguments: dict[str, Any] = {"preset": str(rng.choice(presets.names()))}
    if rng.random() < 0.6:
        arguments["rejector"] = str(rng.choice(presets.rejector_names()))
    if rng.random() < 0.6:
        # None of these clouds has colours.
        arguments["aligner"] = str(
            rng.choice([n for n in presets.aligner_names() if n != "colour"])
        )
    kind = str(rng.choice([*GEOMETRY, *IMAGES]))
    scale = 10.0 ** rng.choice([0, 0, 0, rng.uniform(-3, 4), rng.uniform(-40, 14)])
    source, camera, viewpoint = _geometry(rng, kind, scale)
    if np.ndim(source) == 2 and rng.random() < 0.9:
        # The paper's field takes images alone: said once in a while is enough.
        arguments.setdefault("rejector", str(rng.choice(presets.rejector_names()[1:])))
    relation = str(rng.choice(["moved", "same", "part", "other", "away", "scaled", "noisy"]))
    target = _target(rng, source, relation, scale)
    spoilt = str(rng.choice([*["no"] * 5, "holes", "zeros", "constant", "infinite", "huge"]))
    source, target = _spoilt(rng, source, spoilt), _spoilt(rng, target, spoilt)
    start = str(rng.choice([*["none", "near", "any"] * 3, "far", "bad"]))
    arguments["init"] = _start(rng, start, scale)
    told = f"{kind} x {scale:.1e}, target {relation}, {spoilt} spoilt, start {start}, " + ", ".join(
        f"{name} {value}" for name, value in arguments.items() if name != "init"
    )
    if rng.random() < 0.3:
        return Case(source, target, arguments, told + ", arrays")
    return Case((source, camera, viewpoint), (target, camera, viewpoint), arguments, told)


def _geometry(rng: np.random.Generator, kind: str, scale: float) -> tuple[Any, Any, Any]:
    if kind in IMAGES:
        height, width = (int(n) for n in rng.integers(2, 24, 2))
        focal = float(rng.uniform(0.3, 3.0)) * width
        camera = hmrf_icp.PinholeCamera(
            width, height, focal, focal, 0.5 * width - 0.5, 0.5 * height - 0.5
        )
        points = camera.unproject(scale * IMAGES[kind](rng, height, width))
        which = rng.random()
        if which < 0.6:
            return points, camera, None
        return points, None, np.zeros(3) if which < 0.8 else None
    few, some, many = rng.integers(3, 12), rng.integers(10, 40), rng.integers(40, 500)
    count = int(rng.choice([few, *[some] * 4, *[many] * 4]))
    points = GEOMETRY[kind](rng, count) * scale
    if rng.random() < 0.2:
        points = points + 10.0 ** rng.uniform(-1, 7) * scale * rng.normal(size=3)
    if rng.random() < 0.2:
        points = points.astype(np.float32)
    viewpoint = None
    if rng.random() < 0.4:
        viewpoint = scale * 10.0 ** rng.uniform(-2, 2) * rng.normal(size=3)
    return points, None, viewpoint


def _sheet(rng: np.random.Generator, n: int) -> Any:
    uv = rng.uniform(-1, 1, (n, 2))
    return np.c_[uv, 0.2 * np.sin(4 * uv[:, 0]) * np.cos(3 * uv[:, 1])]


def _lattice(_: np.random.Generator, n: int) -> Any:
    side = max(2, round(n ** (1 / 3)))
    return np.stack(np.meshgrid(*[np.arange(side, dtype=float)] * 3), axis=-1).reshape(-1, 3)


def _sphere(rng: np.random.Generator, n: int) -> Any:
    points = rng.normal(size=(n, 3))
    return points / np.linalg.norm(points, axis=1)[:, None]


def _line(rng: np.random.Generator, n: int) -> Any:
    off = rng.choice([0.0, 1e-9, 1e-3])
    return rng.uniform(size=(n, 1)) * rng.normal(size=3) + off * rng.normal(size=(n, 3))


GEOMETRY = {
    "random": lambda rng, n: rng.uniform(-1, 1, (n, 3)),
    "blob": lambda rng, n: rng.normal(size=(n, 3)),
    "sheet": _sheet,
    "plane": lambda rng, n: rng.uniform(-1, 1, (n, 3)) * (1, 1, rng.choice([0.0, 1e-12, 1e-3])),
    "line": _line,
    "two lines": lambda rng, n: (
        np.where(rng.random((n, 1)) < 0.5, [[1.0, 0, 0]], [[0, 1.0, 0.1]])
        * rng.uniform(size=(n, 1))
    ),
    "sphere": _sphere,
    "lattice": _lattice,
    "twice": lambda rng, n: np.repeat(rng.normal(size=(max(2, n // 4), 3)), 4, axis=0),
    "few places": lambda rng, n: rng.normal(size=(15, 3))[rng.integers(0, rng.integers(5, 16), n)],
    "clusters": lambda rng, n: rng.normal(size=(n, 3)) * 1e-6 + 10.0 * rng.integers(0, 3, (n, 3)),
    "far one": lambda rng, n: np.r_[rng.normal(size=(n, 3)), [[1e9, 0.0, 0.0]]],
    "rounded": lambda rng, n: np.round(rng.normal(size=(n, 3)), 1),
}
"""Unorganised clouds of about n points, of size 1."""

IMAGES = {
    "image": lambda rng, h, w: rng.uniform(0.5, 4.0, (h, w)),
    "wall": lambda _, h, w: np.full((h, w), 2.0),
    "floor": lambda _, h, w: 1.0 + np.tile(np.linspace(0, 1, h)[:, None], (1, w)),
    "waves": lambda _, h, w: (
        2.0 + 0.2 * np.sin(np.arange(w) / 3)[None] + 0.1 * np.cos(np.arange(h) / 2)[:, None]
    ),
    "step": lambda _, h, w: np.where(np.arange(w)[None] < w // 2, 1.0, 3.0) * np.ones((h, 1)),
    "sparse": lambda rng, h, w: np.where(
        rng.random((h, w)) < 0.1, rng.uniform(1, 2, (h, w)), np.nan
    ),
    "rows": lambda _, h, w: np.where(
        np.arange(h)[:, None] % 4 == 1, 2.0 + 0.1 * np.cos(np.arange(w) / 3)[None], np.nan
    ),
}
"""Depth maps, (H, W) in units of the scale."""


def _target(rng: np.random.Generator, source: Any, relation: str, scale: float) -> Any:
    points = np.array(source, dtype=np.float64)
    twist = rng.normal(size=6) * np.repeat([0.2, 0.2 * scale], 3)
    if relation in ("moved", "noisy"):
        points = se3.transform(se3.exp(twist), points)
    if relation == "noisy":
        points = points + 0.01 * scale * rng.normal(size=points.shape)
    if relation == "part" and points.ndim == 2:
        points = points[: max(1, int(rng.integers(1, len(points) + 1)))]
    if relation == "other":
        points = scale * rng.normal(size=points.shape)
    if relation == "away":
        points = points + 1000.0 * scale
    if relation == "scaled":
        points = points * 10.0 ** rng.uniform(-6, 6)
    return points


def _spoilt(rng: np.random.Generator, points: Any, how: str) -> Any:
    points = np.array(points)
    some = rng.random(points.shape[:-1]) < rng.choice([0.05, 0.05, 0.3, 0.3, 0.9, 1.0])
    value = {
        "no": None,
        "holes": np.nan,
        "zeros": 0.0,
        "constant": rng.choice([-1.0, 10.0, 65.535]),
        "infinite": np.inf,
        "huge": rng.choice([1e10, 1e13, 1e200, 1e38]),
    }[how]
    if value is not None:
        with np.errstate(over="ignore"):
            points[some] = value
    return points


def _start(rng: np.random.Generator, how: str, scale: float) -> Any:
    if how == "none":
        return None
    if how == "near":
        return se3.exp(rng.normal(size=6) * np.repeat([0.1, 0.1 * scale], 3))
    pose = se3.exp(rng.normal(size=6) * np.repeat([2.0, scale], 3))
    if how == "far":
        pose[:3, 3] *= 10.0 ** rng.uniform(0, 300)
    if how == "bad":
        which = rng.integers(5)
        if which == 0:
            pose[rng.integers(3), rng.integers(4)] = rng.choice([np.nan, np.inf, 1e300])
        if which == 1:
            pose[:3, :3] *= rng.choice([0.0, -1.0, 2.0, 1.0 + 5e-4])
        if which == 2:
            return pose[:3]
        if which == 3:
            return [*pose.tolist(), [0, 0, 0, 1]]
        if which == 4:
            return str(pose)
    return pose


def outcome(one: Case) -> str:
    """Register, and say in a few words what came of it."""
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        try:
            clouds = [
                hmrf_icp.PointCloud(*given) if isinstance(given, tuple) else given
                for given in (one.source, one.target)
            ]
            result = hmrf_icp.register(*clouds, **one.arguments)
        except hmrf_icp.InputError:
            return "refused"
    for warning in heard:
        if not issubclass(warning.category, hmrf_icp.RegistrationWarning):
            return f"warning: {warning.category.__name__}: {str(warning.message)[:80]}"
    wrong = unsound(result)
    return f"unsound: {wrong}" if wrong else "registered"


def unsound(result: hmrf_icp.RegistrationResult) -> str | None:
    """Say what is wrong with a result, whatever the pose; None where nothing is."""
    pose = result.transformation
    if not np.isfinite(pose).all():
        return "pose is not finite"
    if np.abs(pose[:3, :3].T @ pose[:3, :3] - np.eye(3)).max() > 1e-6:
        return "pose is not rigid"
    probability, distance = result.inlier_probability, result.distance
    seen = ~np.isnan(distance)
    if not np.array_equal(seen, ~np.isnan(probability)):
        return "probability and distance of different points"
    if not ((probability[seen] >= 0) & (probability[seen] <= 1)).all():
        return "probability outside [0, 1]"
    if not (np.isfinite(distance[seen]) & (distance[seen] >= 0)).all():
        return "distance"
    numbers = [result.overlap, result.inlier_rmse, result.confidence or 0.0]
    for step in result.history:
        numbers += [step.inlier_share, step.step_translation, step.step_rotation]
        numbers += [step.inlier_rmse, *step.parameters.values()]
    if not np.isfinite(numbers).all():
        return "a number is not finite"
    if result.information is not None and not np.isfinite(result.information).all():
        return "information"
    if any(not np.isfinite(free.twist).all() for free in result.degenerate):
        return "degenerate"
    if not (0 <= result.overlap <= 1 and 0 <= (result.confidence or 0) <= 1):
        return "overlap or confidence outside [0, 1]"
    return None


def tried(seed: int, number: int) -> dict[str, Any]:
    """Run one case, and say what came of it and what it took."""
    started = time.process_time()
    one = case(seed, number)
    try:
        found = outcome(one)
        place = ""
    except MemoryError:
        found, place = "memory", ""
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        place = f" ({Path(last.filename).name}:{last.lineno})"
        found = f"exception: {type(error).__name__}: {str(error)[:80]}"
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    if sys.platform == "darwin":
        peak /= 1024
    seconds = time.process_time() - started
    if found in FINE and seconds > SLOW:
        found = "slow"
    if peak > MEMORY:
        found = "memory"
    return {
        "number": number,
        "found": found + place,
        "told": one.told,
        "seconds": seconds,
    }


class Child:
    """A process that tries one case after the other."""

    def __init__(self, seed: int, first: int, count: int) -> None:
        command = [sys.executable, __file__, "--child", str(first), str(count), "--seed", str(seed)]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        self._lines: queue.Queue[str] = queue.Queue()
        self._fresh = True
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._lines.put(line)
        self._lines.put("")

    def next(self) -> dict[str, Any] | str:
        """Return the outcome of its next case, or how the process ended."""
        try:
            line = self._lines.get(timeout=HANG * (10 if self._fresh else 1))
        except queue.Empty:
            self.end()
            return "hang"
        self._fresh = False
        if line:
            found: dict[str, Any] = json.loads(line)
            return found
        status = self._process.wait()
        return f"signal {-status}" if status < 0 else f"status {status}"

    def end(self) -> None:
        """Stop it."""
        self._process.kill()
        self._process.wait()


def run(seed: int, count: int, state_file: Path | None) -> dict[str, Any]:
    """Try all cases up to ``count``, from where the state file was left."""
    state: dict[str, Any] = {"seed": seed, "next": 0, "counts": {}, "findings": [], "seconds": 0.0}
    if state_file is not None and state_file.exists():
        state = json.loads(state_file.read_text())
        if state["seed"] != seed:
            raise SystemExit(f"{state_file} is of seed {state['seed']}, not {seed}")
    child: Child | None = None
    try:
        while state["next"] < count:
            child = child or Child(seed, state["next"], count)
            answer = child.next()
            if isinstance(answer, str):
                child = None
                answer = {"number": state["next"], "found": answer, "seconds": HANG}
                answer["told"] = case(seed, state["next"]).told
            elif answer["found"] == "memory":
                child.end()
                child = None
            counts = state["counts"]
            counts[answer["found"]] = counts.get(answer["found"], 0) + 1
            if answer["found"] not in FINE:
                state["findings"].append(answer)
            state["seconds"] += answer["seconds"]
            state["next"] += 1
            if state["next"] % SAVED == 0:
                _save(state, state_file)
    finally:
        if child is not None:
            child.end()
        _save(state, state_file)
    return state


def _save(state: dict[str, Any], state_file: Path | None) -> None:
    if state_file is None:
        return
    partial = state_file.with_suffix(".partial")
    partial.write_text(json.dumps(state, indent=1))
    partial.replace(state_file)


def table(state: dict[str, Any]) -> str:
    """Say what came of how many cases, and which were not as they should be."""
    kinds = collections.Counter()
    for found, times in state["counts"].items():
        kinds[found.partition(":")[0]] += times
    lines = [
        f"{state['next']} cases of seed {state['seed']}, {state['seconds']:.0f} s of the processor",
        "",
    ]
    lines += ["| outcome | cases |", "|---|---|"]
    lines += [f"| {kind} | {times} |" for kind, times in kinds.most_common()]
    for one in state["findings"][:50]:
        lines.append(f"{one['number']}: {one['found']} [{one['told']}]")
    return "\n".join(lines)


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=2000, help="cases, from number 0")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--state", type=Path, help="file to go on from, and to leave off in")
    parser.add_argument("--case", type=int, help="run this one here, and show what it is")
    parser.add_argument("--child", type=int, nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child is not None:
        first, count = given.child
        limit = 8 * 2**30
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        for number in range(first, count):
            print(json.dumps(tried(given.seed, number)), flush=True)
    elif given.case is not None:
        one = case(given.seed, given.case)
        print(one.told)
        print(outcome(one))
    else:
        print(table(run(given.seed, given.count, given.state)))


if __name__ == "__main__":
    main()
