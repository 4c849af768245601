"""The command as a program: help, version, exit status, pipes and interrupts."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

import hmrf_icp
from hmrf_icp.cli import main


def program(*arguments, **options):
    return subprocess.run(
        [sys.executable, "-m", "hmrf_icp", *arguments],
        capture_output=True,
        text=True,
        env={**os.environ, "COLUMNS": "80", "NO_COLOR": "1"},
        check=False,
        **options,
    )


@pytest.mark.parametrize("option", ["--version", "-V"])
def test_version(option):
    done = program(option)
    assert (done.returncode, done.stdout) == (0, f"hmrf-icp {hmrf_icp.__version__}\n")


def test_help_fits_a_terminal_and_names_every_option():
    done = program("register", "--help")
    assert done.returncode == 0
    assert max(map(len, done.stdout.splitlines())) <= 80
    for option in (
        "SOURCE",
        "TARGET",
        "--camera",
        "--intrinsics",
        "--depth-scale",
        "--init",
        "--preset",
        "--rejector",
        "--max-depth",
        "--viewpoint",
        "--output",
        "--figure",
        "--json",
    ):
        assert option in done.stdout
    for name in (*hmrf_icp.presets.names(), *hmrf_icp.presets.rejector_names()):
        assert name in done.stdout


def test_usage_errors_are_status_2():
    for arguments in (("register",), ("register", "a", "b", "--nonsense"), ("nonsense",)):
        done = program(*arguments)
        assert done.returncode == 2
        assert done.stdout == ""
        assert "Traceback" not in done.stderr


def test_help_loads_nothing_heavy():
    script = (
        "import sys, hmrf_icp.cli; "
        "print({'numba', 'scipy', 'matplotlib', 'PIL', 'pykdtree'} & set(sys.modules))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "set()"


@pytest.fixture
def failing(monkeypatch):
    """Make ``hmrf-icp register a b`` raise something; return its exit status."""

    def run(error):
        def raise_it(*_):
            raise error

        monkeypatch.setattr("hmrf_icp.presets.preset", raise_it)
        monkeypatch.setattr(sys, "argv", ["hmrf-icp", "register", "a", "b"])
        with pytest.raises(SystemExit) as stop:
            main()
        return stop.value.code

    return run


def test_an_interrupt_is_status_130(failing, capsys):
    assert failing(KeyboardInterrupt()) == 130
    assert capsys.readouterr() == ("", "Interrupted.\n")


def test_a_message_of_several_lines_becomes_one_paragraph(failing, capsys):
    assert failing(hmrf_icp.InputError("a.png: torn\n  in half")) == 2
    assert capsys.readouterr().err == "Error: a.png: torn   in half\n"


def test_an_error_of_the_system_names_its_file(failing, capsys):
    assert failing(PermissionError(13, "Permission denied", "out.ply")) == 2
    assert capsys.readouterr().err == "Error: out.ply: Permission denied\n"


def test_a_missing_library_is_named_with_its_command(failing, capsys):
    error = hmrf_icp.MissingDependencyError("needs open3d: pip install 'hmrf-icp[peers]'")
    assert failing(error) == 2
    assert "pip install 'hmrf-icp[peers]'" in capsys.readouterr().err


def test_a_mistake_of_the_program_keeps_its_traceback(monkeypatch):
    monkeypatch.setattr("hmrf_icp.presets.preset", lambda name: name.nonsense)
    monkeypatch.setattr(sys, "argv", ["hmrf-icp", "register", "a", "b"])
    with pytest.raises(AttributeError):
        main()


@pytest.mark.skipif(os.name != "posix", reason="pipes of POSIX")
def test_a_reader_that_leaves_is_no_error():
    reader, writer = os.pipe()
    os.close(reader)
    script = (
        "import hmrf_icp.cli as cli, typer\n"
        "cli.app.command('chatter')(lambda: [typer.echo('x' * 1000) for _ in range(1000)])\n"
        "cli.main()\n"
    )
    with os.fdopen(writer, "w") as out:
        done = subprocess.run(
            [sys.executable, "-c", script, "chatter"],
            stdout=out,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert (done.returncode, done.stderr) == (141, "")
