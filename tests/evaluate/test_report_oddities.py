"""A report on a folder from elsewhere: odd cells are named or shown as they are, never run into."""

from __future__ import annotations

import csv
import html
import json
import re

import pytest
from report_fakes import row, write_folder

from hmrf_icp import InputError
from hmrf_icp.evaluate.report import write_report
from hmrf_icp.evaluate.report.contents import _run
from hmrf_icp.evaluate.report.page import Section
from hmrf_icp.evaluate.report.published import read_paper_rows
from hmrf_icp.evaluate.report.replay import shown_runs
from hmrf_icp.evaluate.report.study import Study
from hmrf_icp.evaluate.report.tables import Cell, Group, Row, Table
from hmrf_icp.evaluate.report.write import tables_markdown

SCRIPT = "<script>alert(1)</script>"
NAMES = (SCRIPT, "a$b_{$", "_hidden", "=1+1", "a|b", "[red]x[/]", "gicp", "gicp@0.1", "`*_~\\")


def evaluation(folder, config=None, **values):
    runs = [row(axis=0, **values), row(axis=1, error_m=0.5, **values)]
    return write_folder(folder, runs, config)


def test_whatever_a_method_is_called_it_is_shown_as_it_is(tmp_path):
    runs = [
        row(method=name, axis=axis, confidence=0.5, error_m=error, failure="")
        for name in NAMES
        for axis, error in ((0, 0.01), (1, 0.5))
    ]
    runs.append(row(method=SCRIPT, axis=2, error_m="", error_rad="", failure="<img src=x> | $"))
    config = {"dataset": "<b>$kitchen_{$</b>", "notes": [SCRIPT, "\udcff"], "machine": {SCRIPT: 1}}
    report = write_report(write_folder(tmp_path, runs, config))
    page = report.page.read_text(encoding="utf-8")
    tables = report.tables.read_text(encoding="utf-8")
    assert "<script" not in page
    assert "<img src=x>" not in page
    assert not re.search(r"<[a-z/]", tables)
    for name in NAMES:
        assert name.replace("gicp@0.1", "GICP, 0.1").replace("gicp", "GICP") in html.unescape(page)
    assert "\\\\udcff" in tables


def test_a_table_in_markdown_is_no_markup():
    group = Group("", [Row(SCRIPT, [Cell("<img src=x>", detail="a|b\nc")])])
    text = Table("t", "**c**", "method", ["x\ny"], [group]).markdown()
    assert "<" not in text
    assert "x, y" in text
    assert "(a\\|b c)" in text
    assert "\\*\\*c\\*\\*" in text


def test_a_command_stays_inside_its_fence():
    parts = [Section("run", "Run", command="a ```` b", items=[Table("t", "c", "m", [], [])])]
    marks = "`" * 7  # more than any run of them inside
    assert f"{marks}console\n$ a ```` b\n{marks}\n" in tables_markdown("t", [], parts)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"overlap": 7}, "line 2: overlap is 7, expected 0 to 1"),
        ({"overlap": -0.1}, "line 2: overlap is -0.1"),
        ({"angle": -1}, "line 2: angle is -1, expected 0 or more"),
        ({"seconds": -1}, "line 2: seconds is -1"),
        ({"error_rad": -1}, "line 2: error_rad is -1"),
        ({"method": ""}, "line 2: no method"),
        ({"failure": "a" * 200_000}, "cannot be read as results"),
    ],
)
def test_a_number_out_of_its_range_is_named_with_its_line(tmp_path, change, says):
    with pytest.raises(InputError, match=says):
        write_report(evaluation(tmp_path, **change))


def test_results_that_are_no_text(tmp_path):
    path = evaluation(tmp_path) / "results.csv"
    path.write_bytes(path.read_bytes() + b"\xff\n")
    with pytest.raises(InputError, match=r"results\.csv: cannot be read as results"):
        Study.read(tmp_path)


def test_a_configuration_nested_without_end(tmp_path):
    (evaluation(tmp_path) / "config.json").write_text("[" * 100_000)
    with pytest.raises(InputError, match=r"config\.json: not JSON"):
        Study.read(tmp_path)


OK = {"dataset": "synthetic", "subsample": 40, "axes": 2, "seed": 0}


@pytest.mark.parametrize(
    ("change", "config", "says"),
    [
        ({"axis": "x"}, OK, "has the axis"),
        ({"axis": "99"}, OK, "axis 99 of 2"),
        ({"source": "abc"}, OK, "has the source"),
        ({"source": "²"}, OK, "has the source"),
        ({"source": "7" * 30}, OK, "has the source"),
        ({}, OK | {"seed": -1}, "seed -1"),
        ({}, OK | {"axes": 10**11}, "100000000000 axes"),
        ({}, OK | {"subsample": 0}, "step of 0"),
        ({}, OK | {"axes": float("inf")}, "does not say how"),
        ({}, OK | {"dataset": ["a"]}, "data are not at"),
        ({"method": "gone"}, OK, "no method called gone"),
    ],
)
def test_what_cannot_be_drawn_again_is_said(tmp_path, change, config, says):
    cells = {"source": 3, "target": 45, "axis": "0", "error_m": 0.5, "pair": "000045-000003"}
    study = Study.read(write_folder(tmp_path, [row(**cells | change)], config))
    (shown,), reason = shown_runs(study, 1)
    assert shown.drawing is None
    assert reason.startswith("There are no pictures: ")
    assert says in reason


@pytest.mark.parametrize(
    "odd",
    [
        {"notes": 5, "warnings": None, "command": 7},
        {"notes": {"a": [1]}, "skipped": [["b"], None], "command": [None, {"a": 1}]},
        {"nested": json.loads("[" * 200 + "]" * 200), "methods": 3, "peers": [1]},
        {"dataset": None, "versions": [], "two\nlines": "a\nb"},
    ],
)
def test_a_configuration_of_other_shapes_is_written_out(tmp_path, odd):
    section = _run(Study.read(evaluation(tmp_path, odd)))
    assert section.facts
    assert "Left out" not in tables_markdown("t", [], [section])


def test_paper_rows_by_any_name_and_of_any_content(tmp_path):
    path = tmp_path / "my <b>rows $x.csv"
    path.write_text("overlap,all_time,all_t_err,all_r_err\n0.5,1,0.1,0.1\n")
    name = read_paper_rows(path).name
    assert re.fullmatch(r"[\w.-]+", name)
    path.write_bytes(b"overlap,all_time,all_t_err,all_r_err\n\xff,1,0.1,0.1\n")
    with pytest.raises(InputError, match="cannot be read as rows"):
        read_paper_rows(path)
    with path.open("w", newline="") as stream:
        csv.writer(stream).writerow(["overlap", "a" * 200_000])
    with pytest.raises(InputError, match="cannot be read as rows"):
        read_paper_rows(path)
