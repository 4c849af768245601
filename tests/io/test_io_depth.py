"""A depth map comes out of a file with the numbers that the sensor wrote."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image

from hmrf_icp import InputError, PinholeCamera
from hmrf_icp.io import depth as depth_files
from hmrf_icp.io import read_cloud, read_depth

MILLIMETRES = hnp.arrays(
    np.uint16, hnp.array_shapes(min_dims=2, max_dims=2, max_side=9), elements=st.integers(0, 65535)
)
DEPTH = np.arange(12, dtype=np.uint16).reshape(3, 4) * 300
CAMERA = PinholeCamera(width=4, height=3, fx=4.0, fy=4.0, cx=1.5, cy=1.0)


def pgm(depth, maximum=65535, comment=b""):
    height, width = depth.shape
    header = b"P5\n%s%d %d\n%d\n" % (comment, width, height, maximum)
    return header + depth.astype(">u2").tobytes()


@given(depth=MILLIMETRES)
def test_sixteen_bit_images_keep_every_value(depth, tmp_path_factory):
    folder = tmp_path_factory.mktemp("depth")
    for suffix in (".png", ".tif", ".tiff"):
        Image.fromarray(depth).save(folder / f"d{suffix}")
    np.save(folder / "d.npy", depth)
    (folder / "d.pgm").write_bytes(pgm(depth))
    for suffix in (".png", ".tif", ".tiff", ".npy", ".pgm"):
        read = read_depth(folder / f"d{suffix}")
        assert read.dtype == np.uint16
        np.testing.assert_array_equal(read, depth)


def test_floating_point_tiff_keeps_metres_and_holes(tmp_path):
    metres = (DEPTH / 1000).astype(np.float32)
    metres[0, 0] = np.nan
    Image.fromarray(metres).save(tmp_path / "d.tif")
    np.testing.assert_array_equal(read_depth(tmp_path / "d.tif"), metres)


@pytest.mark.parametrize("maximum", [3300, 10000, 65535])
def test_pgm_is_not_stretched_to_its_maximum(tmp_path, maximum):
    (tmp_path / "d.pgm").write_bytes(pgm(DEPTH, maximum, b"# made by a sensor\n"))
    np.testing.assert_array_equal(read_depth(tmp_path / "d.pgm"), DEPTH)


def test_plain_pgm_with_comments(tmp_path):
    (tmp_path / "d.pgm").write_text("P2 # plain\n3 2\n# max\n4000\n1 2 3\n4000 0 # end\n7\n")
    np.testing.assert_array_equal(read_depth(tmp_path / "d.pgm"), [[1, 2, 3], [4000, 0, 7]])


def test_suffix_in_capitals(tmp_path):
    (tmp_path / "D.PGM").write_bytes(pgm(DEPTH))
    np.testing.assert_array_equal(read_depth(tmp_path / "D.PGM"), DEPTH)


def test_depth_map_becomes_an_organised_cloud_in_metres(tmp_path):
    Image.fromarray(DEPTH).save(tmp_path / "d.png")
    cloud = read_cloud(tmp_path / "d.png", CAMERA, max_depth=3.0)
    assert cloud.camera == CAMERA
    assert np.isnan(cloud.points[0, 0]).all(), "0 is unobserved"
    assert np.isnan(cloud.points[2, 3]).all(), "3.3 m is beyond max_depth"
    assert cloud.points[1, 1, 2] == pytest.approx(1.5)
    assert read_cloud(tmp_path / "d.png", CAMERA, 100.0).points[1, 1, 2] == pytest.approx(15.0)


@pytest.mark.parametrize(
    ("mode", "found"),
    [("L", "8-bit"), ("P", "8-bit"), ("1", "1-bit"), ("RGB", "3 channels"), ("RGBA", "4 channels")],
)
@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_a_picture_is_not_a_depth_map(tmp_path, mode, found, suffix):
    path = tmp_path / f"colour{suffix}"
    Image.new(mode, (4, 3)).save(path)
    with pytest.raises(InputError, match=rf"colour{suffix}: .*{found}.*expected one channel"):
        read_depth(path)


def test_eight_bit_pgm_and_array_are_not_depth_maps(tmp_path):
    Image.new("L", (4, 3)).save(tmp_path / "grey.pgm")
    with pytest.raises(InputError, match=r"grey\.pgm: an 8-bit image"):
        read_depth(tmp_path / "grey.pgm")
    np.save(tmp_path / "grey.npy", DEPTH.astype(np.uint8))
    with pytest.raises(InputError, match=r"grey\.npy: an array of uint8"):
        read_depth(tmp_path / "grey.npy")
    np.save(tmp_path / "rgb.npy", np.zeros((3, 4, 3), np.uint8))
    with pytest.raises(InputError, match=r"rgb\.npy: an array of uint8 is a picture"):
        read_cloud(tmp_path / "rgb.npy")


def test_several_images_in_a_tiff_are_refused(tmp_path):
    image = Image.fromarray(DEPTH)
    image.save(tmp_path / "d.tif", save_all=True, append_images=[image])
    with pytest.raises(InputError, match=r"d\.tif: 2 images in one file"):
        read_depth(tmp_path / "d.tif")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"P5 4 3 1000\n" + b"\0" * 23, "cut short: 4 x 3 pixels promised, 11 found"),
        (b"P5 4 3 1000\n" + b"\xff" * 24, "65535 above the maximum"),
        (b"P5 0 3 1000\n", "out of range"),
        (b"P5 4 3 70000\n", "out of range"),
        (b"P6 4 3 1000\n", "not a PGM image"),
        (b"P5 4", "not a PGM image"),
        (b"P2 2 1 1000\n1 x", "a sample of 'x'"),
        (b"P2 2 1 1000\n1", "1 found"),
    ],
)
def test_bad_pgm(tmp_path, content, message):
    (tmp_path / "d.pgm").write_bytes(content)
    with pytest.raises(InputError, match=rf"d\.pgm: .*{message}"):
        read_depth(tmp_path / "d.pgm")


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_an_image_of_absurd_size_is_refused_without_a_warning(tmp_path, monkeypatch, suffix):
    Image.fromarray(DEPTH).save(tmp_path / f"d{suffix}")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 8)  # Pillow would warn at this size
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_array_equal(read_depth(tmp_path / f"d{suffix}"), DEPTH)
        monkeypatch.setattr(depth_files, "MOST_PIXELS", 11)
        with pytest.raises(InputError, match=rf"d{suffix}: .*4 x 3 pixels is larger"):
            read_depth(tmp_path / f"d{suffix}")


@pytest.mark.parametrize("scale", [0.0, -1000.0, float("nan"), float("inf")])
def test_a_scale_that_is_none(tmp_path, scale):
    Image.fromarray(DEPTH).save(tmp_path / "d.png")
    with pytest.raises(InputError, match="depth_scale: expected a positive number"):
        read_cloud(tmp_path / "d.png", CAMERA, depth_scale=scale)


def test_a_depth_map_needs_a_camera(tmp_path):
    Image.fromarray(DEPTH).save(tmp_path / "d.png")
    with pytest.raises(InputError, match=r"d\.png: is a depth map, which needs the intrinsics"):
        read_cloud(tmp_path / "d.png")


def test_a_table_of_points_taken_for_a_depth_map_gets_a_hint(tmp_path):
    np.save(tmp_path / "xyzi.npy", np.zeros((100, 4)))
    with pytest.raises(InputError, match=r"keep x, y, z as \(N, 3\)"):
        read_cloud(tmp_path / "xyzi.npy")
