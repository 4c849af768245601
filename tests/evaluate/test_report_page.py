"""The report as files: complete, self-contained, the same every time."""

from __future__ import annotations

import base64
import html
import math
import re
import sys
from html.parser import HTMLParser

import pytest
from report_fakes import CONFIG, invented, row, write_folder

from hmrf_icp import InputError, MissingDependencyError
from hmrf_icp.cli import main
from hmrf_icp.evaluate.report import write_report
from hmrf_icp.evaluate.report.page import Section, render_page

FIGURES = {
    "recall-by-overlap",
    "recall-by-start",
    "time-against-recall",
    "roc",
    "reliability",
    "paper-panels-pi-30",
    "paper-panels-pi-6-0.3m",
    "paper-rows-pi-30",
}
TABLES = {
    "recall",
    "recall-by-overlap-pi-30",
    "recall-by-overlap-pi-6-0.3m",
    "accuracy",
    "effort",
    "failures",
    "confidence",
    "published-maxima",
    "paper-rows-error-m-pi-30",
    "paper-rows-error-rad-pi-30",
    "pairs",
    "settings-recall",
    "settings-effort",
}
PAPER_ROWS = (
    "frame,overlap,angle,"
    + ",".join(
        f"{m}_time,{m}_t_err,{m}_r_err" for m in ("all", "pct", "sigma", "x84", "dynamic", "hmrf")
    )
    + "\n"
    + "\n".join(f"1, 0.{d}5, 0.10472" + ", 1.0, 0.02, 0.03" * 6 for d in range(3, 10))
    + "\n"
)


class Reader(HTMLParser):
    """Collects what a browser would show and fetch."""

    def __init__(self, text):
        super().__init__()
        self.ids, self.images, self.links, self.open = [], [], [], []
        self.captions = 0
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        if "id" in attributes:
            self.ids.append(attributes["id"])
        if tag == "img":
            self.images.append(attributes)
        self.links += [value for name, value in attributes.items() if name in ("href", "src")]
        self.captions += tag == "caption"
        if tag not in ("img", "meta", "link"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    folder = tmp_path_factory.mktemp("evaluation")
    rows = invented(pairs=20, axes=1, starts=((math.pi / 30, 0.0), (math.pi / 6, 0.3)))
    write_folder(folder, rows, CONFIG)
    (folder / "rows.csv").write_text(PAPER_ROWS)
    return write_report(folder, paper_csv=[folder / "rows.csv"])


@pytest.fixture(scope="module")
def page(report):
    return report.page.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def read(page):
    return Reader(page)


def small(folder, **values):
    return write_folder(folder, [row(axis=0), row(axis=1, error_m=0.5)], {**CONFIG, **values})


def test_every_figure_and_table_is_on_the_page(read):
    assert set(read.ids) >= FIGURES | TABLES
    assert len(read.ids) == len(set(read.ids))
    assert read.open == []


def test_figures_are_written_as_png_and_svg(report):
    names = {path.name for path in report.figures}
    assert names == {f"{name}{suffix}" for name in FIGURES for suffix in (".png", ".svg")}
    for path in report.figures:
        start = path.read_bytes()[:8]
        assert start == b"\x89PNG\r\n\x1a\n" if path.suffix == ".png" else b"<?xml" in start


def test_the_page_asks_nothing_of_any_other_file_or_server(page, read):
    assert [link for link in read.links if not link.startswith(("#", "data:"))] == []
    assert "url(" not in page
    assert "@import" not in page
    assert "<script" not in page


def test_the_page_shows_the_figures_that_were_written(report, read):
    shown = [base64.b64decode(image["src"].partition(",")[2]) for image in read.images]
    assert len(shown) == len(FIGURES)
    written = {path.read_bytes() for path in report.figures if path.suffix == ".svg"}
    assert set(shown) == written


def test_whoever_cannot_see_the_page_is_told_what_is_on_it(page, read):
    assert all(len(image["alt"]) > 40 for image in read.images)
    assert read.captions == page.count("<table>")
    assert '<html lang="en">' in page


def test_the_page_says_what_was_run_and_what_was_left_out(page):
    assert "hmrf-icp evaluate kitchen-invented --axes 4" in page
    assert "an abacus" in page
    assert "o3d-multiscale: skipped, open3d is not installed" in page
    assert "π/30, π/6 + 0.3 m" in page


def test_without_the_data_the_worst_runs_are_listed_and_the_reason_given(page):
    reasons = re.findall(r'<article class="worst">.*?<strong>(.*?)</strong>', page, re.DOTALL)
    assert 1 < len(reasons) <= 6
    assert all(reason.startswith("Failed with the") for reason in reasons)
    assert "There are no pictures: the data are not at /somewhere/kitchen-invented." in page


def test_the_summary_heads_the_page_and_the_tables(report, page):
    markdown = report.tables.read_text(encoding="utf-8")
    assert "field-gicp solves" in report.summary[1]
    for sentence in report.summary:
        assert sentence in markdown
        assert sentence in html.unescape(page)


def test_tables_are_markdown_with_as_many_cells_as_headings(report):
    lines = report.tables.read_text(encoding="utf-8").splitlines()
    tables = [line for line in lines if line.startswith("|")]
    assert sum(line.startswith("|---") for line in tables) == len(TABLES) + 4
    width = 0
    for line in tables:
        cells = len(re.findall(r"(?<!\\)\|", line))
        follows = lines[lines.index(line) - 1].startswith("|")
        width = width if follows else cells
        assert cells == width, line


def test_the_same_results_give_the_same_files(tmp_path):
    folder = small(tmp_path)
    first = {path.name: path.read_bytes() for path in all_files(folder)}
    second = {path.name: path.read_bytes() for path in all_files(folder)}
    assert first == second


def all_files(folder):
    report = write_report(folder, worst=0)
    return [report.page, report.tables, *report.figures]


def test_what_stands_in_the_files_cannot_become_markup():
    section = Section("run", "What was run", remarks=["a & b <i>"], facts=[("x", "<img src=y>")])
    page = render_page("<script>alert(1)</script>", ["1 < 2"], [section], '"folder"')
    assert "<script" not in page
    assert "<img" not in page
    assert "a &amp; b &lt;i&gt;" in page


def test_a_broken_file_of_the_paper_leaves_the_old_report(tmp_path):
    folder = small(tmp_path)
    (folder / "report.html").write_text("the old one")
    with pytest.raises(InputError, match=r"nothing\.csv"):
        write_report(folder, paper_csv=[folder / "nothing.csv"])
    assert (folder / "report.html").read_text() == "the old one"
    assert not (folder / "figures").exists()


def test_one_method_one_run_and_nothing_else_make_a_report(tmp_path):
    report = write_report(write_folder(tmp_path, [row(method="gicp@0.1")]), worst=0)
    assert "There is no config.json" in report.page.read_text()


def test_no_pose_at_all_makes_a_report(tmp_path):
    lost = {"error_m": "", "error_rad": "", "iterations": "", "failure": "lost"}
    report = write_report(write_folder(tmp_path, [row(**lost)]), worst=2)
    assert "no pose: lost" in report.page.read_text()


def test_without_jinja2_the_command_that_installs_it_is_named(tmp_path, monkeypatch):
    folder = small(tmp_path)
    monkeypatch.setitem(sys.modules, "jinja2", None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'hmrf-icp\[evaluate\]'"):
        write_report(folder)


def run(monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["hmrf-icp", "report", *map(str, arguments)])
    with pytest.raises(SystemExit) as stop:
        main()
    return stop.value.code


def test_the_command_prints_the_summary_and_where_the_page_is(tmp_path, monkeypatch, capsys):
    folder = small(tmp_path)
    assert run(monkeypatch, folder, "--success", "0.6", "--worst", "0") == 0
    printed = capsys.readouterr().out
    assert "HMRF solves 1.00 of its runs" in printed
    assert f"Report: {folder / 'report.html'}" in printed


@pytest.mark.parametrize("success", ["near", "1,2,3", "-1"])
def test_thresholds_that_are_none_are_refused(tmp_path, monkeypatch, capsys, success):
    assert run(monkeypatch, small(tmp_path), f"--success={success}") == 2
    assert "success" in capsys.readouterr().err
