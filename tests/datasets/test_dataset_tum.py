"""TUM RGB-D: time, cameras, and everything that can be wrong in its two lists."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dataset_writers import START, recording, tum_line, walk, write_tum

from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.datasets import open_sequence
from hmrf_icp.errors import InputError
from hmrf_icp.se3 import rotation_angle


def lines_of(path: Path) -> list[str]:
    return path.read_text().splitlines()


def write_lines(path: Path, lines: list[str]) -> None:
    path.write_text("\n".join(lines) + "\n")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_tum(tmp_path / "rec", recording())


def test_poses_are_interpolated_at_the_shutter_time(folder: Path) -> None:
    """Half-way between two samples a large turn apart, the rotation is half of the turn."""
    ticks = np.array([-0.009, 0.009])
    fast = [walk(30 * t) for t in ticks]  # 10 degrees between the two
    lines = [tum_line(t, pose) for t, pose in zip(ticks, fast, strict=True)]
    later = [tum_line(t, walk(t)) for t in np.arange(0.3233, 0.68, 0.01)]
    write_lines(folder / "groundtruth.txt", lines + later)
    frame = open_sequence(folder).frames[0]
    assert rotation_angle(np.linalg.inv(fast[0]) @ fast[1]) > np.radians(9)
    np.testing.assert_allclose(frame.pose, walk(0.0), atol=2e-6)


def test_frames_without_ground_truth_close_by_are_left_out_and_counted(folder: Path) -> None:
    truth = folder / "groundtruth.txt"
    middle = START + recording().seconds[1]
    kept = [
        line
        for line in lines_of(truth)
        if line.startswith("#") or abs(float(line.split()[0]) - middle) > 0.021
    ]
    write_lines(truth, kept)
    sequence = open_sequence(folder)
    assert [frame.index for frame in sequence.frames] == [0, 2]
    assert sequence.notes[0].startswith("1 of 3 depth maps left out: no ground truth")


def test_a_shutter_before_or_after_the_ground_truth_is_not_extrapolated(folder: Path) -> None:
    truth = folder / "groundtruth.txt"
    start = START + 0.001  # one millisecond after the first shutter
    kept = [ln for ln in lines_of(truth) if ln.startswith("#") or float(ln.split()[0]) > start]
    write_lines(truth, kept)
    assert [frame.index for frame in open_sequence(folder).frames] == [1, 2]


def test_a_shutter_at_the_very_time_of_the_last_sample_has_its_pose(folder: Path) -> None:
    truth = folder / "groundtruth.txt"
    last = recording().seconds[-1]
    kept = [
        ln for ln in lines_of(truth) if ln.startswith("#") or float(ln.split()[0]) < START + last
    ]
    write_lines(truth, [*kept, tum_line(last, walk(last))])
    frame = open_sequence(folder).frames[-1]
    assert frame.index == 2
    np.testing.assert_allclose(frame.pose, walk(last), atol=1e-6)


def test_a_sample_written_twice_does_no_harm(folder: Path) -> None:
    truth = folder / "groundtruth.txt"
    lines = lines_of(truth)
    before = open_sequence(folder)
    write_lines(truth, [*lines[:6], lines[5], *lines[6:]])
    after = open_sequence(folder)
    for a, b in zip(before.frames, after.frames, strict=True):
        np.testing.assert_array_equal(a.pose, b.pose)


@pytest.mark.parametrize(
    ("name", "fx", "fy", "cx", "cy"),
    [
        ("rgbd_dataset_freiburg1_desk", 517.3, 516.5, 318.6, 255.3),
        ("rgbd_dataset_freiburg2_desk", 520.9, 521.0, 325.1, 249.7),
        ("rgbd_dataset_freiburg3_long_office_household", 535.4, 539.2, 320.1, 247.6),
    ],
)
def test_each_freiburg_camera_has_its_own_intrinsics(
    tmp_path: Path, name: str, fx: float, fy: float, cx: float, cy: float
) -> None:
    sequence = open_sequence(write_tum(tmp_path / name, recording(), intrinsics=False))
    assert sequence.camera == PinholeCamera(640, 480, fx, fy, cx, cy)


def test_full_size_maps_of_a_freiburg_camera_unproject_onto_the_scene(tmp_path: Path) -> None:
    camera = PinholeCamera(640, 480, 517.3, 516.5, 318.6, 255.3)
    shot = recording(camera, count=2)
    folder = write_tum(tmp_path / "rgbd_dataset_freiburg1_made", shot, intrinsics=False)
    cloud = open_sequence(folder).frames[0].load()
    off = np.abs(cloud.points - shot.points(0))[cloud.observed]
    assert off.max() < 1.1e-4


def test_maps_of_another_size_than_the_freiburg_cameras_are_refused(tmp_path: Path) -> None:
    folder = write_tum(tmp_path / "freiburg2_half", recording(), intrinsics=False)
    with pytest.raises(InputError, match=r"depth/\d+\.\d+\.png: camera: intrinsics are for 640"):
        open_sequence(folder).frames[0].load()


def test_an_unknown_camera_is_an_error_that_says_what_to_do(tmp_path: Path) -> None:
    folder = write_tum(tmp_path / "desk", recording(), intrinsics=False)
    with pytest.raises(InputError, match=r"desk: which camera.*camera-intrinsics\.txt"):
        open_sequence(folder)


def test_two_intrinsics_files_are_one_too_many(folder: Path) -> None:
    (folder / "intrinsics.txt").write_text((folder / "camera-intrinsics.txt").read_text())
    with pytest.raises(InputError, match=r"2 files of intrinsics"):
        open_sequence(folder)


def edit(path: Path, at: int, line: str) -> None:
    """Replace a line, counted from 1 as messages do."""
    lines = lines_of(path)
    lines[at - 1] = line
    write_lines(path, lines)


@pytest.mark.parametrize(
    ("file", "at", "line", "message"),
    [
        ("depth.txt", 5, "depth/x.png", r"depth\.txt, line 5: expected a timestamp and the name"),
        ("depth.txt", 5, "soon depth/x.png", r"depth\.txt, line 5: expected a timestamp in sec"),
        ("depth.txt", 5, "nan depth/x.png", r"depth\.txt, line 5: expected a finite timestamp"),
        ("depth.txt", 6, f"{START} depth/x.png", r"line 6: timestamp .* earlier than .* of line 5"),
        ("groundtruth.txt", 4, "1 2 3", r"line 4: expected timestamp tx ty tz qx qy qz qw, found"),
        ("groundtruth.txt", 4, "1 0 0 0 0 0 0 x", r"line 4: expected timestamp tx"),
        ("groundtruth.txt", 4, "1 0 0 0 0 0 0 1", r"groundtruth\.txt, line 4: timestamp 1\.000000"),
        ("groundtruth.txt", 3, f"{START - 1} 0 0 0 0 0 .5 1", r"line 3: .*quaternion of length 1"),
        ("groundtruth.txt", 3, f"{START - 1} 0 0 0 0 0 0 0", r"line 3: .*found length 0 "),
        ("groundtruth.txt", 3, f"{START - 1} inf 0 0 0 0 0 1", r"line 3: expected .*all finite"),
    ],
)
def test_a_bad_line_is_named(folder: Path, file: str, at: int, line: str, message: str) -> None:
    edit(folder / file, at, line)
    with pytest.raises(InputError, match=message):
        open_sequence(folder)


def test_a_depth_map_that_is_named_but_absent_is_named_with_its_line(folder: Path) -> None:
    gone = sorted((folder / "depth").iterdir())[1]
    gone.unlink()
    with pytest.raises(InputError, match=rf"depth\.txt, line 5: names depth/{gone.name}"):
        open_sequence(folder)


@pytest.mark.parametrize("file", ["depth.txt", "groundtruth.txt"])
def test_missing_and_empty_lists_are_named(folder: Path, file: str) -> None:
    (folder / file).write_text("# nothing\n\n")
    with pytest.raises(InputError, match=rf"{file}: nothing in it but"):
        open_sequence(folder)
    (folder / file).write_text("")
    with pytest.raises(InputError, match=rf"{file}: the file is empty"):
        open_sequence(folder)
    (folder / file).unlink()
    with pytest.raises(InputError, match=rf"{file}: no such file"):
        open_sequence(folder)


def test_no_frame_with_ground_truth_says_why(folder: Path) -> None:
    write_lines(folder / "groundtruth.txt", [tum_line(t - 500, walk(t)) for t in (0.0, 0.01)])
    with pytest.raises(InputError, match=r"0 usable frames .*3 of 3 depth maps left out"):
        open_sequence(folder)


def test_a_damaged_depth_map_is_an_error_when_it_is_loaded(folder: Path) -> None:
    file = sorted((folder / "depth").iterdir())[1]
    file.write_bytes(file.read_bytes()[:200])
    with pytest.raises(InputError, match=file.name):
        open_sequence(folder).frames[1].load()
