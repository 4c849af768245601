"""Whatever is wrong with a file, reading it ends in an InputError that names it."""

from __future__ import annotations

import os
import warnings

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image, ImageFile

from hmrf_icp import InputError, PinholeCamera, PointCloud
from hmrf_icp.io import READABLE, read_cloud, read_depth, read_pose, write_cloud
from hmrf_icp.io.files import existing_file

RNG = np.random.default_rng(3)
DEPTH = RNG.integers(500, 4000, (12, 16)).astype(np.uint16)
CAMERA = PinholeCamera(width=16, height=12, fx=16.0, fy=16.0, cx=8.0, cy=6.0)
CLOUD = PointCloud(RNG.normal(size=(12, 16, 3)))
BINARY = (".png", ".tif", ".pgm", ".npy", ".npz", ".ply", ".pcd")


class Files(dict):
    """Bytes by suffix, which a failing test need not print."""

    def __repr__(self):
        return "Files()"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """One good file of each binary format, as bytes."""
    folder = tmp_path_factory.mktemp("whole")
    Image.fromarray(DEPTH).save(folder / "f.png")
    Image.fromarray(DEPTH).save(folder / "f.tif")
    (folder / "f.pgm").write_bytes(b"P5 16 12 4095\n" + DEPTH.astype(">u2").tobytes())
    for suffix in (".npy", ".npz", ".ply", ".pcd"):
        write_cloud(folder / f"f{suffix}", CLOUD)
    return Files({suffix: (folder / f"f{suffix}").read_bytes() for suffix in BINARY})


@pytest.mark.parametrize("suffix", BINARY)
def test_the_whole_file_is_good(whole, tmp_path, suffix):
    (tmp_path / f"f{suffix}").write_bytes(whole[suffix])
    assert len(read_cloud(tmp_path / f"f{suffix}", CAMERA)) == 192


@pytest.mark.parametrize("suffix", BINARY)
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_file_cut_anywhere_is_refused(whole, tmp_path, suffix, data):
    content = whole[suffix]
    # The ends matter most, where all that is missing is a closing mark or a checksum.
    kept = data.draw(
        st.one_of(
            st.integers(0, len(content) - 1), st.integers(len(content) - 30, len(content) - 1)
        )
    )
    path = tmp_path / f"cut{suffix}"
    path.write_bytes(content[:kept])
    with pytest.raises(InputError, match=rf"cut{suffix}: "):
        read_cloud(path, CAMERA)


@pytest.mark.parametrize("suffix", BINARY)
@settings(max_examples=80, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_file_with_a_wrong_byte_is_read_or_refused(whole, tmp_path, suffix, data):
    content = bytearray(whole[suffix])
    at = data.draw(st.one_of(st.integers(0, 200), st.integers(0, len(content) - 1)))
    content[at] = data.draw(st.integers(0, 255))
    path = tmp_path / f"odd{suffix}"
    path.write_bytes(content)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            message = repr(read_cloud(path, CAMERA))
        except InputError as error:
            message = str(error)
    assert message.startswith((str(path), "PointCloud"))


def test_a_cut_png_is_refused_even_where_pillow_was_told_to_put_up_with_it(
    whole, tmp_path, monkeypatch
):
    monkeypatch.setattr(ImageFile, "LOAD_TRUNCATED_IMAGES", True)
    for kept in (100, len(whole[".png"]) - 5):
        (tmp_path / "cut.png").write_bytes(whole[".png"][:kept])
        with pytest.raises(InputError, match=r"cut\.png: "):
            read_depth(tmp_path / "cut.png")
    assert ImageFile.LOAD_TRUNCATED_IMAGES


def test_pillow_is_left_as_it_was(whole, tmp_path):
    (tmp_path / "f.png").write_bytes(whole[".png"])
    before = (ImageFile.LOAD_TRUNCATED_IMAGES, Image.MAX_IMAGE_PIXELS)
    read_depth(tmp_path / "f.png")
    after = (ImageFile.LOAD_TRUNCATED_IMAGES, Image.MAX_IMAGE_PIXELS)
    assert before == after


@pytest.mark.parametrize("suffix", READABLE)
def test_missing_empty_directory(tmp_path, suffix):
    with pytest.raises(InputError, match=rf"none{suffix}: no such file"):
        read_cloud(tmp_path / f"none{suffix}", CAMERA)
    (tmp_path / f"empty{suffix}").touch()
    with pytest.raises(InputError, match=rf"empty{suffix}: the file is empty"):
        read_cloud(tmp_path / f"empty{suffix}", CAMERA)
    (tmp_path / f"folder{suffix}").mkdir()
    with pytest.raises(InputError, match=rf"folder{suffix}: is a directory"):
        read_cloud(tmp_path / f"folder{suffix}", CAMERA)


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may read any file"
)
def test_out_of_reach(tmp_path):
    path = tmp_path / "pose.txt"
    path.write_text("1")
    path.chmod(0)
    with pytest.raises(InputError, match=r"pose\.txt: .*[Pp]ermission"):
        read_pose(path)


def test_a_file_in_place_of_a_folder(tmp_path):
    (tmp_path / "file").write_text("1")
    with pytest.raises(InputError, match="cannot be read"):
        existing_file(tmp_path / "file" / "pose.txt")


@pytest.mark.parametrize("name", ["scan.dxf", "scan", "picture.jpg"])
def test_unknown_suffix_lists_the_known(tmp_path, name):
    (tmp_path / name).write_text("content")
    for suffix in READABLE:
        with pytest.raises(InputError, match=rf"{name}: .*{suffix}"):
            read_cloud(tmp_path / name)
    with pytest.raises(InputError, match=rf"{name}: .*\.ply, \.pcd"):
        write_cloud(tmp_path / name, CLOUD)
    assert (tmp_path / name).read_text() == "content"


@pytest.mark.parametrize("suffix", [".png", ".tif", ".pgm", ".npy", ".npz", ".ply", ".pcd"])
def test_a_file_of_another_kind_by_the_name(tmp_path, suffix):
    (tmp_path / f"f{suffix}").write_text("GIF89a, or anything else\n" * 20)
    with pytest.raises(InputError, match=rf"f{suffix}: "):
        read_cloud(tmp_path / f"f{suffix}", CAMERA)
