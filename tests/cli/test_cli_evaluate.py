from __future__ import annotations

import csv
import importlib
import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from hmrf_icp.cli import app
from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.synthetic.render import render
from hmrf_icp.synthetic.scenes import look_at, tabletop

pytest.importorskip("joblib")

runner = CliRunner()


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("table")
    camera = PinholeCamera(40, 30, 36.0, 36.0, 19.5, 14.5)
    for k in range(5):
        pose = look_at((0.1 * k, -1.0, 1.25), (0.15 * k, 0.0, 0.75))
        depth = 1000 * np.nan_to_num(render(tabletop(), camera, pose))
        Image.fromarray(depth.astype(np.uint16)).save(folder / f"frame-{k:06d}.depth.png")
        np.savetxt(folder / f"frame-{k:06d}.pose.txt", pose, fmt="%.12g")
    np.savetxt(folder / "camera-intrinsics.txt", camera.matrix)
    return folder


def test_one_command_makes_results_and_a_report(recording: Path, tmp_path: Path):
    output = tmp_path / "out"
    arguments = ["evaluate", str(recording), "--output", str(output), "--methods", "all,x84"]
    arguments += ["--peers", "none", "--axes", "2", "--frames-per-decile", "1", "--workers", "1"]
    arguments += ["--angles", "pi/60,2deg+0.01", "--reference-frame", "2"]
    done = runner.invoke(app, arguments)
    assert done.exit_code == 0, done.output
    assert "Share solved" in done.stdout
    assert "x84" in done.stdout
    assert "Registering" not in done.stdout
    assert "Registering" in done.stderr
    with (output / "results.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert {row["method"] for row in rows} == {"all", "x84"}
    assert {(round(float(r["angle"]), 4), float(r["translation"])) for r in rows} == {
        (0.0524, 0.0),
        (0.0349, 0.01),
    }
    assert json.loads((output / "config.json").read_text())["dataset"] == str(recording)
    assert (output / "report.html").is_file()

    again = runner.invoke(app, [*arguments[:-2], "--reference-frame", "1"])
    assert again.exit_code == 2
    assert "targets was [2], is [1]" in again.stderr
    assert "Traceback" not in again.stderr


def test_quick_says_what_it_leaves_out_and_how_long_it_takes_before_it_begins(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(importlib.import_module("hmrf_icp.cli.evaluate"), "_report", print)
    arguments = ["evaluate", str(recording), "-o", str(tmp_path / "out"), "--quick"]
    arguments += ["--pairs", "1", "--methods", "all", "--peers", "none", "--workers", "1"]
    done = runner.invoke(app, arguments)
    assert done.exit_code == 0, done.output
    before, _, _ = done.stderr.partition("Registering: 0")
    assert "--quick: at most 1 pairs, and starts about 1 of 16 axes" in before
    assert re.search(r"1 of \d+ pairs, spread over scenes and overlap; \d+ are left out", before)
    assert "1 runs: 1 pairs, 1 methods; roughly" in before


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--angles", "p/30"], "p/30"),
        (["--methods", "hrmf"], "hrmf"),
        (["--peers", "gicq"], "gicq"),
        (["--reference-frame", "first"], "first"),
        (["--reference-frame", "9"], "no frame 9"),
        (["--axes", "0"], "axes"),
        (["--workers", "0"], "workers"),
        (["--translation", "-1"], "translation"),
    ],
)
def test_a_wrong_argument_is_named_and_nothing_is_written(
    recording: Path, tmp_path: Path, arguments: list[str], said: str
):
    output = tmp_path / "out"
    done = runner.invoke(
        app, ["evaluate", str(recording), "--peers", "none", "--output", str(output), *arguments]
    )
    assert done.exit_code == 2
    assert done.stderr.startswith("Error")
    assert said in done.stderr
    assert not (output / "results.csv").exists()


def test_a_folder_that_is_no_recording_is_told_what_one_looks_like(tmp_path: Path):
    done = runner.invoke(app, ["evaluate", str(tmp_path)])
    assert done.exit_code == 2
    assert "7-Scenes" in done.stderr
