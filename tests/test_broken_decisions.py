"""``benchmarks/broken_decisions.py`` breaks what is there, and asks tests that there are."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SCRIPT = ROOT / "benchmarks" / "broken_decisions.py"

pytestmark = pytest.mark.skipif(not SCRIPT.exists(), reason="tests run without the repository")


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location("broken_decisions", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    before = list(sys.path)
    spec.loader.exec_module(module)
    yield module
    sys.path[:] = before
    for name in [name for name in sys.modules if name.partition(".")[0] == "decisions"]:
        del sys.modules[name]
    del sys.modules[spec.name]


def test_every_decision_is_there_once_and_breaks_into_code(script):
    decisions = [one for _, _, one in script.chosen([], 0, 0)]
    assert len(decisions) > 200
    assert len({one.name for one in decisions}) == len(decisions)
    for one in decisions:
        compile(script.broken(one), one.file, "exec")


def test_the_tests_that_should_notice_exist(script):
    for _, _, one in script.chosen([], 0, 0):
        assert one.tests
        for test in one.tests:
            file, _, name = test.partition("::")
            assert (ROOT / "tests" / file).exists(), f"{one.name}: {file}"
            told = (ROOT / "tests" / file).read_text(encoding="utf-8")
            assert f"def {name}" in told, f"{one.name}: {test}"


def test_a_text_that_is_gone_is_said_to_be(script):
    _, _, one = next(script.chosen([], 0, 0))
    gone = type(one)(one.name, one.decides, one.file, "no such text", "", one.tests)
    with pytest.raises(ValueError, match="0 times in"):
        script.broken(gone)


def test_a_broken_kernel_takes_those_that_call_it_along(script):
    assert {"table", "candidates", "poses"} <= script.callers("table")
    assert "em" not in script.callers("table")


def test_the_table_counts_and_names_what_nobody_noticed(script):
    _, room, one = next(script.chosen([], 0, 0))
    said = script.table(
        [script.Outcome(room, one.name, found, "", 1.0, "") for found in ("noticed", "unnoticed")]
    )
    assert f"| {room} | 2 | 1 | {one.name} |" in said
    assert "| all | 2 | 1 | 1 |" in said
