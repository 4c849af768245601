"""Each format gives back the recording that was written in it."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from dataset_writers import (
    LIDAR_TO_CAMERA,
    Recording,
    lidar_scan,
    recording,
    to_world,
    write_clouds,
    write_infinitam,
    write_kitti,
    write_redwood,
    write_seven_scenes,
    write_tum,
)
from scipy.spatial import cKDTree

from hmrf_icp.datasets import open_sequence
from hmrf_icp.se3 import inverse

DEPTH_CAMERAS = {
    "TUM RGB-D": (write_tum, 5000.0),
    "7-Scenes": (write_seven_scenes, 1000.0),
    "Open3D/Redwood": (write_redwood, 1000.0),
    "InfiniTAM": (write_infinitam, 1000.0),
}
WRITERS: dict[str, Callable[[Path, Recording], Path]] = {
    **{name: writer for name, (writer, _) in DEPTH_CAMERAS.items()},
    "KITTI odometry": write_kitti,
    "clouds with poses": write_clouds,
}


@pytest.mark.parametrize("name", DEPTH_CAMERAS)
def test_depth_maps_come_back_with_their_poses(name: str, tmp_path: Path) -> None:
    writer, scale = DEPTH_CAMERAS[name]
    shot = recording()
    sequence = open_sequence(writer(tmp_path / "rec", shot))
    assert (sequence.format, sequence.sensor) == (name, "depth camera")
    assert sequence.camera == shot.camera
    assert sequence.source == tmp_path / "rec"
    assert sequence.notes == ()
    assert len(sequence) == len(shot.poses)
    for k, frame in enumerate(sequence.frames):
        np.testing.assert_allclose(frame.pose, shot.poses[k], atol=2e-7)
        cloud = frame.load()
        truth = shot.points(k)
        assert cloud.camera == shot.camera
        np.testing.assert_array_equal(cloud.observed, np.isfinite(truth[..., 0]))
        off = np.abs(cloud.points - truth)[cloud.observed]
        assert off.max() <= 0.51 / scale  # what rounding to the file's unit costs


def test_the_frames_have_the_numbers_and_times_of_the_recording(tmp_path: Path) -> None:
    shot = recording()
    scenes = open_sequence(write_seven_scenes(tmp_path / "seven", shot))
    assert [frame.index for frame in scenes.frames] == [0, 10, 20]
    assert [frame.timestamp for frame in scenes.frames] == [None] * 3
    desk = open_sequence(write_tum(tmp_path / "tum", shot))
    assert [frame.index for frame in desk.frames] == [0, 1, 2]
    times = [frame.timestamp for frame in desk.frames]
    np.testing.assert_allclose(np.diff(times), np.diff(shot.seconds), atol=2e-6)


def test_kitti_scans_get_the_pose_of_the_lidar_not_of_the_camera(tmp_path: Path) -> None:
    shot = recording()
    sequence = open_sequence(write_kitti(tmp_path / "00", shot))
    assert (sequence.format, sequence.sensor, sequence.camera) == ("KITTI odometry", "lidar", None)
    lidar = [pose @ LIDAR_TO_CAMERA for pose in shot.poses]
    for k, frame in enumerate(sequence.frames):
        true = inverse(lidar[0]) @ lidar[k]
        found = inverse(sequence.frames[0].pose) @ frame.pose
        np.testing.assert_allclose(found, true, atol=1e-7)
        cloud = frame.load()
        np.testing.assert_allclose(cloud.points, lidar_scan(k), atol=1e-6)
        np.testing.assert_array_equal(cloud.viewpoint, np.zeros(3))
        assert frame.timestamp == pytest.approx(shot.seconds[k])


def test_kitti_poses_are_found_where_kitti_keeps_them(tmp_path: Path) -> None:
    folder = write_kitti(tmp_path / "dataset" / "sequences" / "07", recording())
    (tmp_path / "dataset" / "poses").mkdir()
    (folder / "poses.txt").rename(tmp_path / "dataset" / "poses" / "07.txt")
    assert len(open_sequence(folder)) == 3


def test_a_kept_part_of_a_kitti_sequence_finds_its_poses_by_number(tmp_path: Path) -> None:
    folder = write_kitti(tmp_path / "00", recording())
    whole = open_sequence(folder)
    (folder / "velodyne" / "000000.bin").unlink()
    part = open_sequence(folder)
    assert [frame.index for frame in part.frames] == [1, 2]
    np.testing.assert_array_equal(part.frames[0].pose, whole.frames[1].pose)
    assert part.frames[0].timestamp == whole.frames[1].timestamp


def test_a_folder_of_clouds_is_seen_from_each_origin(tmp_path: Path) -> None:
    shot = recording()
    sequence = open_sequence(write_clouds(tmp_path / "rec", shot))
    assert (sequence.format, sequence.sensor) == ("clouds with poses", "cloud")
    assert "sensor's" in sequence.notes[0]
    for k, frame in enumerate(sequence.frames):
        np.testing.assert_allclose(frame.pose, shot.poses[k], atol=1e-8)
        cloud = frame.load()
        truth = shot.points(k)
        truth = truth[np.isfinite(truth[..., 0])]
        np.testing.assert_allclose(cloud.observed_points, truth, atol=1e-6)
        np.testing.assert_array_equal(cloud.viewpoint, np.zeros(3))


@pytest.mark.parametrize("name", WRITERS)
def test_two_frames_lie_on_one_surface_in_the_world(name: str, tmp_path: Path) -> None:
    frames = open_sequence(WRITERS[name](tmp_path / "rec", recording())).frames
    first, second = (to_world(frame.load().points, frame.pose) for frame in frames[:2])
    distance = cKDTree(first).query(second)[0]
    # Pixels are some 7 mm apart on the table, shots of the LiDAR 2 cm. The frames are 12 cm and
    # 6 degrees apart.
    assert np.median(distance) < (0.02 if name == "KITTI odometry" else 0.008)
    wrong = to_world(frames[1].load().points, frames[0].pose)
    assert np.median(cKDTree(first).query(wrong)[0]) > 2 * np.median(distance)


@pytest.mark.parametrize("name", WRITERS)
def test_frames_travel_to_other_processes_without_their_pixels(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    frame = open_sequence(WRITERS[name](Path("rec"), recording())).frames[1]
    parcel = pickle.dumps(frame)
    assert len(parcel) < 2000
    monkeypatch.chdir("/")  # the worker may run elsewhere
    arrived = pickle.loads(parcel)
    np.testing.assert_array_equal(arrived.pose, frame.pose)
    np.testing.assert_array_equal(arrived.load().points, frame.load().points)


@pytest.mark.shared
@pytest.mark.parametrize(
    ("folder", "count", "centre"),
    [
        ("kitchen-real", 50, (320.0, 240.0)),
        ("kitchen-exact", 50, (320.0, 240.0)),
        ("tabletop-exact", 40, (319.5, 239.5)),
    ],
)
def test_real_folders_open_with_their_own_camera(
    shared: Path, folder: str, count: int, centre: tuple[float, float]
) -> None:
    sequence = open_sequence(shared / "data" / folder)
    assert (sequence.format, len(sequence), sequence.notes) == ("7-Scenes", count, ())
    assert sequence.camera is not None
    assert (sequence.camera.cx, sequence.camera.cy) == centre
    first, second = (
        to_world(frame.load().subsample(4).points, frame.pose) for frame in sequence.frames[:2]
    )
    assert np.median(cKDTree(first).query(second)[0]) < 0.02
