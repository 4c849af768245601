"""A file may be wrong in any way: an error that names it, soon and in little memory."""

from __future__ import annotations

import json
import os
import struct
import warnings
import zipfile

import numpy as np
import pytest

from hmrf_icp import InputError, PinholeCamera, PointCloud
from hmrf_icp.io import read_cloud, read_depth, read_intrinsics, read_pose, write_pose
from hmrf_icp.io.whole import require_writable

POINTS = np.random.default_rng(0).normal(size=(20, 3))


def test_an_archive_that_would_fill_the_memory_is_refused_before_it_does(tmp_path):
    path = tmp_path / "bomb.npz"
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("points.npy", "w") as member,
    ):
        np.lib.format.write_array_header_1_0(
            member, {"descr": "<f8", "fortran_order": False, "shape": (10**7, 3)}
        )
        for _ in range(240):
            member.write(bytes(10**6))
    with pytest.raises(InputError, match=r"bomb\.npz: .* would become 240,000,"):
        read_cloud(path)


def test_pcd_that_would_fill_the_memory_is_refused_before_it_does(tmp_path):
    count = 1 << 26
    header = (
        f"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {count}\nHEIGHT 1\n"
        f"POINTS {count}\nDATA binary_compressed\n"
    )
    body = bytes(1000)
    (tmp_path / "c.pcd").write_bytes(
        header.encode() + struct.pack("<II", len(body), 12 * count) + body
    )
    with pytest.raises(InputError, match=r"c\.pcd: 1,000 compressed bytes would become 805,306,"):
        read_cloud(tmp_path / "c.pcd")


@pytest.mark.parametrize("shape", [(10**12, 3), (10**6, 10**6), (2**62, 2**62, 3), (-1, 3)])
@pytest.mark.parametrize("suffix", [".npy", ".npz"])
def test_an_array_is_believed_as_far_as_its_file_goes(tmp_path, shape, suffix):
    path = tmp_path / f"c{suffix}"
    header = {"descr": "<f8", "fortran_order": False, "shape": shape}
    with path.open("wb") as stream:
        if suffix == ".npy":
            np.lib.format.write_array_header_1_0(stream, header)
        else:
            with zipfile.ZipFile(stream, "w") as archive, archive.open("points.npy", "w") as member:
                np.lib.format.write_array_header_1_0(member, header)
    with pytest.raises(InputError, match=rf"c\{suffix}: "):
        read_cloud(path)


def test_a_header_of_very_many_properties_is_read_line_by_line(tmp_path):
    names = "".join(f"property float p{n}\n" for n in range(200_000))
    (tmp_path / "c.ply").write_text(f"ply\nformat ascii 1.0\nelement vertex 1\n{names}end_header\n")
    with pytest.raises(InputError, match=r"need the numbers x, y and z, found p0, .* 199980 more"):
        read_cloud(tmp_path / "c.ply")


@pytest.mark.parametrize("name", ["camera", "viewpoint", "normals"])
def test_words_beside_the_points_of_an_archive(tmp_path, name):
    np.savez(tmp_path / "c.npz", points=POINTS, **{name: np.array(["a", "b", "c"])})
    with pytest.raises(InputError, match=rf"c\.npz: '{name}' in it is not an array of numbers"):
        read_cloud(tmp_path / "c.npz")


def test_a_picture_in_an_archive_is_no_cloud(tmp_path):
    np.savez(tmp_path / "c.npz", points=np.zeros((4, 5, 3), np.uint8))
    with pytest.raises(InputError, match="a picture"):
        read_cloud(tmp_path / "c.npz")


@pytest.mark.parametrize(
    "content",
    [
        json.dumps({"width": 1, "height": 1, "intrinsic_matrix": [10**400] * 9}),
        json.dumps({"width": True, "height": 1, "intrinsic_matrix": [1.0] * 9}),
        json.dumps({"intrinsic": [1, 2]}),
        json.dumps({"intrinsic": None}),
        '{"intrinsic":' + "[" * 100_000,
        '{"width": ' + "9" * 5000 + "}",
    ],
)
def test_camera_files_that_are_json_and_no_camera(tmp_path, content):
    (tmp_path / "camera.json").write_text(content)
    with pytest.raises(InputError, match=r"camera\.json: "):
        read_intrinsics(tmp_path / "camera.json")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes with a name")
@pytest.mark.parametrize("read", [read_cloud, read_depth, read_pose, read_intrinsics])
def test_a_pipe_is_not_waited_for(tmp_path, read):
    path = tmp_path / "pipe.pgm"
    os.mkfifo(path)
    with pytest.raises(InputError, match=r"pipe\.pgm: is a pipe or a device"):
        read(path)


@pytest.mark.parametrize("name", ["a" * 300 + ".txt", "a\0b.txt"])
def test_a_name_that_no_file_can_have(tmp_path, name):
    for use in (read_cloud, read_pose, require_writable):
        with pytest.raises(InputError, match="cannot be"):
            use(tmp_path / name)
    with pytest.raises(InputError, match="cannot be"):
        write_pose(tmp_path / name, np.eye(4))


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"P2 2 1 1000\n-5 7\n", "a sample of '-5'"),
        (b"P2 2 1 1000\n1_0 7\n", "a sample of '1_0'"),
        (b"P2 2 1 1000\n5 7 9\n", "2 x 1 pixels promised, 3 found"),
        (b"P5 2 1 1000\n" + bytes(12), "2 x 1 pixels promised, 6 found"),
        (b"P5 2 1 1000\n" + bytes(4) + b"P5 2 1 1000\n" + bytes(4), "promised, 10 found"),
    ],
)
def test_a_pgm_is_what_its_header_says_or_refused(tmp_path, content, says):
    (tmp_path / "d.pgm").write_bytes(content)
    with pytest.raises(InputError, match=rf"d\.pgm: .*{says}"):
        read_depth(tmp_path / "d.pgm")


def test_a_focal_length_next_to_nothing_leaves_no_point_and_no_warning():
    camera = PinholeCamera(width=3, height=2, fx=1e-320, fy=1e-320, cx=0.5, cy=0.5)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cloud = PointCloud.from_depth(np.ones((2, 3)), camera)
    assert not cloud.observed.any()


def tiff(values, photometric=1):
    """A TIFF of one strip, with no more in its header than there must be."""
    height, width = values.shape
    data, bits = values.tobytes(), 8 * values.dtype.itemsize
    tags = {256: width, 257: height, 258: bits, 259: 1, 262: photometric, 273: 0, 277: 1}
    tags |= {278: height, 279: len(data)}
    start = 14 + 12 * len(tags)
    entries = (struct.pack("<HHII", tag, 4, 1, v) for tag, v in (tags | {273: start}).items())
    return struct.pack("<2sHIH", b"II", 42, 8, len(tags)) + b"".join(entries) + bytes(4) + data


def test_a_tiff_that_promises_more_rows_than_it_has_strips_for_is_refused(tmp_path):
    whole = tiff(np.full((4, 3), 1000, "<u2"))
    for rows, says in (
        (9, "9 pixels promised, strips of 12 found"),
        (2 * 10**7, "would become 120,000,000"),
    ):
        taller = whole.replace(
            struct.pack("<HHII", 257, 4, 1, 4), struct.pack("<HHII", 257, 4, 1, rows)
        )
        (tmp_path / "d.tif").write_bytes(taller)
        with pytest.raises(InputError, match=rf"d\.tif: .*{says}"):
            read_depth(tmp_path / "d.tif")


def test_a_tiff_of_32_bits_keeps_its_largest_distances(tmp_path):
    depth = np.array([[1000, 2**31], [3, 2**32 - 1]], "<u4")
    (tmp_path / "d.tif").write_bytes(tiff(depth))
    np.testing.assert_array_equal(read_depth(tmp_path / "d.tif"), depth)


def test_a_tiff_whose_zero_is_white_is_refused(tmp_path):
    (tmp_path / "d.tif").write_bytes(tiff(np.array([[1000, 2000]], "<u2"), photometric=0))
    with pytest.raises(InputError, match="upside down"):
        read_depth(tmp_path / "d.tif")


def test_a_line_end_behind_the_last_sample_is_none(tmp_path):
    (tmp_path / "d.pgm").write_bytes(b"P5 2 1 1000\n\1\2\3\4\n")
    assert read_depth(tmp_path / "d.pgm").tolist() == [[258, 772]]
