"""Recalls, the best single setting and the oracle, counted by hand."""

from __future__ import annotations

import math

import pytest
from report_fakes import row, write_folder

from hmrf_icp.evaluate.report import Success
from hmrf_icp.evaluate.report.cast import main_cast, settings_cast
from hmrf_icp.evaluate.report.confidence import confidence_table
from hmrf_icp.evaluate.report.cost_tables import (
    accuracy_table,
    effort_table,
    failure_table,
    pairs_table,
    three_digits,
)
from hmrf_icp.evaluate.report.recall_tables import recall_by_decile_table, recall_table
from hmrf_icp.evaluate.report.runs import ReportedStart, angle_label
from hmrf_icp.evaluate.report.study import Study
from hmrf_icp.evaluate.report.summary import summary
from hmrf_icp.evaluate.report.tables import Cell, Group, Row, Table

FAR = {"error_m": 0.5, "error_rad": 0.5}
NO_POSE = {"error_m": "", "error_rad": "", "iterations": "", "failure": "no matches"}

# Four problems: two pairs, one in the first decile and one in the sixth, two axes each.
PROBLEMS = (
    {"source": 10, "overlap": 0.05, "axis": 0},
    {"source": 10, "overlap": 0.05, "axis": 1},
    {"source": 20, "overlap": 0.55, "axis": 0},
    {"source": 20, "overlap": 0.55, "axis": 1},
)
SOLVED = {
    "hmrf": (0, 0, 1, 1),
    "x84": (0, 0, 0, 1),
    "gicp@0.05": (1, 0, 0, 1),
    "gicp@0.8": (0, 0, 1, 0),
    "kiss-gicp@0.1": (0, 1, 1, 1),
}


def four_problems(**values):
    return [
        row(**problem, method=method, **({} if solved else FAR), **values)
        for method, outcomes in SOLVED.items()
        for problem, solved in zip(PROBLEMS, outcomes, strict=True)
    ]


@pytest.fixture
def study(tmp_path):
    return Study.read(write_folder(tmp_path, four_problems(), {"dataset": "four"}))


def texts(table, label):
    return [cell.text for cell in table.row(label).cells]


def hindsight(table, heading):
    (group,) = [group for group in table.groups if group.heading.startswith(heading)]
    return {line.label: [cell.text for cell in line.cells] for line in group.rows}


def test_recall_is_the_share_of_solved_runs(study):
    table = recall_table(study, main_cast(study))
    assert table.columns == ["π/30"]
    assert texts(table, "HMRF") == ["0.50"]
    assert texts(table, "X84") == ["0.25"]
    assert table.row("HMRF").cells[0].detail.startswith("2 of 4, 0.15–0.85")


def test_best_single_setting_and_oracle_without_the_peers_that_need_no_start(study):
    found = hindsight(recall_table(study, main_cast(study)), "In hindsight, of the peers that use")
    # gicp@0.05 solves two, gicp@0.8 one other: three between them
    assert found == {"best single peer setting": ["0.50"], "oracle": ["0.75"]}


def test_best_single_setting_and_oracle_with_them(study):
    found = hindsight(recall_table(study, main_cast(study)), "In hindsight, of all peers")
    assert found == {"best single peer setting": ["0.75"], "oracle": ["1.00"]}


def test_the_best_setting_is_named(study):
    table = recall_table(study, main_cast(study))
    (group,) = [group for group in table.groups if "that use the start" in group.heading]
    assert group.rows[0].cells[0].detail.startswith("GICP, 0.05\N{NO-BREAK SPACE}m; 2 of 4")


def test_recall_by_decile_of_overlap(study):
    table = recall_by_decile_table(study, main_cast(study), study.starts[0])
    assert table.columns == ["0.0–0.1\n1 pair", "0.5–0.6\n1 pair", "all"]
    assert texts(table, "HMRF") == ["0.00", "1.00", "0.50"]
    found = hindsight(table, "In hindsight, of the peers that use")
    assert found == {
        # the setting that is best over the whole start, in every decile
        "best single peer setting": ["0.50", "0.50", "0.50"],
        "oracle": ["0.50", "1.00", "0.75"],
    }


def test_the_best_single_setting_is_chosen_for_each_start(tmp_path):
    rows = four_problems() + [
        row(
            **problem,
            angle=math.pi / 6,
            translation=0.3,
            method=method,
            **({} if method == "gicp@0.8" else FAR),
        )
        for method in SOLVED
        for problem in PROBLEMS
    ]
    study = Study.read(write_folder(tmp_path, rows))
    table = recall_table(study, main_cast(study))
    assert table.columns == ["π/30", "π/6 + 0.3 m", "all starts"]
    found = hindsight(table, "In hindsight, of the peers that use")
    # over both starts together gicp@0.8 solves 5 of 8, gicp@0.05 2
    assert found["best single peer setting"] == ["0.50", "1.00", "0.62"]
    assert found["oracle"] == ["0.75", "1.00", "0.88"]


def test_a_run_on_the_threshold_is_solved_and_both_errors_count(tmp_path):
    rows = [
        row(axis=0, error_m=0.05, error_rad=0.05),
        row(axis=1, error_m=0.0501, error_rad=0.0),
        row(axis=2, error_m=0.0, error_rad=0.0501),
    ]
    folder = write_folder(tmp_path, rows)
    assert Study.read(folder).solved.tolist() == [True, False, False]
    assert Study.read(folder, Success(0.1, 0.05)).solved.tolist() == [True, True, False]
    assert Study.read(folder, Success(0.05, 0.1)).solved.tolist() == [True, False, True]


def test_a_run_without_a_pose_is_not_solved_and_says_why(tmp_path):
    rows = [row(axis=0), row(axis=1, **NO_POSE), row(axis=2, **NO_POSE)]
    study = Study.read(write_folder(tmp_path, rows))
    assert study.solved.tolist() == [True, False, False]
    assert texts(recall_table(study, main_cast(study)), "HMRF") == ["0.33"]
    assert texts(failure_table(study), "HMRF") == ["no matches", "2"]
    effort = effort_table(study, main_cast(study))
    assert texts(effort, "HMRF")[-1] == "2"


def test_no_table_of_failures_without_failures(study):
    assert failure_table(study) is None


def test_medians_are_over_what_they_say(tmp_path):
    rows = [
        row(axis=0, error_m=0.01, error_rad=0.001, iterations=10, seconds=1.0, converged=True),
        row(axis=1, error_m=0.03, error_rad=0.003, iterations=20, seconds=2.0, converged=True),
        row(axis=2, error_m=0.9, error_rad=0.9, iterations=50, seconds=9.0, converged=False),
    ]
    study = Study.read(write_folder(tmp_path, rows))
    # errors: of the two that succeeded; iterations and seconds: of all three
    assert texts(accuracy_table(study, main_cast(study)), "HMRF") == ["0.0200", "0.00200"]
    assert texts(effort_table(study, main_cast(study)), "HMRF") == [
        "20",
        "100",
        "2.00",
        "8.30",
        "0.67",
        "0",
    ]


def test_what_a_method_does_not_tell_is_a_dash(tmp_path):
    rows = [row(method="gicp@0.1", iterations="", em_iterations="", converged="")]
    study = Study.read(write_folder(tmp_path, rows))
    cells = texts(effort_table(study, main_cast(study)), "GICP, 0.1\N{NO-BREAK SPACE}m")
    assert cells == ["–", "–", "0.500", "0.500", "–", "0"]


def test_the_main_tables_have_one_setting_of_each_peer_and_the_last_section_all(study):
    names = [[method.name for method in band.methods] for band in main_cast(study)]
    assert names == [["x84", "hmrf"], ["gicp@0.05", "kiss-gicp@0.1"]]
    (band,) = settings_cast(study)
    assert [method.name for method in band.methods] == ["gicp@0.05", "gicp@0.8"]


def test_pairs_are_counted_by_decile(study):
    table = pairs_table(study)
    assert texts(table, "0.5–0.6") == ["1", "2", "10"]
    assert texts(table, "0.9–1.0") == ["0", "0", "0"]


def test_area_under_roc_of_confidence_overall_and_at_low_overlap(tmp_path):
    outcomes = [  # overlap, solved, confidence
        (0.1, True, 0.9),
        (0.1, False, 0.2),
        (0.1, False, 0.95),
        (0.8, True, 0.99),
        (0.8, True, 0.97),
    ]
    rows = [
        row(
            axis=n,
            source=int(100 * overlap),
            overlap=overlap,
            confidence=confidence,
            fitness=0.1,
            **({} if solved else FAR),
        )
        for n, (overlap, solved, confidence) in enumerate(outcomes)
    ]
    study = Study.read(write_folder(tmp_path, rows))
    table = confidence_table(study, main_cast(study))
    # 0.9 beats one of two failures; 0.99 and 0.97 beat both: 5 of 6 pairs, and 1 of 2 below 0.2
    assert texts(table, "HMRF")[:3] == ["confidence", "0.833", "0.500"]


def test_fitness_stands_in_for_a_confidence(tmp_path):
    rows = [row(axis=0, fitness=0.9), row(axis=1, fitness=0.4, **FAR)]
    study = Study.read(write_folder(tmp_path, rows))
    assert texts(confidence_table(study, main_cast(study)), "HMRF")[:2] == ["fitness", "1.000"]


def test_summary_compares_with_the_best_setting_and_the_oracle(study):
    sentences = " ".join(summary(study))
    assert "From π/30, HMRF solves 0.50 of its runs" in sentences
    assert "(GICP, 0.05\N{NO-BREAK SPACE}m) 0.50, the oracle over all of them 0.75" in sentences
    assert "below the oracle" in sentences
    assert "its field (HMRF) solves 0.50 and the best of its other rules (X84) 0.25" in sentences


def test_an_unfinished_evaluation_is_said(tmp_path):
    study = Study.read(write_folder(tmp_path, four_problems()[:-6]))
    assert any("was not finished" in note for note in recall_table(study, main_cast(study)).notes)


@pytest.mark.parametrize(
    ("start", "label", "slug"),
    [
        (ReportedStart(math.pi / 30, 0.0), "π/30", "pi-30"),
        (ReportedStart(2 * math.pi / 15, 0.0), "2π/15", "2pi-15"),
        (ReportedStart(math.pi / 6, 0.3), "π/6 + 0.3 m", "pi-6-0.3m"),
        (ReportedStart(0.1, 0.0), "0.1 rad", "0.1rad"),
        (ReportedStart(0.0, 0.5), "0 rad + 0.5 m", "0rad-0.5m"),
        (ReportedStart(0.0, 0.0), "true pose", "0rad"),
    ],
)
def test_starts_are_written_as_people_say_them(start, label, slug):
    assert start.label == label
    assert start.slug == slug


def test_a_half_turn_has_no_denominator():
    assert angle_label(math.pi) == "π"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0123456, "0.0123"),
        (1.23456, "1.23"),
        (123.4, "123"),
        (1234.5, "1234"),
        (0.000123, "0.000123"),
        (1e-7, "< 0.00001"),
        (0.0, "0"),
        (None, "–"),
    ],
)
def test_numbers_have_three_digits_and_no_powers(value, text):
    assert three_digits(value) == text


def test_markdown_keeps_a_bar_in_a_cell_from_ending_it():
    table = Table("t", "Caption", "A", ["b"], [Group("", [Row("x|y", [Cell("1", detail="2")])])])
    assert table.markdown().splitlines()[-1] == "| x\\|y | 1 (2) |"


def test_a_row_of_the_wrong_length_is_a_mistake():
    with pytest.raises(ValueError, match="has 2 cells"):
        Table("t", "Caption", "A", ["b"], [Group("", [Row("x", [Cell("1"), Cell("2")])])])
