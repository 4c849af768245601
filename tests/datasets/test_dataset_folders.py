"""7-Scenes, Open3D, InfiniTAM, KITTI and cloud folders: their variants and their errors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dataset_writers import (
    Recording,
    infinitam_calibration,
    raw,
    recording,
    write_clouds,
    write_infinitam,
    write_kitti,
    write_matrix,
    write_pgm,
    write_png,
    write_redwood,
    write_seven_scenes,
)
from scipy.spatial.transform import Rotation

from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.datasets import open_sequence
from hmrf_icp.errors import InputError

SHEAR = "1 0.2 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"


@pytest.fixture
def shot() -> Recording:
    return recording()


def assert_poses(folder: Path, shot: Recording) -> None:
    sequence = open_sequence(folder)
    assert len(sequence) == len(shot.poses)
    for frame, pose in zip(sequence.frames, shot.poses, strict=True):
        np.testing.assert_allclose(frame.pose, pose, atol=1e-7)


# 7-Scenes


def test_seven_scenes_without_intrinsics_has_its_kinect_and_says_so(
    tmp_path: Path, shot: Recording
) -> None:
    folder = write_seven_scenes(tmp_path, shot)
    (folder / "camera-intrinsics.txt").unlink()
    sequence = open_sequence(folder)
    assert sequence.camera == PinholeCamera(640, 480, 585, 585, 320, 240)
    assert "585" in sequence.notes[0]


def test_seven_scenes_leaves_saturated_pixels_unobserved(tmp_path: Path, shot: Recording) -> None:
    folder = write_seven_scenes(tmp_path, shot)
    depth = shot.depths[0].copy()
    depth[40:50, 60:80] = 65.535
    write_png(folder / "frame-000000.depth.png", depth, 1000.0)
    cloud = open_sequence(folder).frames[0].load()
    assert not cloud.observed[40:50, 60:80].any()
    assert cloud.observed[55, 70]


def test_seven_scenes_names_a_pose_that_is_not_rigid(tmp_path: Path, shot: Recording) -> None:
    folder = write_seven_scenes(tmp_path, shot)
    (folder / "frame-000010.pose.txt").write_text(SHEAR)
    with pytest.raises(InputError, match=r"frame-000010\.pose\.txt.*not a rotation"):
        open_sequence(folder)


def test_seven_scenes_names_a_depth_map_that_is_absent(tmp_path: Path, shot: Recording) -> None:
    folder = write_seven_scenes(tmp_path, shot)
    (folder / "frame-000010.depth.png").unlink()
    with pytest.raises(InputError, match=r"frame-000010\.depth\.png is not there"):
        open_sequence(folder)


def test_seven_scenes_names_an_empty_pose(tmp_path: Path, shot: Recording) -> None:
    folder = write_seven_scenes(tmp_path, shot)
    (folder / "frame-000010.pose.txt").write_text("")
    with pytest.raises(InputError, match=r"frame-000010\.pose\.txt: the file is empty"):
        open_sequence(folder)


# Open3D and Redwood


def test_redwood_without_intrinsics_has_primesense_and_says_so(tmp_path: Path) -> None:
    camera = PinholeCamera(640, 480, 525.0, 525.0, 319.5, 239.5)
    full = recording(camera, count=2)
    sequence = open_sequence(write_redwood(tmp_path, full, intrinsics=False))
    assert sequence.camera == camera
    assert "PrimeSense" in sequence.notes[0]
    cloud = sequence.frames[1].load()
    assert np.abs(cloud.points - full.points(1))[cloud.observed].max() < 6e-4


def test_redwood_of_another_size_needs_its_intrinsics(tmp_path: Path, shot: Recording) -> None:
    folder = write_redwood(tmp_path, shot, intrinsics=False)
    with pytest.raises(InputError, match=r"not 160 x 120; put camera_intrinsic\.json"):
        open_sequence(folder)


def test_redwood_log_may_stand_where_reconstruction_puts_it(
    tmp_path: Path, shot: Recording
) -> None:
    folder = write_redwood(tmp_path, shot)
    (folder / "scene").mkdir()
    (folder / "trajectory.log").rename(folder / "scene" / "trajectory.log")
    assert_poses(folder, shot)


def test_redwood_leaves_depth_maps_without_pose_out(tmp_path: Path, shot: Recording) -> None:
    folder = write_redwood(tmp_path, shot)
    lines = (folder / "trajectory.log").read_text().splitlines()
    (folder / "trajectory.log").write_text("\n".join([*lines[:5], *lines[10:]]))
    sequence = open_sequence(folder)
    assert [frame.index for frame in sequence.frames] == [0, 2]
    np.testing.assert_allclose(sequence.frames[1].pose, shot.poses[2], atol=1e-7)
    assert sequence.notes == ("1 of 3 depth maps left out: no pose",)


def with_line(text: str, at: int, line: str) -> str:
    lines = text.splitlines()
    lines[at - 1] = line
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("at", "line", "message"),
    [
        (6, "one two three", r"trajectory\.log, line 6: expected three integers before"),
        (7, "1 0 0", r"line 7: expected 4 numbers, a row of a pose, found '1 0 0'"),
        (7, "1 0 0 x", r"line 7: expected 4 numbers"),
        (7, "5 0 0 0", r"line 6: the upper left 3 x 3 block is not a rotation"),
        (6, "0 0 1", r"line 6: a second pose for depth map 0"),
        (6, "3 3 4", r"line 6: a pose for depth map 3, counted from 0, but there are only 3"),
    ],
)
def test_a_bad_line_of_a_log_is_named(
    tmp_path: Path, shot: Recording, at: int, line: str, message: str
) -> None:
    log = write_redwood(tmp_path, shot) / "trajectory.log"
    log.write_text(with_line(log.read_text(), at, line))
    with pytest.raises(InputError, match=message):
        open_sequence(tmp_path)


def test_a_log_that_is_cut_short_is_named(tmp_path: Path, shot: Recording) -> None:
    log = write_redwood(tmp_path, shot) / "trajectory.log"
    log.write_text("\n".join(log.read_text().splitlines()[:8]))
    with pytest.raises(InputError, match=r"line 8: the file ends inside the pose .* line 6"):
        open_sequence(tmp_path)


def test_depth_maps_without_a_log_are_told_so(tmp_path: Path, shot: Recording) -> None:
    (write_redwood(tmp_path, shot) / "trajectory.log").unlink()
    with pytest.raises(InputError, match=r"without poses: trajectory\.log is not there"):
        open_sequence(tmp_path)


# InfiniTAM


def quaternions(shot: Recording, order: str) -> list[str]:
    lines = []
    for pose in shot.poses:
        q, t = Rotation.from_matrix(pose[:3, :3]).as_quat(), pose[:3, 3]
        numbers = [*q, *t] if order == "quaternion first" else [*t, *q]
        lines.append(",".join(f"{n:.9f}" for n in numbers))
    return lines


def blocks(shot: Recording, height: int) -> list[str]:
    return [
        "\n".join(" ".join(f"{n:.10f}" for n in row) for row in pose[:height]) + "\n"
        for pose in shot.poses
    ]


@pytest.mark.parametrize(
    ("form", "lines"),
    [
        ("3 x 4 a line", lambda s: [" ".join(map(repr, p[:3].ravel().tolist())) for p in s.poses]),
        ("4 x 4 a line", lambda s: [", ".join(map(repr, p.ravel().tolist())) for p in s.poses]),
        ("stacked 4 x 4", lambda s: blocks(s, 4)),
        ("stacked 3 x 4", lambda s: blocks(s, 3)),
        ("the paper's shark", lambda s: quaternions(s, "quaternion first")),
        ("position first", lambda s: quaternions(s, "position first")),
    ],
)
def test_poses_of_every_form_are_the_same(
    tmp_path: Path, shot: Recording, form: str, lines: object
) -> None:
    folder = write_infinitam(tmp_path, shot)
    (folder / "poses.txt").unlink()
    (folder / "shark_bot_01.poses").write_text("\n".join(lines(shot)))  # type: ignore[operator]
    assert_poses(folder, shot)


@pytest.mark.parametrize("where", ["Frames/{:04d}.txt", "poses/pose{:04d}.txt"])
def test_infinitam_poses_may_stand_in_a_file_a_frame(
    tmp_path: Path, shot: Recording, where: str
) -> None:
    folder = write_infinitam(tmp_path, shot)
    (folder / "poses.txt").unlink()
    for k, pose in enumerate(shot.poses):
        write_matrix(folder / where.format(k), pose)
    assert_poses(folder, shot)
    write_matrix(folder / where.format(3), np.eye(4))
    with pytest.raises(InputError, match=r"0003\.txt: a pose whose depth map is not in"):
        open_sequence(folder)


def test_infinitam_depth_maps_may_stand_in_the_folder_itself(
    tmp_path: Path, shot: Recording
) -> None:
    folder = write_infinitam(tmp_path, shot)
    for file in (folder / "Frames").iterdir():
        file.rename(folder / file.name)
    (folder / "calib.txt").unlink()
    write_matrix(folder / "camera-intrinsics.txt", shot.camera.matrix)
    assert open_sequence(folder).camera == shot.camera
    assert_poses(folder, shot)


@pytest.mark.parametrize("depth_values", ["kinect 1100.5 0.08", "1100.5 0.08"])
def test_infinitam_disparities_of_a_kinect_become_metres(
    tmp_path: Path, shot: Recording, depth_values: str
) -> None:
    """z = 8 b f / (a - r): written backwards, read forwards."""
    folder = write_infinitam(tmp_path, shot)
    (folder / "calib.txt").write_text(infinitam_calibration(shot.camera, depth_values))
    for k, depth in enumerate(shot.depths):
        disparity = 1100.5 - 8 * 0.08 * shot.camera.fx / depth
        write_pgm(folder / "Frames" / f"{k:04d}.pgm", raw(disparity, 1.0))
    cloud = open_sequence(folder).frames[0].load()
    truth = shot.depths[0]
    step = truth**2 / (8 * 0.08 * shot.camera.fx)  # of depth a unit of disparity
    off = np.abs(cloud.points[..., 2] - truth) / step
    assert cloud.observed.mean() > 0.9
    assert off[cloud.observed].max() < 0.55


@pytest.mark.parametrize(("depth_values", "scale"), [("affine 0.0002 0", 5000), ("0 0", 1000)])
def test_infinitam_affine_depth_has_its_own_unit(
    tmp_path: Path, shot: Recording, depth_values: str, scale: int
) -> None:
    folder = write_infinitam(tmp_path, shot)
    (folder / "calib.txt").write_text(infinitam_calibration(shot.camera, depth_values))
    write_pgm(folder / "Frames" / "0000.pgm", raw(shot.depths[0], scale))
    cloud = open_sequence(folder).frames[0].load()
    assert np.abs(cloud.points - shot.points(0))[cloud.observed].max() < 0.51 / scale


def test_infinitam_affine_depth_may_have_an_offset(tmp_path: Path, shot: Recording) -> None:
    folder = write_infinitam(tmp_path, shot)
    (folder / "calib.txt").write_text(infinitam_calibration(shot.camera, "affine 0.001 0.25"))
    write_pgm(folder / "Frames" / "0000.pgm", raw(shot.depths[0] - 0.25, 1000))
    cloud = open_sequence(folder).frames[0].load()
    assert np.abs(cloud.points - shot.points(0))[cloud.observed].max() < 0.51e-3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("640 480\n500 500\n320 240\n", r"calib\.txt: 6 numbers, expected the 26 of"),
        ("wide high\n", r"calib\.txt, line 1: found 'wide' among the numbers"),
        ("", r"calib\.txt: the file is empty"),
    ],
)
def test_a_malformed_calibration_is_named(
    tmp_path: Path, shot: Recording, text: str, message: str
) -> None:
    (write_infinitam(tmp_path, shot) / "calib.txt").write_text(text)
    with pytest.raises(InputError, match=message):
        open_sequence(tmp_path)


def test_a_calibration_without_depth_is_named(tmp_path: Path, shot: Recording) -> None:
    folder = write_infinitam(tmp_path, shot)
    (folder / "calib.txt").write_text(infinitam_calibration(shot.camera, "affine -0.001 0"))
    with pytest.raises(InputError, match="no positive depth"):
        open_sequence(folder)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["1 2 3"], r"poses\.txt, line 1: expected one pose a line as 16 numbers"),
        (["1 0 0 0 0 1 0 0 0 0 1 0"] * 2 + ["1 0"], r"line 3: expected 12 numbers as on line 1"),
        (["1 0 0 0 0 1 0 0 0 0 1 x"], r"poses\.txt, line 1: expected 12 numbers, found"),
        (["2 0 0 0 0 1 0 0 0 0 1 0"] * 3, r"poses\.txt, line 1: .*not a rotation"),
        (["1 0 0 0 0 1 0 0 0 0 -1 0"] * 3, r"poses\.txt, line 1: .*reflection"),
        (["1 0 0 0"] * 4, r"line 4: 4 lines of 4 numbers are not a whole number of 3 x 4"),
        (["0 0 0 1 5 5 5", "0 0 0 1 5 5 5", "0 0 1 1 5 5 5"], r"line 3: .*quaternion of length 1"),
        (["1 0 0 0 0 1 0 0 0 0 1 0"] * 2, r"2 poses for 3 files, 0000\.pgm to 0002\.pgm"),
        ([], r"poses\.txt: the file is empty"),
    ],
)
def test_bad_poses_are_named(
    tmp_path: Path, shot: Recording, lines: list[str], message: str
) -> None:
    (write_infinitam(tmp_path, shot) / "poses.txt").write_text("\n".join(lines))
    with pytest.raises(InputError, match=message):
        open_sequence(tmp_path)


def test_infinitam_without_poses_or_camera_says_what_is_missing(
    tmp_path: Path, shot: Recording
) -> None:
    folder = write_infinitam(tmp_path, shot)
    (folder / "calib.txt").unlink()
    with pytest.raises(InputError, match=r"no calib\.txt and no intrinsics .* 160 x 120"):
        open_sequence(folder)
    (folder / "poses.txt").unlink()
    with pytest.raises(InputError, match="3 depth maps without poses"):
        open_sequence(folder)


def test_two_files_with_one_number_are_refused(tmp_path: Path, shot: Recording) -> None:
    folder = write_infinitam(tmp_path, shot)
    write_pgm(folder / "Frames" / "depth1.pgm", raw(shot.depths[1], 1000))
    with pytest.raises(InputError, match=r"depth1\.pgm: has the number of 0001\.pgm"):
        open_sequence(folder)


# KITTI and folders of clouds


def test_a_scan_that_is_cut_short_is_named(tmp_path: Path, shot: Recording) -> None:
    folder = write_kitti(tmp_path / "00", shot)
    file = folder / "velodyne" / "000001.bin"
    file.write_bytes(file.read_bytes()[:1001])
    with pytest.raises(InputError, match=r"000001\.bin: 1001 bytes are not a whole number"):
        open_sequence(folder).frames[1].load()


def test_a_shot_that_met_nothing_is_unobserved(tmp_path: Path, shot: Recording) -> None:
    folder = write_kitti(tmp_path / "00", shot)
    file = folder / "velodyne" / "000001.bin"
    points = np.fromfile(file, "<f4").reshape(-1, 4)
    points[5, :3] = 0.0
    points.tofile(file)
    assert len(open_sequence(folder).frames[1].load()) == len(points) - 1


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        ("calib.txt", "P0: 1 2 3\n", r"calib\.txt: no line 'Tr:' .*found P0:"),
        ("calib.txt", "Tr: 1 2 3\n", r"calib\.txt, line 1: expected 'Tr:' and 12 numbers"),
        ("calib.txt", "Tr: 9 0 0 0 0 9 0 0 0 0 9 0\n", r"calib\.txt, line 1: .*not a rotation"),
        ("calib.txt", None, r"calib\.txt: no such file"),
        ("poses.txt", None, r"poses\.txt: no such file"),
        ("times.txt", "0.0\n0.2\n0.1\n", r"times\.txt, line 3: timestamp 0\.1.* earlier than"),
        ("times.txt", "0.0\n0.2\n", r"times\.txt: 2 timestamps for 3 poses"),
    ],
)
def test_kitti_files_that_are_wrong_are_named(
    tmp_path: Path, shot: Recording, file: str, text: str | None, message: str
) -> None:
    folder = write_kitti(tmp_path / "00", shot)
    if text is None:
        (folder / file).unlink()
    else:
        (folder / file).write_text(text)
    with pytest.raises(InputError, match=message):
        open_sequence(folder)


def test_a_velodyne_folder_without_scans_is_named(tmp_path: Path) -> None:
    (tmp_path / "velodyne").mkdir()
    with pytest.raises(InputError, match=r"velodyne: no \.bin files"):
        open_sequence(tmp_path)


def test_clouds_and_poses_that_do_not_go_together_are_counted(
    tmp_path: Path, shot: Recording
) -> None:
    folder = write_clouds(tmp_path, shot)
    lines = (folder / "poses.txt").read_text().splitlines()
    (folder / "poses.txt").write_text("\n".join(lines[:2]))
    with pytest.raises(InputError, match=r"poses\.txt: 2 poses for 3 files"):
        open_sequence(folder)


def test_a_damaged_cloud_is_an_error_when_it_is_loaded(tmp_path: Path, shot: Recording) -> None:
    folder = write_clouds(tmp_path, shot)
    file = folder / "scan_000.ply"
    file.write_bytes(file.read_bytes()[:5000])
    with pytest.raises(InputError, match=r"scan_000\.ply"):
        open_sequence(folder).frames[0].load()
