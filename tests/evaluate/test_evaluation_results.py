from __future__ import annotations

from pathlib import Path

import pytest

from hmrf_icp.errors import InputError
from hmrf_icp.evaluate.plan import Plan
from hmrf_icp.evaluate.protocol import Pair, Start
from hmrf_icp.evaluate.results import Results, Row, read_rows

PLAN = Plan(
    (Pair(0, 1, 0.5), Pair(0, 2, 1 / 3)), (Start(0.1), Start(0.1 + 0.2, 0.3)), 2, ("a", "b@0.1")
)


def row(number: int, **values) -> Row:
    return Row(PLAN.run(number), **{"seconds": 0.1, "error_m": 0.01, "error_rad": 0.02, **values})


def written(path: Path, *numbers: int) -> bytes:
    with Results(path, PLAN) as results:
        results.append(row(number) for number in numbers)
    return path.read_bytes()


def test_what_was_written_is_known_when_the_file_is_opened_again(tmp_path: Path):
    written(tmp_path / "results.csv", 3, 11)
    with Results(tmp_path / "results.csv", PLAN) as results:
        assert results.count == 2
        assert [n for n in range(len(PLAN)) if results.done[n]] == [3, 11]


def test_a_torn_last_line_is_cut_off_wherever_it_was_torn(tmp_path: Path):
    whole = written(tmp_path / "whole.csv", 0, 1, 2)
    first_two = written(tmp_path / "two.csv", 0, 1)
    path = tmp_path / "results.csv"
    for cut in range(len(first_two), len(whole)):
        path.write_bytes(whole[:cut])
        with Results(path, PLAN) as results:
            assert results.count == 2
            results.append([row(2)])
        assert path.read_bytes() == whole


def test_a_torn_header_is_written_again(tmp_path: Path):
    path = tmp_path / "results.csv"
    path.write_bytes(b"pair,targ")
    assert written(path, 0) == written(tmp_path / "other.csv", 0)


def test_rows_are_sorted_into_the_order_of_the_plan(tmp_path: Path):
    path = tmp_path / "results.csv"
    in_order = written(tmp_path / "in_order.csv", *range(len(PLAN)))
    with Results(path, PLAN) as results:
        for number in reversed(range(len(PLAN))):
            results.append([row(number)])
        assert path.read_bytes() != in_order
        results.sort()
    assert path.read_bytes() == in_order


def test_a_run_is_written_once(tmp_path: Path):
    path = tmp_path / "results.csv"
    once = written(path, 4)
    with Results(path, PLAN) as results:
        results.append([row(4, error_m=0.5)])
        results.sort()
    assert path.read_bytes() == once


def test_a_file_with_other_columns_is_refused_and_left_alone(tmp_path: Path):
    path = tmp_path / "results.csv"
    path.write_text("name,score\nx,1\n")
    with pytest.raises(InputError, match=r"results\.csv.*name,score.*--fresh"):
        Results(path, PLAN)
    assert path.read_text() == "name,score\nx,1\n"


@pytest.mark.parametrize(
    ("old", "new"), [(",a,", ",z,"), ("000000-000001", "000000-000009"), (",0,a", ",7,a")]
)
def test_a_row_of_another_evaluation_is_refused_with_its_line(tmp_path: Path, old: str, new: str):
    path = tmp_path / "results.csv"
    content = written(path, 0, 2).decode()
    assert old in content
    path.write_text(content.replace(old, new, 1))
    with pytest.raises(InputError, match=r"line 2"):
        Results(path, PLAN)


def test_what_a_method_does_not_tell_is_an_empty_cell(tmp_path: Path):
    path = tmp_path / "results.csv"
    with Results(path, PLAN) as results:
        results.append([row(0, error_m=None, error_rad=None, failure="gave\nup, really")])
        results.append([row(1, converged=False, confidence=float("nan"), fitness=0.25)])
    cells = list(read_rows(path, ("error_m", "iterations", "converged", "confidence", "fitness")))
    assert cells == [("", "", "", "", ""), ("0.01", "", "False", "", "0.25")]
    assert [failure for (failure,) in read_rows(path, ("failure",))] == ["gave up, really", ""]


def test_angles_keep_every_digit(tmp_path: Path):
    path = tmp_path / "results.csv"
    written(path, *range(len(PLAN)))
    angles = {float(angle) for (angle,) in read_rows(path, ("angle",))}
    assert angles == {0.1, 0.1 + 0.2}
