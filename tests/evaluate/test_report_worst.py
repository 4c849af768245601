"""Which runs are shown, and the pictures of them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from report_fakes import row, write_folder

from hmrf_icp import datasets, se3
from hmrf_icp.evaluate.methods import own_methods
from hmrf_icp.evaluate.prepared import Prepared
from hmrf_icp.evaluate.protocol import Axes, Start, perturbed, true_transformation
from hmrf_icp.evaluate.report import Success
from hmrf_icp.evaluate.report.contents import sections
from hmrf_icp.evaluate.report.pictures import Scene, draw_scene
from hmrf_icp.evaluate.report.replay import shown_runs
from hmrf_icp.evaluate.report.study import Study
from hmrf_icp.evaluate.report.worst import worst_runs

SUBSAMPLE = 16


def test_half_are_failures_with_the_most_overlap_half_the_largest_errors(tmp_path):
    rows = [
        row(source=1, overlap=0.9, error_m=0.001),
        row(source=2, overlap=0.8, error_m=0.2),
        row(source=2, overlap=0.8, error_m=0.3, axis=1),
        row(source=3, overlap=0.7, error_m=0.1),
        row(source=4, overlap=0.1, error_m=3.0),
        row(source=5, overlap=0.2, error_m=2.0),
        row(source=6, overlap=0.6, error_m=0.06),
        row(source=7, overlap=0.95, error_m=9.0, method="all"),
    ]
    study = Study.read(write_folder(tmp_path, rows))
    worst = worst_runs(study, 4)
    # No pair twice, no other method, and no success among the failures.
    assert [study.runs["source"][run.index] for run in worst] == ["2", "3", "4", "5"]
    assert [run.reason.split()[3] for run in worst] == ["most", "most", "largest", "largest"]
    assert "row 3 of results.csv" in worst[0].facts


def test_a_run_that_succeeded_is_none_of_the_worst(tmp_path):
    rows = [row(source=1), row(source=2, error_m=0.02), row(source=3, error_m=0.7)]
    study = Study.read(write_folder(tmp_path, rows))
    worst = worst_runs(study, 4)
    assert [study.runs["source"][run.index] for run in worst] == ["3"]
    assert all(not study.solved[run.index] for run in worst)


def test_where_nothing_failed_the_report_says_so(tmp_path):
    study = Study.read(write_folder(tmp_path, [row(source=1), row(source=2, error_m=0.02)]))
    assert worst_runs(study, 2) == []
    (section,) = (one for one in sections(study, (), [], "") if one.name == "worst-section")
    assert section.paragraphs == ["None failed."]


@pytest.fixture(scope="module")
def evaluated():
    """One run of a rendered sequence, as an evaluation would record it."""
    sequence = datasets.open_sequence("synthetic:tabletop")
    source_frame, target_frame = sequence.frame(3), sequence.frame(5)
    source, target = (
        Prepared(frame.load().subsample(SUBSAMPLE)) for frame in (source_frame, target_frame)
    )
    truth = true_transformation(source_frame.pose, target_frame.pose)
    start = Start(math.pi / 30)
    init = perturbed(truth, source.centroid, Axes.random(2, 7), 1, start)
    pose = own_methods()["percent"].register(source, target, init).transformation
    metres, radians = se3.error(pose, truth)
    values = {"source": 3, "target": 5, "axis": 1, "method": "percent", "angle": start.angle}
    return {**values, "error_m": metres, "error_rad": radians}


def picture(tmp_path, values):
    config = {"dataset": "synthetic:tabletop", "subsample": SUBSAMPLE, "axes": 2, "seed": 7}
    # A run that failed: no run comes within so little.
    study = Study.read(write_folder(tmp_path, [row(**values)], config), Success(1e-9, 1e-9))
    ((shown,), reason) = shown_runs(study, 1)
    return shown.drawing, reason


def test_a_run_is_done_again_for_its_picture_and_ends_as_it_did(tmp_path, evaluated):
    drawing, reason = picture(tmp_path, evaluated)
    assert reason == ""
    assert drawing.png.startswith(b"\x89PNG")
    assert "Source 3 to target 5" in drawing.alternative
    assert drawing.caption == ""


def test_a_run_that_ends_otherwise_than_its_row_says_so(tmp_path, evaluated):
    drawing, _ = picture(tmp_path, {**evaluated, "error_m": evaluated["error_m"] + 1.0})
    assert "not as in its row" in drawing.caption


def test_a_run_without_a_pose_shows_where_it_began(tmp_path, evaluated):
    drawing, reason = picture(tmp_path, {**evaluated, "error_m": "", "error_rad": ""})
    assert reason == ""
    assert "no pose" in drawing.alternative


@pytest.mark.parametrize(
    ("config", "reason"),
    [
        ({}, "config.json does not say how the runs were made"),
        ({"dataset": "/gone", "subsample": 1, "axes": 1, "seed": 0}, "the data are not at /gone"),
        ({"dataset": "synthetic", "subsample": 9, "axes": 1, "seed": 0}, "no frame 99999"),
    ],
)
def test_without_data_there_is_a_reason_instead(tmp_path, config, reason):
    study = Study.read(write_folder(tmp_path, [row(source=99999, error_m=1.0)], config))
    ((shown,), said) = shown_runs(study, 1)
    assert shown.drawing is None
    assert reason in said


def test_an_unknown_method_cannot_be_done_again(tmp_path, evaluated):
    drawing, reason = picture(tmp_path, {**evaluated, "method": "of-somebody-else"})
    assert drawing is None
    assert "no method called of-somebody-else" in reason


@pytest.mark.parametrize("from_camera", [True, False])
def test_clouds_of_any_extent_can_be_drawn(from_camera):
    rng = np.random.default_rng(0)
    flat = rng.random((20_000, 3)) * (50.0, 50.0, 0.01)
    away = se3.rigid(np.eye(3), (1e4, 0.0, 0.0))
    scene = Scene(flat, flat, np.eye(4), away, np.eye(4), from_camera)
    drawing = draw_scene(scene, "flat", "A floor.")
    assert len(drawing.png) > 5_000
