"""A share of ``benchmarks/fuzz/registrations.py``, which runs many more."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[1] / "benchmarks" / "fuzz" / "registrations.py"


@pytest.fixture(scope="module")
def fuzz():
    spec = importlib.util.spec_from_file_location("fuzz_registrations", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules[spec.name]


@pytest.mark.parametrize("first", [0, 20, 40])
def test_random_geometry_is_registered_or_refused(fuzz, first):
    for number in range(first, first + 20):
        found = fuzz.tried(5, number)
        assert found["found"] in fuzz.FINE, found


@pytest.mark.parametrize(
    ("seed", "number"),
    [
        (0, 7014),
        (0, 8067),
        (0, 8610),
        (1, 3588),
        (1, 4620),
        (1, 4949),
        (2, 7661),
        (3, 15675),
        (3, 21948),
    ],
)
def test_geometry_that_once_raised_an_exception_does_not(fuzz, seed, number):
    assert fuzz.tried(seed, number)["found"] in fuzz.FINE


def test_a_run_goes_on_from_where_it_was(fuzz, tmp_path):
    state = tmp_path / "state.json"
    fuzz.run(5, 2, state)
    assert json.loads(state.read_text())["next"] == 2
    counted = fuzz.run(5, 4, state)
    assert sum(counted["counts"].values()) == counted["next"] == 4
    assert "4 cases of seed 5" in fuzz.table(counted)
    with pytest.raises(SystemExit, match="seed"):
        fuzz.run(6, 5, state)
