"""What a report reads, and what it refuses."""

from __future__ import annotations

import pytest
from report_fakes import row, write_folder

from hmrf_icp import InputError
from hmrf_icp.evaluate.report import Success
from hmrf_icp.evaluate.report.runs import NUMBERS, TEXT, read_results
from hmrf_icp.evaluate.report.study import Study
from hmrf_icp.evaluate.results import COLUMNS


@pytest.fixture
def folder(tmp_path):
    return write_folder(tmp_path / "out", [row(axis=0), row(axis=1, error_m="", error_rad="")])


def test_every_column_that_an_evaluation_writes_is_read():
    assert {*TEXT, *NUMBERS} == set(COLUMNS)


def test_rows_become_columns_and_know_their_line(folder):
    runs = read_results(folder / "results.csv")
    assert len(runs) == 2
    assert runs["method"].tolist() == ["hmrf", "hmrf"]
    assert runs["converged"].tolist() == [1.0, 1.0]
    assert runs.failed.tolist() == [False, True]
    assert runs.line.tolist() == [2, 3]


def test_a_torn_last_line_is_left_out(folder):
    path = folder / "results.csv"
    path.write_text(path.read_text() + "000000-000010,0,10,0.5,0.1")
    assert len(read_results(path)) == 2


def test_errors_that_are_not_finite_count_as_no_pose(tmp_path):
    folder = write_folder(tmp_path, [row(error_m="nan", error_rad="inf")])
    assert read_results(folder / "results.csv").failed.tolist() == [True]


def test_no_folder(tmp_path):
    with pytest.raises(InputError, match=r"elsewhere: no such folder; .*hmrf-icp evaluate"):
        Study.read(tmp_path / "elsewhere")


def test_no_results(tmp_path):
    with pytest.raises(InputError, match=r"results\.csv: no such file"):
        Study.read(tmp_path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "empty"),
        ("a,b\n1,2\n", "no column overlap, angle"),
        (",".join(COLUMNS) + "\n", "a header and no runs"),
        (",".join(COLUMNS) + "\n1,2\n", "line 2: 2 values, the header has 18"),
    ],
)
def test_results_that_are_not_an_evaluation_s(tmp_path, content, message):
    (tmp_path / "results.csv").write_text(content)
    with pytest.raises(InputError, match=message):
        Study.read(tmp_path)


def test_a_word_where_a_number_belongs_is_named_with_its_line(tmp_path):
    folder = write_folder(tmp_path, [row(), row(axis=1, seconds="soon")])
    with pytest.raises(InputError, match=r"line 3: seconds is 'soon', expected a number"):
        Study.read(folder)


def test_an_overlap_is_needed(tmp_path):
    folder = write_folder(tmp_path, [row(overlap="")])
    with pytest.raises(InputError, match="line 2: no overlap"):
        Study.read(folder)


@pytest.mark.parametrize(("content", "message"), [("{", "not JSON"), ("[]", "expected an object")])
def test_a_damaged_configuration(folder, content, message):
    (folder / "config.json").write_text(content)
    with pytest.raises(InputError, match=message):
        Study.read(folder)


def test_thresholds_are_positive(folder):
    with pytest.raises(InputError, match="two positive thresholds"):
        Study.read(folder, Success(0.05, 0.0))


def test_the_dataset_is_called_by_its_last_name(folder, tmp_path):
    assert Study.read(folder).dataset == "out"
    named = write_folder(tmp_path / "named", [row()], {"dataset": "/data/kitchen-exact/"})
    assert Study.read(named).dataset == "kitchen-exact"
    rendered = write_folder(tmp_path / "rendered", [row()], {"dataset": "synthetic:desk"})
    assert Study.read(rendered).dataset == "synthetic:desk"
