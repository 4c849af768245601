"""The runs of an evaluation in the viewer: the worst first, each registered again when opened."""

from __future__ import annotations

import math
import re

import pytest
from report_fakes import CONFIG, row, write_folder

from hmrf_icp.view.evaluation import EvaluationPages


def order(pages, method="hmrf"):
    return [pages._study.runs["source"][index] for index in pages.worst_first(method)]


def test_what_is_wrong_and_sure_of_itself_comes_first(tmp_path):
    rows = [
        row(source=1, confidence=0.99),
        row(source=2, error_m=0.9, confidence=0.1),
        row(source=3, confidence=0.2),
        row(source=4, error_m=0.2, confidence=0.8),
        row(source=5, error_m="", error_rad="", failure="nothing <there>"),
        row(source=6, error_m=3.0, method="all"),
    ]
    pages = EvaluationPages(write_folder(tmp_path, rows, CONFIG))
    assert order(pages) == ["4", "2", "5", "3", "1"]
    assert order(pages, "all") == ["6"]
    table = pages("?method=hmrf")
    assert table.index("wrong, and believed") < table.index("nothing &lt;there&gt;")
    assert "right, and not believed" in table
    assert "5 runs of hmrf, 3 of them wrong" in table
    assert re.findall(r'href="run/(\d+)"', table) == ["5", "3", "6", "4", "2"]
    assert pages("?method=none") is None
    assert pages("run/99") is None
    assert pages("run/x") is None
    assert pages("elsewhere") is None


def test_where_no_method_is_sure_the_largest_error_is_the_worst(tmp_path):
    rows = [row(source=n, error_m=error) for n, error in ((1, 0.2), (2, 0.01), (3, 0.7))]
    assert order(EvaluationPages(write_folder(tmp_path, rows, CONFIG))) == ["3", "1", "2"]


def test_a_run_whose_data_are_gone_says_so_and_leads_back(tmp_path):
    pages = EvaluationPages(write_folder(tmp_path, [row()], CONFIG))
    said = pages("run/2")
    assert "the data are not at /somewhere/kitchen-invented" in said
    assert 'href="../?method=hmrf"' in said


@pytest.mark.parametrize("method", ["robust", "hmrf"])
def test_a_run_is_registered_again_as_it_was(tmp_path, method):
    rows = [
        row(target=0, source=4, angle=math.pi / 10, method=method, confidence=0.9),
        row(target=0, source=8, angle=math.pi / 10, method=method, confidence=0.8),
    ]
    config = {**CONFIG, "dataset": "synthetic:tabletop", "subsample": 16, "axes": 1}
    pages = EvaluationPages(write_folder(tmp_path, rows, config))
    page = pages("run/2")
    assert "source 4 to target 0" in page
    assert "from the true pose" in page
    assert '<a href="3">Worse</a>' in page
    assert pages("run/2") is page
    told = pages.story(0)
    assert told.moments[-1].title == "True pose"
    turned = told.moments[0].pose[:3, :3].T @ told.moments[-1].pose[:3, :3]
    assert math.acos((turned.trace() - 1) / 2) == pytest.approx(math.pi / 10)
