from __future__ import annotations

import io

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table

from hmrf_icp.cli import tables
from hmrf_icp.cli.tables import Name, fitted, show

NAMES = st.lists(st.text("ab点-7", min_size=1, max_size=30), min_size=1, max_size=6)


@given(NAMES, st.integers(1, 40))
def test_shortened_names_stay_different_and_fit(names, width):
    short = fitted(names, width)
    assert set(short) == set(names)
    assert len(set(short.values())) == len(set(names))
    if any(short[name] != name for name in names):
        assert all(cell_len(text) <= width for text in short.values())


def test_names_lose_their_middle_alone():
    names = ["kitchen-of-the-first-floor-8.ply", "kitchen-of-the-first-floor-9.ply", "b.ply"]
    assert list(fitted(names, 16).values()) == ["kitchen…or-8.ply", "kitchen…or-9.ply", "b.ply"]


def test_names_that_would_become_one_are_left_to_be_folded():
    names = [f"{'a' * 20}{k}{'b' * 20}" for k in range(2)]
    assert fitted(names, 16) == {name: name for name in names}


@pytest.mark.parametrize("width", [30, 60, 80])
def test_numbers_are_never_cut(monkeypatch, width):
    out = io.StringIO()
    monkeypatch.setattr(tables, "console", lambda stderr: Console(file=out, width=width))
    monkeypatch.setenv("COLUMNS", str(width))
    names = [f"{'long' * 20}{k}{'name' * 20}" for k in range(2)]
    table = Table("method", "share solved", "time")
    for name in names:
        table.add_row(Name(name, names), "0.123456789", "123.45 s")
    show(table)
    printed = out.getvalue()
    assert printed.count("0.123456789") == printed.count("123.45 s") == 2
    assert "…" not in printed
    folded = "".join(line.split("│")[1].strip() for line in printed.splitlines() if "│" in line)
    assert folded == "".join(names)
