"""Recordings that are wrong in ways that no reader expects: an InputError that names the place."""

from __future__ import annotations

import io
import os
import tarfile

import numpy as np
import pytest

from hmrf_icp import InputError, PointCloud
from hmrf_icp.datasets import open_sequence, redwood, tum
from hmrf_icp.datasets.archives import Archive, fetch
from hmrf_icp.datasets.clouds import CloudFile
from hmrf_icp.datasets.download import DownloadError
from hmrf_icp.datasets.poses import read_poses
from hmrf_icp.io import write_cloud

MATRIX = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"


@pytest.mark.parametrize("head", ["--5 0 0", "² 0 0", "1e3 0 0", "9" * 30 + " 0 0", "0 0 -"])
def test_a_log_whose_numbers_are_none(tmp_path, head):
    (tmp_path / "trajectory.log").write_text(f"{head}\n{MATRIX}", encoding="utf-8")
    with pytest.raises(InputError, match="line 1: expected three integers"):
        redwood._read_log(tmp_path / "trajectory.log", [tmp_path])


@pytest.mark.parametrize("word", ["1e308", "-1e200", "inf", "nan"])
def test_numbers_that_are_as_good_as_infinite(tmp_path, word):
    (tmp_path / "poses.txt").write_text(f"0 0 0 1 {word} 0 0\n")
    with pytest.raises(InputError, match=r"poses\.txt, line 1: .* all finite"):
        read_poses(tmp_path / "poses.txt")


def test_a_list_that_names_what_no_file_can_be_called(tmp_path):
    (tmp_path / "depth.txt").write_text("1.0 " + "a" * 300 + "\n")
    with pytest.raises(InputError, match="line 1: names aaa"):
        tum._read_depth_list(tmp_path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes with a name")
def test_a_pipe_in_place_of_a_depth_map_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "d.png")
    (tmp_path / "depth.txt").write_text("1.0 d.png\n")
    with pytest.raises(InputError, match=r"names d\.png, but there is no"):
        tum._read_depth_list(tmp_path)


@pytest.mark.parametrize("source", ["a" * 300, "~nobody-of-that-name/kitchen", "a\0b"])
def test_a_folder_that_no_name_can_mean(source):
    with pytest.raises(InputError, match="no such folder"):
        open_sequence(source)


def test_a_scan_keeps_what_its_file_has(tmp_path):
    points = np.random.default_rng(0).normal(size=(20, 3))
    cloud = PointCloud(points, normals=points, attributes={"ring": np.arange(20)})
    write_cloud(tmp_path / "a.ply", cloud)
    scan = CloudFile(tmp_path / "a.ply").load()
    np.testing.assert_array_equal(scan.viewpoint, np.zeros(3))
    np.testing.assert_array_equal(scan.normals, points)
    assert scan.attributes["ring"].tolist() == list(range(20))


# ---- What stays in the cache --------------------------------------------------------------------


def tar(*members):
    """A tar file of empty folders (a name that ends in a slash) and of files of one byte."""
    content = io.BytesIO()
    with tarfile.open(fileobj=content, mode="w:gz") as archive:
        for name in members:
            member = tarfile.TarInfo(name.rstrip("/"))
            member.type = tarfile.DIRTYPE if name.endswith("/") else tarfile.REGTYPE
            member.mode = 0o755
            member.size = 0 if name.endswith("/") else 1
            archive.addfile(member, io.BytesIO(b"x"))
    return content.getvalue()


WHOLE = tar("scene/", "scene/a.txt")
BROKEN = {
    "another folder": tar("other/a.txt"),
    "a way out": tar("scene/a.txt", "scene/../../b.txt"),
    "a file as a folder": tar("scene/a.txt", "scene/a.txt/b.txt"),
    "a name that is too long": tar("scene/" + "a" * 300),
    "cut short": WHOLE[:-40],
    "no archive": b"<html>404</html>",
    "damaged": WHOLE[:30] + bytes(20) + WHOLE[50:],
}


@pytest.fixture
def server(monkeypatch):
    """Stand in for the network: what is asked for arrives in the cache's own way."""
    pooch = pytest.importorskip("pooch")
    held = {}

    def retrieve(url, known_hash, fname, path, downloader):
        file = path / fname
        if not file.exists():
            file.write_bytes(held["content"])
        if known_hash is not None and f"sha256:{pooch.file_hash(file)}" != known_hash:
            file.unlink()
            raise ValueError("hash")
        return str(file)

    monkeypatch.setattr(pooch, "retrieve", retrieve)
    return held


@pytest.mark.parametrize("kind", BROKEN)
def test_a_broken_archive_does_not_stay_in_the_cache(tmp_path, server, kind):
    archive = Archive("https://example.org/scene.tgz", "scene")
    server["content"] = BROKEN[kind]
    with pytest.raises(DownloadError, match="removed"):
        fetch(archive, tmp_path)
    server["content"] = WHOLE
    assert (fetch(archive, tmp_path) / "a.txt").read_bytes() == b"x"


@pytest.mark.parametrize("left", [b"", b"\0" * 70, b"abc scene.tgz\n"])
def test_a_record_of_a_hash_that_is_none_holds_nothing_up(tmp_path, server, left):
    archive = Archive("https://example.org/scene.tgz", "scene")
    server["content"] = WHOLE
    (tmp_path / "scene.tgz.sha256").write_bytes(left)
    assert fetch(archive, tmp_path).is_dir()
    assert len((tmp_path / "scene.tgz.sha256").read_text().split()[0]) == 64
