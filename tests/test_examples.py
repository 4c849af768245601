"""The examples run: those of the docstrings print what they say, those of the folder find poses."""

from __future__ import annotations

import doctest
import importlib
import importlib.util
import inspect
import pkgutil
import runpy
from pathlib import Path

import pytest

import hmrf_icp
from hmrf_icp import se3

MODULES = sorted(
    module.name
    for module in pkgutil.walk_packages(hmrf_icp.__path__, "hmrf_icp.")
    if not module.name.startswith(("hmrf_icp.cli", "hmrf_icp.kernels", "hmrf_icp.__main__"))
)


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_a_module_hold(name):
    outcome = doctest.testmod(importlib.import_module(name))
    assert outcome.failed == 0


def test_the_front_of_the_package_is_its_interface_and_nothing_else():
    assert set(dir(hmrf_icp)) == {*hmrf_icp.__all__, "__version__"}
    assert all(getattr(hmrf_icp, name).__doc__ for name in hmrf_icp.__all__)


@pytest.mark.parametrize("name", sorted(set(hmrf_icp.__all__) - {"presets"}))
def test_what_the_front_shows_has_an_example(name):
    shown = getattr(hmrf_icp, name)
    raised = isinstance(shown, type) and issubclass(shown, (Exception, Warning))
    assert raised or "\n>>> " in inspect.cleandoc(shown.__doc__)


EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
NEEDS = {
    "open3d_three_lines": "open3d",
    "own_method": "joblib",
}
"""What an example needs beside the package itself."""


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Run an example in a folder of its own, and return its names."""

    def run(name):
        needs = NEEDS.get(name)
        if needs is not None and importlib.util.find_spec(needs) is None:
            pytest.skip(f"needs {needs}")
        monkeypatch.chdir(tmp_path)
        return runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")

    return run


def off(names, truth):
    """Metres and radians by which the result of an example is off."""
    return se3.error(names["result"].transformation, truth)


def between(names, one, other):
    """The true pose between two of the views that an example rendered."""
    return se3.inverse(names["poses"][other]) @ names["poses"][one]


@pytest.mark.parametrize("name", ["two_depth_maps", "open3d_three_lines"])
def test_two_views_are_registered(run, name):
    names = run(name)
    assert names["result"].believed
    assert max(off(names, between(names, 16, 0))) < 0.005


def test_two_files_from_nowhere_are_registered_in_their_own_unit(run):
    names = run("two_files_from_nowhere")
    metric = between(names, 14, 0)
    metric[:3, 3] *= 1000.0
    truth = names["frames"][1] @ metric @ se3.inverse(names["frames"][0])
    centre = names["points"].mean(axis=0)
    moved = se3.transform(names["result"].transformation @ se3.inverse(truth), centre)
    assert names["result"].believed
    assert abs(moved - centre).max() < 20.0  # millimetres
    assert off(names, truth)[1] < 0.005


def test_two_turns_of_a_lidar_are_registered(run):
    names = run("lidar_pair")
    assert names["result"].believed
    assert max(off(names, se3.inverse(names["first"]) @ names["second"])) < 0.01


def test_a_part_is_laid_on_its_model_and_shows_what_was_made_wrong(run):
    names = run("scan_to_cad")
    assert names["result"].believed
    assert max(off(names, names["view"])) < 0.01
    assert 0.3 < names["found"].share_within < 0.98
    assert Path("deviation.png").is_file()


def test_a_walk_is_followed(run):
    names = run("frame_to_frame")
    assert names["breaks"] == []
    assert names["metres"] < 0.03


def test_a_method_of_ones_own_stands_beside_the_default(run, capsys):
    run("own_method")
    assert "robust" in capsys.readouterr().out
    assert Path("evaluation/results.csv").is_file()


@pytest.mark.skipif(not EXAMPLES.exists(), reason="tests run without the repository")
def test_every_example_is_short_and_has_a_test():
    tested = {"two_depth_maps", "open3d_three_lines", "two_files_from_nowhere", "lidar_pair"}
    tested |= {"scan_to_cad", "frame_to_frame", "own_method"}
    assert {path.stem for path in EXAMPLES.glob("*.py")} == tested
    for path in EXAMPLES.glob("*.py"):
        assert len(path.read_text(encoding="utf-8").splitlines()) < 50
