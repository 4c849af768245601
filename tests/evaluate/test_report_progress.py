"""Who waits for a report sees how far it is."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

import pytest
from report_fakes import row, write_folder
from typer.testing import CliRunner

from hmrf_icp.cli import app
from hmrf_icp.evaluate.report import runs, write_report

pytest.importorskip("jinja2")

READING, COMPUTING = "Reading results.csv", "Computing figures and tables"
RUNS = 50


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_folder(tmp_path, [row(method="all", axis=axis) for axis in range(RUNS)])


def test_a_report_tells_how_much_is_read_and_computed(
    folder: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(runs, "LINES_AT_ONCE", 10)
    told: list[tuple[str, int, int | None]] = []
    write_report(folder, worst=0, on_progress=lambda *one: told.append(one))
    stages = {stage: list(those) for stage, those in groupby(told, key=lambda one: one[0])}
    assert list(stages) == [READING, COMPUTING]
    size = (folder / "results.csv").stat().st_size
    read = [done for _, done, _ in stages[READING]]
    assert read == sorted(set(read))
    assert len(read) == 1 + RUNS // 10
    assert read[0] == 0
    assert 0.95 * size < read[-1] < size
    assert {total for _, _, total in stages[READING]} == {size}
    parts = len(stages[COMPUTING])
    assert stages[COMPUTING] == [(COMPUTING, done, parts) for done in range(parts)]


def test_the_command_shows_a_bar_on_a_terminal_and_nothing_in_a_log(
    folder: Path, monkeypatch: pytest.MonkeyPatch
):
    arguments = ["report", str(folder), "--worst", "0"]
    logged = CliRunner().invoke(app, arguments)
    assert logged.exit_code == 0, logged.output
    assert logged.stderr == ""
    assert "report.html" in logged.stdout
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    watched = CliRunner().invoke(app, arguments)
    assert COMPUTING in watched.stderr
    assert watched.stdout == logged.stdout
