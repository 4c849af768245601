"""Break the decisions of the package one at a time, and see which test notices.

    python benchmarks/broken_decisions.py --results broken.json --markdown broken.md

A suite that passes whatever the code does guards nothing. ``decisions/`` lists what the default
and the paper's loop decide, each with a change that breaks it; here each is made in a copy of
the package, the tests that should notice run on that copy, and the first that fails is told.
Without any, nobody would have seen that decision go. The same command goes on where it was
stopped, and runs again what has changed since: the decision, its file, or its tests.

Before anything is broken the named tests run on the copy as it is: one that fails there is left
out, and said to be. That also compiles the kernels, which are compiled again for a broken one and
for those that call it.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import os
import queue
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from decisions import Decision, rooms

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "hmrf_icp"
TESTS = ROOT / "tests"

LIMIT = 600.0
"""Seconds after which tests are stopped; that counts as noticed by nobody."""

STOPPED = (signal.SIGINT, signal.SIGKILL, signal.SIGTERM)
"""Signals that say nothing of the decision: somebody else ended the tests, which run again."""

FAILED = r"^(?:FAILED|ERROR) tests/(.+?)(?: - .*)?$"

REST = ("cli", "io", "datasets", "evaluate")
"""Rooms of tests that ``--whole`` leaves out: they say nothing of registration."""


@dataclass(frozen=True)
class Outcome:
    """What came of breaking one decision.

    Attributes
    ----------
    room, name
        Which.
    found
        ``"noticed"``, ``"unnoticed"``, ``"limit"``, or ``"invalid"`` where no test could run.
    by
        The test that noticed first.
    seconds
        That it took.
    state
        Fingerprint of the decision, its file and its tests.
    """

    room: str
    name: str
    found: str
    by: str
    seconds: float
    state: str


def broken(decision: Decision, package: Path = PACKAGE) -> str:
    """Return the text of a decision's file with the decision broken.

    Raises
    ------
    ValueError
        Its text is not there exactly once.
    """
    text = (package / decision.file).read_text(encoding="utf-8")
    times = text.count(decision.old)
    if times != 1:
        raise ValueError(f"{decision.name}: its text is {times} times in {decision.file}, not once")
    return text.replace(decision.old, decision.new)


def existing(tests: Iterable[str]) -> list[str]:
    """Give the tests that there are, as pytest takes them."""
    return [f"tests/{test}" for test in tests if (TESTS / test.partition("::")[0]).exists()]


def fingerprint(decision: Decision, whole: bool) -> str:
    """Tell one state of a decision, its file and its tests from another."""
    files = [PACKAGE / decision.file]
    files += [ROOT / test.partition("::")[0] for test in existing(decision.tests)]
    digest = hashlib.sha256(repr((decision, whole)).encode())
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def callers(kernel: str) -> set[str]:
    """Names of the kernel files that hold code of one, itself included."""
    uses: dict[str, set[str]] = {}
    for path in (PACKAGE / "kernels").glob("*.py"):
        names = set()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module == "hmrf_icp.kernels":
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("hmrf_icp.k"):
                names.add(str(node.module).rpartition(".")[2])
        uses[path.stem] = names
    found = {kernel}
    while True:
        more = {name for name, names in uses.items() if names & found} - found
        if not more:
            return found
        found |= more


class Copy:
    """A copy of the package that is broken and mended, with a cache of its compiled kernels."""

    def __init__(self, folder: Path, seed: int) -> None:
        self._folder, self._seed = folder, seed
        self._cache = folder / "numba"
        self.left_out: list[str] = []
        shutil.rmtree(folder / "src", ignore_errors=True)
        # Times of the files as they are: compiled kernels are known by them.
        shutil.copytree(
            PACKAGE, folder / "src" / "hmrf_icp", ignore=shutil.ignore_patterns("__pycache__")
        )

    def failing(self, tests: list[str]) -> list[str]:
        """Run tests on the copy as it is, and name those that will say nothing."""
        done = self._pytest([*tests, "--maxfail=50"], self._cache, 6.0 * LIMIT)
        if done.returncode not in (0, 1):
            raise SystemExit(
                f"the tests do not run on the package as it is:\n{done.stdout[-2000:]}"
            )
        return re.findall(FAILED, done.stdout, re.MULTILINE)

    def noticed(self, decision: Decision, number: int, whole: bool) -> tuple[str, str]:
        """Break a decision, run its tests, and mend it."""
        file = self._folder / "src" / "hmrf_icp" / decision.file
        original = PACKAGE / decision.file
        file.write_text(broken(decision), encoding="utf-8")
        # No two breaks of a file have the same time: byte code is known by it, to a second.
        when = original.stat().st_mtime + 10.0 * (number + 1)
        os.utime(file, (when, when))
        try:
            with self._cache_without(decision.file) as cache:
                found = self._run(existing(decision.tests), cache, LIMIT)
                if found[0] == "unnoticed" and whole:
                    rest = [f"--ignore=tests/{room}" for room in REST]
                    found = self._run(["tests", *rest], cache, 3.0 * LIMIT)
                return found
        finally:
            shutil.copy2(original, file)

    def _cache_without(self, file: str) -> CacheWithout:
        kernel = file.startswith("kernels/")
        return CacheWithout(self._cache, callers(Path(file).stem) if kernel else set())

    def _run(self, tests: list[str], cache: Path, limit: float) -> tuple[str, str]:
        if not tests:
            return "unnoticed", ""
        left_out = [f"--deselect=tests/{test}" for test in self.left_out]
        try:
            done = self._pytest(["-x", *left_out, *tests], cache, limit)
        except subprocess.TimeoutExpired:
            return "limit", ""
        if done.returncode == 0:
            return "unnoticed", ""
        failed = re.search(FAILED, done.stdout, re.MULTILINE)
        if done.returncode == 1 and failed:
            return "noticed", failed[1]
        if done.returncode < 0 and -done.returncode not in STOPPED:
            return "noticed", f"the process ended with signal {-done.returncode}"
        return "invalid", (done.stdout + done.stderr)[-300:]

    def _pytest(
        self, arguments: list[str], cache: Path, limit: float
    ) -> subprocess.CompletedProcess[str]:
        environment = os.environ | {
            "PYTHONPATH": str(self._folder / "src"),
            "NUMBA_CACHE_DIR": str(cache),
            "HYPOTHESIS_STORAGE_DIRECTORY": str(self._folder / "hypothesis"),
            "OMP_NUM_THREADS": "1",
            "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",
        }
        command = [sys.executable, "-m", "pytest", "-q", "--tb=no", "-p", "no:cacheprovider"]
        command += ["-p", "_hypothesis_pytestplugin", f"--hypothesis-seed={self._seed}"]
        command += ["-m", "not shared", "-W", "ignore", *arguments]
        shutil.rmtree(self._folder / "hypothesis", ignore_errors=True)
        return subprocess.run(
            command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=limit
        )


class CacheWithout:
    """A cache of compiled kernels as it is, or a copy without the files of some kernels."""

    def __init__(self, cache: Path, kernels: set[str]) -> None:
        self._cache, self._kernels = cache, kernels
        self._temporary: Path | None = None

    def __enter__(self) -> Path:
        if not self._kernels:
            return self._cache
        self._temporary = Path(tempfile.mkdtemp(dir=self._cache.parent))
        for path in self._cache.rglob("*.nb?"):
            if path.name.partition(".")[0] not in self._kernels:
                place = self._temporary / path.relative_to(self._cache)
                place.parent.mkdir(parents=True, exist_ok=True)
                os.link(path, place)
        return self._temporary

    def __exit__(self, *_: object) -> None:
        if self._temporary is not None:
            shutil.rmtree(self._temporary, ignore_errors=True)


def chosen(names: list[str], sample: int, seed: int) -> Iterator[tuple[int, str, Decision]]:
    """Go through the decisions asked for: number, room, decision."""
    every = [(room, one) for room, decisions in rooms().items() for one in decisions]
    numbers = list(range(len(every)))
    if names:
        numbers = [
            k
            for k in numbers
            if any(
                name in " ".join((every[k][0], every[k][1].name, every[k][1].file))
                for name in names
            )
        ]
    if sample:
        numbers = sorted(random.Random(seed).sample(numbers, min(sample, len(numbers))))
    for k in numbers:
        yield k, *every[k]


def table(outcomes: list[Outcome]) -> str:
    """Say in Markdown how many were noticed in each room, and which were not."""
    lines = ["| room | decisions broken | noticed | unnoticed |", "|---|---|---|---|"]
    for room in [*rooms(), "all"]:
        here = [one for one in outcomes if room in (one.room, "all")]
        if here:
            noticed = sum(one.found == "noticed" for one in here)
            rest = "; ".join(
                one.name + ("" if one.found == "unnoticed" else f" ({one.found})")
                for one in here
                if one.found != "noticed"
            )
            names = f"{len(here) - noticed}" if room == "all" else rest or "-"
            lines.append(f"| {room} | {len(here)} | {noticed} | {names} |")
    return "\n".join(lines)


def run(arguments: argparse.Namespace) -> list[Outcome]:
    """Break what was asked for, but for what is done."""
    before = {}
    if arguments.results.exists():
        before = {one["name"]: Outcome(**one) for one in json.loads(arguments.results.read_text())}
    outcomes: dict[str, Outcome] = dict(before)
    to_do = []
    for number, room, decision in chosen(arguments.only, arguments.sample, arguments.seed):
        broken(decision)
        state = fingerprint(decision, arguments.whole)
        done = before.get(decision.name)
        if done is None or done.state != state or done.found == "invalid":
            to_do.append((number, room, decision, state))
    folder = arguments.work or Path(tempfile.mkdtemp(prefix="broken-decisions-"))
    copies: queue.Queue[Copy] = queue.Queue()
    tests = sorted({test for _, _, one, _ in to_do for test in existing(one.tests)})
    left_out: list[str] = []
    for worker in range(arguments.jobs if to_do else 0):
        copy = Copy(folder / f"copy-{worker}", arguments.seed)
        if worker == 0 and not arguments.unchecked:
            left_out = copy.failing(tests)
            for test in left_out:
                print(f"left out, it fails on the package as it is: {test}", flush=True)
        copy.left_out = left_out
        copies.put(copy)

    def one(entry: tuple[int, str, Decision, str]) -> Outcome:
        number, room, decision, state = entry
        copy = copies.get()
        started = time.perf_counter()
        try:
            found, by = copy.noticed(decision, number, arguments.whole)
        finally:
            copies.put(copy)
        return Outcome(room, decision.name, found, by, time.perf_counter() - started, state)

    with ThreadPoolExecutor(arguments.jobs) as pool:
        for outcome in pool.map(one, to_do):
            outcomes[outcome.name] = outcome
            print(f"{outcome.found:9} {outcome.seconds:5.0f} s  {outcome.name}: {outcome.by}")
            sys.stdout.flush()
            partial = arguments.results.with_suffix(".partial")
            partial.write_text(json.dumps([asdict(each) for each in outcomes.values()], indent=1))
            partial.replace(arguments.results)
    if arguments.work is None:
        shutil.rmtree(folder, ignore_errors=True)
    order = [decision.name for _, _, decision in chosen([], 0, 0)]
    return sorted((o for n, o in outcomes.items() if n in order), key=lambda o: order.index(o.name))


def main() -> None:
    """Read the command line, break, and say what came of it."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--results", type=Path, default=Path("broken-decisions.json"))
    parser.add_argument("--markdown", type=Path, help="write the table there as well")
    parser.add_argument(
        "--only", nargs="*", default=[], help="rooms, files, names, or parts of one"
    )
    parser.add_argument("--sample", type=int, default=0, help="so many, drawn by --seed")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--whole", action="store_true", help="the rest of the suite where need be")
    parser.add_argument("--work", type=Path, help="keep copies and compiled kernels there")
    parser.add_argument("--unchecked", action="store_true", help="the tests are known to pass")
    arguments = parser.parse_args()
    said = table(run(arguments))
    print("\n" + said)
    if arguments.markdown is not None:
        arguments.markdown.write_text(said + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
