"""From one command to a report in a browser, though everything is killed in the middle."""

from __future__ import annotations

import math
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest
from evaluation_fakes import asked, rows

from browsing import browser
from hmrf_icp.evaluate import Start, evaluate
from hmrf_icp.evaluate.peers import FAMILIES

pytest.importorskip("joblib")
pytest.importorskip("jinja2")
if not hasattr(os, "killpg"):
    pytest.skip("needs process groups", allow_module_level=True)

METHODS = ("robust", "hmrf")
PEERS = tuple(
    f"{family.name}@0.1" for family in FAMILIES if family.name == "gicp" and not family.missing
)
AXES, SUBSAMPLE, TARGET = 2, 2, 3


@dataclass(frozen=True)
class Resumed:
    """An evaluation that was killed and begun again with the same command.

    Attributes
    ----------
    folder
        Its results.
    left
        Lines of ``results.csv``, the header not among them, after the kill; the last is torn.
    said
        What the second command wrote to stderr.
    """

    folder: Path
    left: list[bytes]
    said: str


@pytest.fixture(scope="module")
def resumed(recording: Path, tmp_path_factory: pytest.TempPathFactory) -> Resumed:
    folder = tmp_path_factory.mktemp("resumed")
    command = [sys.executable, "-m", "hmrf_icp", "evaluate", str(recording)]
    command += ["--output", str(folder), "--workers", "2", "--reference-frame", str(TARGET)]
    command += ["--methods", ",".join(METHODS), "--peers", ",".join(PEERS) or "none"]
    command += ["--angles", "pi/30", "--axes", str(AXES), "--subsample", str(SUBSAMPLE)]
    command += ["--frames-per-decile", "1"]
    results = folder / "results.csv"
    kill_in_the_middle(command, results)
    tear_last_line(results)
    left = results.read_bytes().splitlines(keepends=True)[1:]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return Resumed(folder, left, done.stderr)


def kill_in_the_middle(command: list[str], results: Path) -> None:
    """Start a command, and kill it with all its workers once there are rows."""
    silent = subprocess.DEVNULL
    with subprocess.Popen(command, stdout=silent, stderr=silent, start_new_session=True) as process:
        try:
            until = time.monotonic() + 300
            while not (results.is_file() and results.read_bytes().count(b"\n") > 2):
                assert process.poll() is None, "it ended before it could be killed"
                assert time.monotonic() < until, "it did not begin"
                time.sleep(0.02)
        finally:
            os.killpg(process.pid, signal.SIGKILL)
    # Nobody of theirs is left to remove what the workers shared.
    for semaphore in Path("/dev/shm").glob(f"sem.loky-{process.pid}-*"):
        semaphore.unlink()


def tear_last_line(path: Path) -> None:
    """Leave of the last whole line its first half."""
    lines = path.read_bytes().splitlines(keepends=True)
    lines = [line for line in lines if line.endswith(b"\n")]
    path.write_bytes(b"".join(lines[:-1]) + lines[-1][: len(lines[-1]) // 2])


def test_a_killed_evaluation_with_a_torn_row_ends_as_one_that_nothing_happened_to(
    recording: Path, resumed: Resumed, tmp_path: Path
):
    found = rows(resumed.folder)
    pairs = (resumed.folder / "pairs.csv").read_bytes()
    assert pairs.count(b"\n") > 3
    total = (pairs.count(b"\n") - 1) * AXES * len(METHODS + PEERS)
    keys = {(row["pair"], row["angle"], row["axis"], row["method"]) for row in found}
    assert len(found) == len(keys) == total
    assert {row["method"] for row in found} == {*METHODS, *PEERS}
    assert {row["failure"] for row in found} == {""}

    *whole, torn = resumed.left
    assert 0 < len(whole) < total
    assert not torn.endswith(b"\n")
    # What was done is not done again: with its seconds, a row is like no other.
    assert f"Registering: {len(whole)} of {total}" in resumed.said
    assert set(whole) <= set((resumed.folder / "results.csv").read_bytes().splitlines(True))

    uninterrupted = asked(
        recording,
        methods=METHODS,
        peers=PEERS,
        targets=(TARGET,),
        starts=(Start(math.pi / 30),),
        axes=AXES,
        subsample=SUBSAMPLE,
    )
    evaluate(uninterrupted, tmp_path, workers=2)
    assert found == rows(tmp_path)
    assert pairs == (tmp_path / "pairs.csv").read_bytes()


def test_its_report_is_whole_in_a_browser(resumed: Resumed):
    drawn = {path.stem for path in (resumed.folder / "figures").iterdir()}
    captions = re.findall(r"^\*\*(.+)\*\*$", (resumed.folder / "tables.md").read_text(), re.M)
    assert len(drawn) >= 5
    assert len(captions) >= 5
    with browser() as chromium:
        chromium.open(resumed.folder / "report.html")
        figures, tables = chromium.figures(), chromium.tables()
        assert sorted(figure.name for figure in figures) == sorted(drawn)
        assert all(figure.own_width > 300 and figure.shown_width > 300 for figure in figures)
        assert sorted(table.caption for table in tables) == sorted(captions)
        assert all(table.rows > 1 and table.height > 20 for table in tables)
        assert chromium.fetched() == []
        assert chromium.complaints() == []
