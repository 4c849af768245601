"""Whoever evaluates a sequence by its name sees it being fetched."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

import pytest
from loopback import Host
from typer.testing import CliRunner

from hmrf_icp.cli import app
from hmrf_icp.cli.evaluation_bar import EvaluationBar
from hmrf_icp.evaluate import Configuration, evaluate

pytest.importorskip("joblib")


def stages(told: list[tuple[str, int, int | None]]) -> list[str]:
    return [stage for stage, _ in groupby(told, key=lambda one: one[0])]


def test_an_evaluation_tells_of_the_download_before_anything_else(
    named: str, host: Host, tgz: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    configuration = Configuration(
        named, methods=("all",), peers=(), axes=1, subsample=4, targets=(1,)
    )
    told: list[tuple[str, int, int | None]] = []
    with EvaluationBar() as bar:

        def tell(stage: str, done: int, total: int | None) -> None:
            told.append((stage, done, total))
            bar(stage, done, total)

        evaluate(configuration, tmp_path / "out", workers=1, on_progress=tell)
    fetching = ["Downloading", "Unpacking"]
    working = ["Measuring overlaps", "Registering"]
    assert stages(told) == fetching + working
    assert ("Downloading", len(tgz), len(tgz)) in told
    size = f"{len(tgz) / 1000:.1f} kB"
    assert f"Downloading: {size} of {size}" in capsys.readouterr().err.splitlines()

    told.clear()
    evaluate(
        configuration, tmp_path / "again", workers=1, on_progress=lambda *one: told.append(one)
    )
    assert stages(told) == working
    assert len(host.asked) == 1


def test_methods_that_nobody_knows_are_refused_before_anything_is_fetched(
    named: str, host: Host, tmp_path: Path
) -> None:
    done = CliRunner().invoke(
        app, ["evaluate", named, "--methods", "hrmf", "--output", str(tmp_path / "out")]
    )
    assert done.exit_code == 2
    assert "hrmf" in done.stderr
    assert host.asked == []


def test_on_a_terminal_bytes_and_pieces_are_told_apart(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    with EvaluationBar() as bar:
        bar("Downloading", 172_000_000, 344_000_000)
        bar("Unpacking", 1_000_000, None)
        bar("Registering", 3, 12)
    shown = capsys.readouterr().err
    assert "172.0/344.0 MB" in shown
    assert "1.0/? MB" in shown
    assert " 3/12" in shown
