"""``hmrf-icp view`` takes what ``hmrf-icp register`` takes, of one pair."""

from __future__ import annotations

import importlib

import numpy as np
import pytest
from typer.testing import CliRunner

from hmrf_icp import PointCloud
from hmrf_icp.cli import app
from hmrf_icp.io import write_cloud

view = importlib.import_module("hmrf_icp.cli.view")


@pytest.fixture
def run(monkeypatch, tmp_path):
    points = np.random.default_rng(0).uniform(size=(1500, 3)) * [1.0, 0.7, 0.0]
    points[:, 2] = 0.1 * np.sin(7.0 * points[:, 0]) * np.cos(9.0 * points[:, 1])
    for name in ("a.ply", "b.ply"):
        write_cloud(tmp_path / name, PointCloud(points))
    monkeypatch.chdir(tmp_path)
    served = []
    monkeypatch.setattr(view, "serve_story", lambda story, port, **_: served.append(port))

    def command(*arguments):
        return CliRunner().invoke(app, ["view", *arguments]), served

    return command


def test_two_files_are_registered_and_served(run):
    done, served = run("a.ply", "b.ply", "--preset", "paper", "--rejector", "all", "--port", "7")
    assert done.exit_code in (0, 1), done.output
    assert "a.ply to b.ply" in done.stdout
    assert served == [7]


def test_what_is_for_many_pairs_is_not_taken(run):
    for arguments in ((".", "b.ply"), ("a.ply", "b.ply", "--table", "t.csv"), ("a.ply",)):
        done, served = run(*arguments)
        assert done.exit_code == 2
        assert not served
