"""The paper's numbers beside ours, and the three layouts of its released rows."""

from __future__ import annotations

import math

import numpy as np
import pytest
from report_fakes import row, write_folder

from hmrf_icp import InputError
from hmrf_icp.evaluate.report.comparison import comparable_starts, maxima_table, medians_table
from hmrf_icp.evaluate.report.published import PUBLISHED_MAXIMA, read_paper_rows
from hmrf_icp.evaluate.report.study import Study

LAYOUTS = {
    "with_angles": "frame,overlap,angle,pct_iters,pct_time,pct_t_err,pct_r_err\n"
    "1, 0.95, 0.10472, 9, 1.0, 0.01, 0.02\n"
    "1, 0.97, 0.10472, 9, 2.0, 0.03, 0.04\n"
    "1, 0.92, 0.10472, 9, 3.0, NaN, NaN\n"
    "1, 0.95, 0.20944, 9, 9.0, 0.50, 0.60\n",
    "two_frames": "ref_frame, src_frame, overlap, pct_time, pct_t_err, pct_r_err\n"
    "1, 2, 0.95, 1.0, 0.01, 0.02\n",
    "many_sets": "dataset, ref_frame, src_frame, overlap, goicp_time, goicp_t_err, goicp_r_err\n"
    "freiburg1_desk, 1, 2, 0.15, NaN, NaN, NaN\n",
}


@pytest.fixture
def layout(tmp_path):
    def write(name):
        path = tmp_path / f"{name}.csv"
        path.write_text(LAYOUTS[name])
        return read_paper_rows(path)

    return write


@pytest.fixture
def study(tmp_path):
    rows = [
        row(axis=0, overlap=0.91, method="percent", error_m=0.2, error_rad=0.3),
        row(axis=1, overlap=0.99, method="percent", error_m=0.4, error_rad=0.5),
    ]
    return Study.read(write_folder(tmp_path / "ours", rows, {"dataset": "ours"}))


def test_a_file_with_angles_gives_the_rows_of_one_angle(layout):
    paper = layout("with_angles")
    assert paper.methods == ("percent",)
    assert paper.started_at(math.pi / 30).tolist() == [True, True, True, False]
    assert paper.started_at(math.pi / 15).tolist() == [False, False, False, True]
    assert np.isnan(paper.metres["percent"][2])


def test_files_without_angles_give_all_rows(layout):
    for name, methods in (("two_frames", ("percent",)), ("many_sets", ("Go-ICP",))):
        paper = layout(name)
        assert paper.angle is None
        assert paper.methods == methods
        assert paper.started_at(math.pi / 30).all()


def test_medians_by_decile_leave_out_failures_and_count_them(layout, study):
    paper = layout("with_angles")
    ((start, angle),) = comparable_starts(study, paper)
    table = medians_table(study, paper, start, angle, "error_m")
    theirs = table.row("0.9–1.0: paper (3 runs)").cells[0]
    assert theirs.text == "0.0200"
    assert theirs.detail == "1 of 3 failed"
    assert table.row("0.9–1.0: here (2 runs)").cells[0].text == "0.300"
    table = medians_table(study, paper, start, angle, "error_rad")
    assert table.row("0.9–1.0: paper (3 runs)").cells[0].text == "0.0300"
    assert table.row("0.9–1.0: here (2 runs)").cells[0].text == "0.400"


def test_a_start_is_held_against_rows_of_the_same_turn_alone(layout, tmp_path):
    turns = ((math.pi / 15, 0.0), (math.pi / 7, 0.0), (math.pi / 30, 0.3))
    rows = [row(axis=n, angle=angle, translation=t) for n, (angle, t) in enumerate(turns)]
    study = Study.read(write_folder(tmp_path, rows))
    found = list(comparable_starts(study, layout("with_angles")))
    assert [(start.label, angle) for start, angle in found] == [("π/15", math.pi / 15)]


def test_rows_of_unknown_turn_are_held_against_the_paper_s_start(layout, study):
    ((start, _),) = comparable_starts(study, layout("two_frames"))
    assert start.label == "π/30"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("x,y\n1,2\n", "expected columns overlap and"),
        ("overlap,all_time,all_t_err,all_r_err\n", "a header and no rows"),
        ("overlap,all_time,all_t_err,all_r_err\n0.5,1,2,three\n", "line 2: all_r_err is 'three'"),
        ("overlap,all_time,all_t_err,all_r_err\n0.5,1,2\n", "line 2: all_r_err is nothing"),
    ],
)
def test_a_file_that_holds_no_rows_of_the_paper(tmp_path, content, message):
    path = tmp_path / "rows.csv"
    path.write_text(content)
    with pytest.raises(InputError, match=message):
        read_paper_rows(path)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match=r"rows\.csv: no such file"):
        read_paper_rows(tmp_path / "rows.csv")


def test_published_maxima_stand_beside_ours(tmp_path):
    rows = [
        row(axis=0, overlap=0.65, error_m=0.02, error_rad=0.03),
        row(axis=1, overlap=1.0, error_m=0.01, error_rad=0.05),
        row(axis=2, overlap=0.25, error_m=0.3, error_rad=0.2),
        row(axis=3, overlap=0.05, error_m=2.0, error_rad=3.0),
        row(axis=4, overlap=0.05, error_m="", error_rad="", failure="lost"),
        # neither another start nor another method counts
        row(axis=5, overlap=0.65, error_m=9.0, error_rad=9.0, angle=math.pi / 10),
        row(axis=6, overlap=0.65, error_m=9.0, error_rad=9.0, method="all"),
    ]
    table = maxima_table(Study.read(write_folder(tmp_path, rows)))
    found = {
        (group.heading.split()[0], line.label): [cell.text for cell in line.cells[:4]]
        + [line.cells[-1].text]
        for group in table.groups
        for line in group.rows
    }
    assert found == {
        ("Shark", "60 % or more"): ["0.017", "0.0776", "0.0200", "0.0500", "2"],
        ("Shark", "all (35 % or more)"): ["0.036", "0.196", "0.0200", "0.0500", "2"],
        ("Desk", "50 % or more"): ["0.077", "0.109", "0.0200", "0.0500", "2"],
        ("Desk", "20 % or more"): ["0.386", "0.317", "0.300", "0.200", "3"],
        ("Desk", "below 20 %"): ["1.55", "1.97", "2.00", "3.00", "2"],
    }
    below = table.row("below 20 %")
    assert below.cells[2].detail == "1 without a pose"


def test_nothing_is_compared_that_was_not_run(tmp_path):
    study = Study.read(write_folder(tmp_path, [row(method="all")]))
    assert maxima_table(study) is None


@pytest.mark.shared
def test_the_released_rows_are_those_of_the_paper(shared):
    """What the paper says of its shark sequence: 40 frames, 16 axes, overlap from about 35 %."""
    paper = read_paper_rows(shared / "paper" / "shark_2017.csv")
    plotted = paper.started_at(math.pi / 30)
    assert np.count_nonzero(plotted) == 40 * 16
    assert paper.overlap.min() == pytest.approx(0.35, abs=0.01)
    assert np.isfinite(paper.metres["hmrf"][plotted]).all()
    for published in PUBLISHED_MAXIMA[:2]:
        among = plotted & (paper.overlap >= published.low)
        # The text rounds, and a run or two differ from the released rows.
        assert paper.metres["hmrf"][among].max() == pytest.approx(published.metres, rel=0.25)
        assert paper.radians["hmrf"][among].max() == pytest.approx(published.radians, rel=0.25)


@pytest.mark.shared
@pytest.mark.parametrize(("name", "rows"), [("shark_2019", 100), ("tum_2019", 90)])
def test_the_rows_of_the_follow_up_are_read(shared, name, rows):
    paper = read_paper_rows(shared / "paper" / f"{name}.csv")
    assert paper.overlap.size == rows
    assert set(paper.methods) >= {"hmrf", "Go-ICP", "Super4PCS"}
