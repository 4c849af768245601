"""Data sets that list their pairs, and fragments: what is read, and when a pose is right."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hmrf_icp import PointCloud, se3
from hmrf_icp.datasets import MatchedRmse, PairSet, Tolerance, open_dataset, open_sequence
from hmrf_icp.datasets.pair_folders import DEGREES, SHARE
from hmrf_icp.errors import InputError
from hmrf_icp.evaluate import protocol
from pair_writers import CAMERA, truth, views, write_fragments, write_pair, write_scene

CENTROID = np.array([0.1, -0.2, 2.0])


def pairs_of(folder: Path) -> PairSet:
    found = open_dataset(folder)
    assert isinstance(found, PairSet)
    return found


def shifted(metres: float) -> np.ndarray:
    return se3.rigid(np.eye(3), [0.0, metres, 0.0])


# The criteria


def test_a_shift_is_an_error_of_its_length_whatever_the_matches() -> None:
    points = np.random.default_rng(0).normal(size=(50, 3))
    g = [np.hstack([np.eye(3), -se3.skew(p)]) for p in points]
    criterion = MatchedRmse(sum(one.T @ one for one in g))
    pose = truth(0, 2)
    assert criterion.error(pose @ shifted(0.15), pose) == pytest.approx(0.15)
    assert criterion.right(pose @ shifted(0.199), pose, CENTROID)
    assert not criterion.right(pose @ shifted(0.201), pose, CENTROID)


def test_a_turn_is_an_error_by_the_vector_part_of_its_quaternion() -> None:
    points = np.array([[3.0, 0.0, 1.0], [0.0, 4.0, -2.0]])
    g = [np.hstack([np.eye(3), -se3.skew(p)]) for p in points]
    turn = se3.rigid(se3.rotation_exp([0.0, 0.0, 0.08]), np.zeros(3))
    by_hand = np.sin(0.04) * np.sqrt((9.0 + 16.0) / 2)
    assert MatchedRmse(sum(one.T @ one for one in g)).error(turn, np.eye(4)) == pytest.approx(
        by_hand
    )


def test_a_tolerance_does_not_ask_where_the_frames_have_their_origins() -> None:
    far = se3.rigid(np.eye(3), [1000.0, 0.0, 0.0])
    turn = se3.rotation_about([0.0, 0.0, 1.0], 0.01, CENTROID)
    tolerance = Tolerance(0.05, 0.02)
    for frame in (np.eye(4), far):
        estimate = frame @ turn @ se3.inverse(frame)
        centroid = se3.transform(frame, CENTROID[None])[0]
        assert tolerance.right(estimate, np.eye(4), centroid)
    assert not tolerance.right(shifted(0.06), np.eye(4), CENTROID)
    assert not Tolerance(0.05, 0.005).right(turn, np.eye(4), CENTROID)


# Benchmarks of fragments


@pytest.mark.parametrize("alone", [True, False], ids=["one scene", "a folder of scenes"])
def test_a_benchmark_has_the_pairs_that_count(tmp_path: Path, alone: bool) -> None:
    write_scene(tmp_path / "scenes" / "kitchen", ("3DLoMatch", "3DMatch"))
    folder = tmp_path / "scenes"
    found = pairs_of(folder / "kitchen" if alone else folder)
    assert found.benchmarks == ("3DMatch", "3DLoMatch")
    chosen = found.only("3dlomatch")
    assert [(p.target, p.source) for p in chosen.pairs] == [(0, 2), (0, 3), (1, 3)]
    assert [p.overlap for p in chosen.pairs] == pytest.approx([0.8, 0.7, 0.8])
    assert {p.place for p in chosen.pairs} == {"3DLoMatch/kitchen"}


def test_the_matrix_of_a_pair_takes_its_second_cloud_to_its_first(tmp_path: Path) -> None:
    pair = pairs_of(write_scene(tmp_path / "kitchen")).pairs[0]
    target, source = pair.frames
    clouds = [frame.load() for frame in (source, target)]
    pose = protocol.true_transformation(source.pose, target.pose)
    np.testing.assert_allclose(pose, truth(0, 2), atol=1e-7)
    assert protocol.overlap(*clouds, pose) > 0.8 > protocol.overlap(*clouds, se3.inverse(pose))
    assert clouds[0].viewpoint is None


def test_lists_beside_the_clouds_and_in_a_folder_of_their_own_are_found(tmp_path: Path) -> None:
    scene = write_scene(tmp_path / "livingroom", overlaps=False)
    for file in (scene / "3DMatch").iterdir():
        file.rename(scene / file.name)
    (scene / "3DMatch").rmdir()
    assert pairs_of(scene).pairs[0].place == "livingroom"
    assert pairs_of(scene).pairs[0].overlap is None
    beside = tmp_path / "livingroom-evaluation"
    beside.mkdir()
    for name in ("gt.log", "gt.info"):
        (scene / name).rename(beside / name)
    assert len(pairs_of(tmp_path)) == 3


def test_what_a_benchmark_lacks_is_named(tmp_path: Path) -> None:
    scene = write_scene(tmp_path / "kitchen")
    info = scene / "3DMatch" / "gt.info"
    lines = info.read_text().splitlines(keepends=True)
    info.write_text("".join(lines[:10]))
    with pytest.raises(InputError, match=r"line 10: the file ends inside the block of line 8"):
        open_dataset(scene)
    info.write_text("".join(lines[:7]))
    with pytest.raises(InputError, match=r"gt\.info: no block for the pair 0 2"):
        open_dataset(scene)
    info.write_text("".join(lines))
    (scene / "cloud_bin_3.ply").unlink()
    with pytest.raises(InputError, match=r"gt\.log, line .*no .*cloud_bin_3\.ply"):
        open_dataset(scene)


def test_an_unknown_benchmark_is_told_which_there_are(tmp_path: Path) -> None:
    found = pairs_of(write_scene(tmp_path / "kitchen"))
    with pytest.raises(InputError, match="there are 3DMatch"):
        found.only("ETH")


def test_a_list_of_pairs_is_no_sequence(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="a list of pairs"):
        open_sequence(write_scene(tmp_path / "kitchen"))


# Pairs, a folder each


def test_a_pair_brings_its_sensor_and_its_tolerance(tmp_path: Path) -> None:
    camera = [CAMERA.width, CAMERA.height, CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy]
    write_pair(tmp_path / "a", camera=camera, tol=[0.1, 3.0], size=2.0, room=True)
    write_pair(tmp_path / "b", organised=False, viewpoint=[0, 0, 0], size=2.0)
    write_pair(tmp_path / "c", scale=0.1, tol=None)
    a, b, c = pairs_of(tmp_path).pairs
    assert a.source_scan.load().camera == CAMERA
    assert a.criterion == Tolerance(0.1, pytest.approx(np.radians(3.0)))
    assert a.unit == 1.0
    np.testing.assert_array_equal(b.source_scan.load().viewpoint, np.zeros(3))
    assert b.criterion == Tolerance(SHARE * 2.0, pytest.approx(np.radians(DEGREES)))
    assert b.unit == 2.0
    points = PointCloud(0.1 * views()[2][0]).observed_points
    size = np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean())
    assert c.unit == pytest.approx(size)
    assert c.source_scan.load().viewpoint is None


@pytest.mark.parametrize(
    ("about", "message"),
    [
        ({"tol": [0.1]}, "tol: expected 2 numbers"),
        ({"camera": "kinect"}, "camera: expected 6 numbers"),
        ({"size": 0}, "size: expected a positive"),
        ({"size": "large"}, "size: expected a number"),
    ],
)
def test_what_a_pair_says_wrongly_is_named(tmp_path: Path, about: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        open_dataset(write_pair(tmp_path / "a", **about))


# Fragments


def test_fragments_are_a_sequence_that_nobody_knows_a_viewpoint_of(tmp_path: Path) -> None:
    folder = write_fragments(tmp_path / "fragments")
    sequence = open_sequence(folder)
    assert [frame.index for frame in sequence.frames] == [0, 1, 2, 3]
    assert sequence.frames[1].load().viewpoint is None
    np.testing.assert_allclose(sequence.frames[1].pose, views()[1][1], atol=1e-12)
    (folder / "fragment-02.pose.txt").unlink()
    assert "1 of 4 fragments left out: no pose" in open_sequence(folder).notes
