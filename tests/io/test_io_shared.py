"""Real files: depth maps of a Kinect, scans of a LiDAR."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hmrf_icp.io import read_camera, read_cloud, read_depth, read_pose

DATA = Path(__file__).parents[3] / "shared" / "data"

pytestmark = [
    pytest.mark.shared,
    pytest.mark.skipif(not DATA.is_dir(), reason=f"no recorded data at {DATA}"),
]


@pytest.mark.parametrize("sequence", ["kitchen-real", "kitchen-exact", "tabletop-exact"])
def test_recorded_depth_maps(sequence):
    folder = DATA / sequence
    camera = read_camera(folder / "camera-intrinsics.txt", 640, 480)
    assert camera.fx == camera.fy
    frame = sorted(folder.glob("*.depth.png"))[0]
    depth = read_depth(frame)
    assert (depth.shape, depth.dtype) == ((480, 640), np.uint16)
    cloud = read_cloud(frame, camera)
    assert cloud.shape == (480, 640)
    assert 0.2 < np.median(cloud.observed_points[:, 2]) < 5.0
    assert not cloud.observed[depth == 0].any()
    assert not cloud.observed[depth == 65535].any()
    pose = read_pose(str(frame).replace(".depth.png", ".pose.txt"))
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)


def test_lidar_scans():
    source = read_cloud(DATA / "lidar" / "source.ply")
    assert source.shape == (69_792,)
    assert len(source) == 64_685  # beams without an echo are written as 0 0 0
    assert "0" in "".join(source.notes)
    assert 10.0 < np.linalg.norm(source.observed_points, axis=1).max() < 200.0
    assert read_pose(DATA / "lidar" / "T_target_source.txt")[0, 3] == pytest.approx(0.488882)
