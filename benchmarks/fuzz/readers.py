"""Read a great many damaged files, and count what comes of it beside an answer and an InputError.

    python benchmarks/fuzz/readers.py --count 20000 --seed 1 --state fuzz.json

Each input is a small valid file with something wrong, and is the same whenever it is made
again: its seed and its number decide it. They are read in batches in a process of
their own with 2 GB of address space; where one kills the process or says nothing for some
seconds, it is noted and the next process goes on behind it. With ``--state`` the same command goes
on where an earlier one was stopped. ``--show N`` makes input N again, and reads it here.

Exit status: 0 nothing was found, 1 something was.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

BATCH = 4000
"""Inputs that a process reads."""
MEMORY = 2 << 30
"""Bytes of address space."""
WORK = 10.0
"""Seconds of a processor that an input may take."""
SILENCE = 120.0
"""Seconds that it may take in all, on a machine that others use too, or waiting for ever."""
GROWTH = 512 << 10
"""Kilobytes by which reading one small file may raise the peak of the process's memory."""
KEPT = 5
"""Numbers of inputs that are kept of each kind of finding."""


# ---- The process that reads --------------------------------------------------------------------


def child(seed: int, first: int, count: int, folder: Path, kinds: list[str]) -> None:
    """Read inputs, and keep a file that says which one, and what has come of the others."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    from inputs import Inputs

    inputs = Inputs(seed, folder, kinds)
    tally: dict[str, dict[str, int]] = {}
    findings: dict[str, list[int]] = {}
    warned: list[str] = []
    warnings.simplefilter("always")
    # The fuzzer's own archives, on purpose.
    warnings.filterwarnings("ignore", "Duplicate name")
    warnings.showwarning = lambda message, category, *_: warned.append(
        f"{category.__name__}: {str(message)[:80]}"
    )
    descriptor = os.open(folder / "at", os.O_WRONLY | os.O_CREAT)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for number in range(first, first + count):
        os.pwrite(descriptor, number.to_bytes(8, "little"), 0)
        found = ""
        try:
            kind, outcome = inputs.read(number)
        except Exception as error:
            kind, outcome = inputs.chosen(number)[0], "exception"
            found = f"{kind}: {type(error).__name__} at {_place(error)}"
        if warned:
            found = found or f"{kind}: {warned[0]}"
            warned.clear()
        now = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        if now > peak + GROWTH:
            found = found or f"{kind}: memory grew by more than {GROWTH >> 10} MB"
        peak = max(peak, now)
        if outcome == "out of memory":
            found = found or f"{kind}: out of memory"
        counts = tally.setdefault(kind, {})
        counts[outcome] = counts.get(outcome, 0) + 1
        if found:
            findings.setdefault(found, []).append(number)
        if (number - first) % 500 == 499 or found or number == first + count - 1:
            _save(folder / "so-far", {"next": number + 1, "tally": tally, "findings": findings})


def _place(error: BaseException) -> str:
    frames = traceback.extract_tb(error.__traceback__)
    ours = [frame for frame in frames if "hmrf_icp" in frame.filename] or list(frames)
    return f"{Path(ours[-1].filename).name}:{ours[-1].lineno} ({str(error)[:60]})"


def _save(path: Path, content: Any) -> None:
    partial = path.with_suffix(".partial")
    partial.write_text(json.dumps(content))
    partial.replace(path)


# ---- The process that watches ------------------------------------------------------------------


def watch(state: dict[str, Any], until: int, save: Callable[[], None]) -> None:
    """Go on from the state until so many inputs are done."""
    begun, before = time.monotonic(), state["seconds"]
    while state["next"] < until:
        first = state["next"]
        count = min(BATCH, until - first)
        with tempfile.TemporaryDirectory(dir=_memory_disk()) as name:
            _batch(state, first, count, Path(name))
        state["seconds"] = before + time.monotonic() - begun
        save()


def _memory_disk() -> str | None:
    return "/dev/shm" if os.access("/dev/shm", os.W_OK) else None


def _batch(state: dict[str, Any], first: int, count: int, folder: Path) -> None:
    command = [sys.executable, __file__, "--child", str(first), "--count", str(count)]
    command += ["--seed", str(state["seed"]), "--folder", str(folder)]
    command += ["--kinds", ",".join(state["kinds"])] if state["kinds"] else []
    one_thread = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    # libtiff says on stderr what it thinks of a file.
    process = subprocess.Popen(command, env={**os.environ, **one_thread}, stderr=subprocess.DEVNULL)
    at, since, work, killed = -1, time.monotonic(), 0.0, False
    try:
        while process.poll() is None:
            time.sleep(0.05)
            now = _at(folder)
            if now != at:
                at, since, work = now, time.monotonic(), _worked(process.pid)
            elif time.monotonic() - since > SILENCE or _worked(process.pid) - work > WORK:
                process.kill()
                killed = True
                process.wait()
    finally:
        process.kill()
        process.wait()
    done = {"next": first, "tally": {}, "findings": {}}
    if (folder / "so-far").exists():
        done = json.loads((folder / "so-far").read_text())
    _add(state, done)
    state["next"] = done["next"]
    if process.returncode == 0:
        return
    at = _at(folder)
    if at < 0:
        raise RuntimeError(f"the process that reads did not start (status {process.returncode})")
    what = "without an end" if killed else f"killed by {_signal(process.returncode)}"
    from inputs import Inputs

    with tempfile.TemporaryDirectory() as name:
        kind, _, _ = Inputs(state["seed"], Path(name), state["kinds"]).chosen(at)
    _add(state, {"tally": {kind: {what: 1}}, "findings": {f"{kind}: {what}": [at]}})
    # Those between the last save and the one that killed are read again, without it.
    if at > state["next"]:
        with tempfile.TemporaryDirectory(dir=_memory_disk()) as name:
            _batch(state, state["next"], at - state["next"], Path(name))
    state["next"] = at + 1


def _at(folder: Path) -> int:
    try:
        return int.from_bytes((folder / "at").read_bytes(), "little")
    except OSError:
        return -1


def _worked(process: int) -> float:
    """Seconds of a processor that a process has had."""
    try:
        words = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def _signal(status: int) -> str:
    return signal.Signals(-status).name if status < 0 else f"status {status}"


def _add(state: dict[str, Any], done: dict[str, Any]) -> None:
    for kind, counts in done["tally"].items():
        mine = state["tally"].setdefault(kind, {})
        for outcome, number in counts.items():
            mine[outcome] = mine.get(outcome, 0) + number
    for what, numbers in done["findings"].items():
        mine = state["findings"].setdefault(what, {"count": 0, "first": []})
        mine["count"] += len(numbers)
        mine["first"] = [*mine["first"], *numbers][:KEPT]


def table(state: dict[str, Any]) -> str:
    """Write what was found, as Markdown."""
    outcomes = ["read", "refused"]
    outcomes += sorted({o for counts in state["tally"].values() for o in counts} - {*outcomes})
    lines = ["| kind | inputs | " + " | ".join(outcomes) + " |"]
    lines.append("|---" + "|---:" * (len(outcomes) + 1) + "|")
    rows = sorted(state["tally"].items())
    total = {o: sum(counts.get(o, 0) for _, counts in rows) for o in outcomes}
    for kind, counts in [*rows, ("all", total)]:
        cells = [sum(counts.values()), *(counts.get(o, 0) for o in outcomes)]
        lines.append(f"| {kind} | " + " | ".join(f"{n:,}" for n in cells) + " |")
    lines += ["", f"seed {state['seed']}, {state['seconds']:.0f} s"]
    for what, found in sorted(state["findings"].items()):
        lines.append(f"- {found['count']} x {what}; inputs {found['first']}")
    return "\n".join(lines)


def main() -> int:
    """Read the command line and do it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=20_000, help="inputs in all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--state", type=Path, help="file to go on from, and to keep it in")
    parser.add_argument("--show", type=int, metavar="N", help="read input N here")
    parser.add_argument(
        "--kinds", type=lambda text: text.split(","), default=[], help="of these alone: las,laz"
    )
    parser.add_argument("--child", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--folder", type=Path, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.child is not None:
        child(asked.seed, asked.child, asked.count, asked.folder, asked.kinds)
        return 0
    if asked.show is not None:
        from inputs import Inputs

        folder = Path(tempfile.mkdtemp())
        print(folder, *Inputs(asked.seed, folder, asked.kinds).read(asked.show))
        return 0
    # Asked to end, it takes the process that reads with it.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    state = {"seed": asked.seed, "next": 0, "seconds": 0.0, "tally": {}, "findings": {}}
    state["kinds"] = asked.kinds
    if asked.state is not None and asked.state.exists():
        state = json.loads(asked.state.read_text())
        if (state["seed"], state.setdefault("kinds", [])) != (asked.seed, asked.kinds):
            parser.error(f"{asked.state} is of seed {state['seed']} and kinds {state['kinds']}")
    watch(state, asked.count, lambda: asked.state and _save(asked.state, state))
    print(table(state))
    return 1 if state["findings"] else 0


if __name__ == "__main__":
    sys.exit(main())
