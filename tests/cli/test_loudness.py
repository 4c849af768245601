"""``--quiet``, ``--verbose``, ``--json``: who says what, and where."""

from __future__ import annotations

import json
import warnings

import numpy as np
import pytest
from typer.testing import CliRunner

import hmrf_icp
from hmrf_icp import PointCloud
from hmrf_icp.cli import app, completion
from hmrf_icp.cli.loudness import is_quiet
from hmrf_icp.cli.progress import registration_bar, told_of_compiling
from hmrf_icp.errors import RegistrationWarning
from hmrf_icp.io import write_cloud
from hmrf_icp.kernels import compilation

FAST = ("--preset", "paper", "--rejector", "all")
COMMANDS = [[], ["demo"], ["register"], ["view"], ["animate"], ["evaluate"], ["report"]]


def run(*arguments, columns=80):
    runner = CliRunner(env={"COLUMNS": str(columns), "NO_COLOR": "1", "TERM": "dumb"})
    return runner.invoke(app, [str(word) for word in arguments])


@pytest.fixture
def files(tmp_path):
    points = np.random.default_rng(0).uniform(size=(1500, 3)) * [1.0, 0.7, 0.0]
    points[:, 2] = 0.1 * np.sin(7.0 * points[:, 0]) * np.cos(9.0 * points[:, 1])
    for name in ("a.ply", "b.ply"):
        write_cloud(tmp_path / name, PointCloud(points))
    return tmp_path / "a.ply", tmp_path / "b.ply"


def test_quiet_leaves_the_exit_status_and_the_json(files):
    done = run("register", *files, "--quiet")
    assert (done.exit_code, done.stdout, done.stderr) == (0, "", "")
    done = run("register", *files, "-q", "--json")
    assert json.loads(done.stdout)["believed"] is True
    assert done.stderr == ""
    assert not is_quiet(), "the next command is as loud as usual"


def test_quiet_still_says_what_is_wrong(files):
    done = run("register", files[0], "nobody.ply", "-q")
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr == "Error: nobody.ply: no such file\n"


def test_quiet_keeps_warnings_to_itself(files, monkeypatch):
    register = hmrf_icp.register

    def warning(*arguments, **options):
        warnings.warn("units?", RegistrationWarning, stacklevel=2)
        return register(*arguments, **options)

    monkeypatch.setattr(hmrf_icp, "register", warning)
    assert "Warning: units?" in run("register", *files, *FAST).stderr
    assert run("register", *files, *FAST, "-q").stderr == ""


def test_verbose_says_each_iteration_and_leaves_stdout_to_the_result(files):
    done = run("register", *files, "-v", "--json", *FAST)
    content = json.loads(done.stdout)
    lines = [line for line in done.stderr.splitlines() if line.startswith("iteration ")]
    assert len(lines) == content["iterations"]
    assert "inliers, step" in lines[0]
    assert "own time" in done.stderr


def test_quiet_and_verbose_are_one_too_many(files):
    done = run("register", *files, "-q", "-v")
    assert done.exit_code == 2
    assert "--quiet and --verbose" in done.stderr


def test_a_quiet_demo_writes_its_picture(tmp_path):
    picture = tmp_path / "demo.svg"
    done = run("demo", "-q", "-o", picture, "--subsample", "16", *FAST)
    assert (done.stdout, done.stderr) == ("", "")
    assert picture.exists()


def test_the_first_compilation_is_said_also_where_there_is_no_bar(monkeypatch, capsys):
    class Compiles(compilation.Compilation):
        def __enter__(self):
            self._on_compile()
            return super().__enter__()

    monkeypatch.setattr(compilation, "Compilation", Compiles)
    with registration_bar() as bar, told_of_compiling(bar):
        pass
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("Note: compiling, once for this version on this machine")


# ---- Help and completion ----------------------------------------------------------------------


@pytest.mark.parametrize("columns", [60, 80])
@pytest.mark.parametrize("command", COMMANDS, ids=lambda words: "".join(words) or "alone")
def test_no_help_is_cut(command, columns):
    done = run(*command, "--help", columns=columns)
    assert done.exit_code == 0
    assert "…" not in done.stdout
    assert "<bool>" not in done.stdout
    assert "Path" not in done.stdout  # a type of Python says nothing to whom it is for
    assert max(map(len, done.stdout.splitlines())) <= columns


@pytest.mark.parametrize("command", COMMANDS[1:], ids=lambda words: words[0])
def test_every_command_can_be_quiet(command):
    assert "--quiet" in run(*command, "-h").stdout


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("hmrf-icp rep", {"report"}),
        ("hmrf-icp register --rejector x", {"x84"}),
        ("hmrf-icp register --aligner plane", {"plane-to-plane"}),
        ("hmrf-icp register --preset pa", {"paper"}),
        ("hmrf-icp register --search n", {"near"}),
        ("hmrf-icp demo --preset r", {"robust"}),
        ("hmrf-icp evaluate --methods robust,x", {"robust,x84"}),
        ("hmrf-icp evaluate --peers o3d-pl", {"o3d-plane"}),
        ("hmrf-icp register --output a", set()),
    ],
)
def test_a_shell_is_told_how_a_word_goes_on(typed, offered):
    asked = {"COMP_WORDS": typed, "COMP_CWORD": str(typed.count(" "))}
    runner = CliRunner(env=asked | {"_HMRF_ICP_COMPLETE": "complete_bash"})
    done = runner.invoke(app, [], prog_name="hmrf-icp")
    assert set(done.stdout.split()) == offered


def test_names_already_listed_are_not_offered_again():
    assert completion.listed(["all", "x84"])("all,") == ["all,x84"]
