"""Depth maps of renderers and phones: EXR, float TIFF, a confidence beside; units are told."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from hmrf_icp import InputError, PinholeCamera, PointCloud
from hmrf_icp.io import read_cloud, read_depth

DEPTH = np.linspace(0.5, 4.0, 48, dtype=np.float32).reshape(6, 8)
CAMERA = PinholeCamera(8, 6, 8.0, 8.0, 3.5, 2.5)


def exr(path, channels, **header):
    library = pytest.importorskip("OpenEXR", reason="needs OpenEXR (the extra 'exr')")
    basic = {"compression": library.ZIP_COMPRESSION, "type": library.scanlineimage}
    with library.File(basic | header, channels) as file:
        file.write(str(path))
    return path


@pytest.mark.parametrize(
    "channels",
    [
        {"Z": DEPTH},
        {"depth.V": DEPTH},
        {"Any": DEPTH},
        {"R": DEPTH, "G": DEPTH, "B": DEPTH},
        {"ViewLayer.Depth.Z": DEPTH, "R": 2 * DEPTH, "G": DEPTH, "B": DEPTH},
    ],
)
def test_the_depth_of_an_exr(tmp_path, channels):
    np.testing.assert_array_equal(read_depth(exr(tmp_path / "d.exr", channels)), DEPTH)


def test_an_exr_of_half_precision_with_infinity_for_nothing(tmp_path):
    half = DEPTH.astype(np.float16)
    half[0, 0] = np.inf
    cloud = read_cloud(exr(tmp_path / "d.exr", {"Z": half}), CAMERA)
    assert len(cloud) == 47
    np.testing.assert_allclose(cloud.points[..., 2].ravel()[1:], half.ravel()[1:], rtol=1e-6)


def test_an_exr_that_stores_a_part_of_what_it_shows(tmp_path):
    window = np.array([2, 1], np.int32), np.array([9, 6], np.int32)
    shown = np.array([0, 0], np.int32), np.array([7, 7], np.int32)
    path = exr(tmp_path / "d.exr", {"Z": DEPTH}, dataWindow=window, displayWindow=shown)
    depth = read_depth(path)
    assert depth.shape == (8, 8)
    np.testing.assert_array_equal(depth[1:7, 2:], DEPTH[:, :6])
    assert np.isnan(depth).sum() == 64 - 36


def test_an_exr_that_is_no_depth_map(tmp_path):
    colours = {"R": DEPTH, "G": 2 * DEPTH, "B": DEPTH}
    with pytest.raises(InputError, match="channels B, G, R, none of which is called Z or depth"):
        read_depth(exr(tmp_path / "c.exr", colours))
    whole = exr(tmp_path / "d.exr", {"Z": DEPTH}).read_bytes()
    for end in (6, 100, len(whole) - 20):
        (tmp_path / "cut.exr").write_bytes(whole[:end])
        with pytest.raises(InputError, match=r"cut\.exr: "):
            read_depth(tmp_path / "cut.exr")
    at = whole.index(b"dataWindow") + len(b"dataWindow\0box2i\0") + 4
    huge = np.array([0, 0, 2**30, 2**30], "<i4").tobytes()
    (tmp_path / "huge.exr").write_bytes(whole[:at] + huge + whole[at + 16 :])
    with pytest.raises(InputError, match=r"huge\.exr: "):
        read_depth(tmp_path / "huge.exr")


def test_without_openexr_the_extra_is_named(tmp_path, monkeypatch):
    (tmp_path / "d.exr").write_bytes(b"v/1\x01")
    monkeypatch.setitem(__import__("sys").modules, "OpenEXR", None)
    with pytest.raises(InputError, match=r"needs OpenEXR .*pip install 'hmrf-icp\[exr\]'"):
        read_depth(tmp_path / "d.exr")


def test_tiff_of_floating_point_is_in_metres(tmp_path):
    Image.fromarray(DEPTH).save(tmp_path / "d.tiff")
    np.testing.assert_array_equal(read_depth(tmp_path / "d.tiff"), DEPTH)
    cloud = read_cloud(tmp_path / "d.tiff", CAMERA)
    np.testing.assert_allclose(cloud.points[..., 2], DEPTH)
    assert not cloud.notes


@pytest.mark.parametrize("suffix", [".png", ".tif", ".pgm", ".npy"])
@pytest.mark.parametrize(("least", "left"), [(None, 32), (2, 16), (0, 48)])
def test_depths_that_arkit_is_not_sure_of_are_unobserved(tmp_path, suffix, least, left):
    levels = (np.arange(48, dtype=np.uint8) % 3).reshape(6, 8)
    mask = tmp_path / f"confidence{suffix}"
    if suffix == ".npy":
        np.save(mask, levels)
    elif suffix == ".pgm":
        mask.write_bytes(b"P5 8 6 2\n" + levels.tobytes())
    else:
        Image.fromarray(levels).save(mask)
    Image.fromarray(DEPTH).save(tmp_path / "d.tiff")
    asked = {} if least is None else {"min_confidence": least}
    cloud = read_cloud(tmp_path / "d.tiff", CAMERA, confidence=mask, **asked)
    assert len(cloud) == left
    np.testing.assert_array_equal(cloud.observed, levels >= (1 if least is None else least))


def test_a_confidence_of_another_size_or_for_a_cloud(tmp_path):
    Image.fromarray(DEPTH).save(tmp_path / "d.tiff")
    np.save(tmp_path / "m.npy", np.ones((3, 8), np.uint8))
    with pytest.raises(InputError, match=r"m\.npy: 8 x 3 pixels, the depth map has 8 x 6"):
        read_depth(tmp_path / "d.tiff", tmp_path / "m.npy")
    np.save(tmp_path / "c.npy", np.ones((12, 3)))
    with pytest.raises(InputError, match=r"c\.npy: holds no depth map, which a confidence"):
        read_cloud(tmp_path / "c.npy", confidence=tmp_path / "m.npy")
    Image.fromarray(np.ones((6, 8), np.uint8)).save(tmp_path / "8.png")
    with pytest.raises(InputError, match="an 8-bit image, expected one channel of depth"):
        read_depth(tmp_path / "8.png")


@pytest.mark.parametrize(
    ("depth", "scale", "word"),
    [
        (1000.0 * DEPTH, None, "probably millimetres; give depth_scale=1000"),
        (1000.0 * DEPTH, 1.0, None),
        (DEPTH, None, None),
        ((1000.0 * DEPTH).astype(np.uint16), None, None),
        (np.rint(4.0 * DEPTH).astype(np.uint16), None, "probably another unit"),
        (np.rint(4.0 * DEPTH).astype(np.uint16), 4.0, None),
    ],
)
def test_units_are_guessed_to_warn_and_never_to_scale(depth, scale, word):
    cloud = PointCloud.from_depth(depth, CAMERA, scale)
    assert bool(word) == any(word in note for note in cloud.notes if word)
    assert word is not None or not cloud.notes
    unit = scale or (1.0 if depth.dtype.kind == "f" else 1000.0)
    np.testing.assert_allclose(cloud.points[..., 2], depth.astype(float) / unit)
