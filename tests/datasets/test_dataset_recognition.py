"""How a format is recognised, and what is said when none is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dataset_writers import recording, write_seven_scenes, write_tum

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.datasets import (
    Collection,
    Format,
    Frame,
    Sequence,
    formats,
    names,
    open_sequence,
    register_collection,
    register_format,
    registry,
)
from hmrf_icp.errors import InputError


@pytest.fixture
def own_registry(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a test registers is forgotten after it."""
    monkeypatch.setattr(registry, "_FORMATS", list(registry._FORMATS))
    monkeypatch.setattr(registry, "_COLLECTIONS", dict(registry._COLLECTIONS))


class Corner:
    """A scan that needs no file."""

    def load(self) -> PointCloud:
        return PointCloud(np.eye(3))


def corner(folder: Path | None = None) -> Sequence:
    frames = tuple(Frame(k, np.eye(4), Corner()) for k in range(2))
    return Sequence("corner", "mine", frames, "cloud", source=folder)


def test_an_unknown_folder_is_told_what_is_known_and_what_was_found(tmp_path: Path) -> None:
    for k in range(5):
        (tmp_path / f"image{k}.jpg").write_bytes(b"x")
    (tmp_path / "labels").mkdir()
    (tmp_path / "readme.md").write_text("x")
    with pytest.raises(InputError) as refused:
        open_sequence(tmp_path)
    message = str(refused.value)
    assert "5 files like image0.jpg" in message
    assert "labels/" in message
    assert "readme.md" in message
    for known in formats():
        assert known.name in message
        assert known.layout in message


def test_an_empty_folder_is_called_empty(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the folder is empty"):
        open_sequence(tmp_path)


def test_a_folder_of_sequences_points_at_them(tmp_path: Path) -> None:
    write_seven_scenes(tmp_path / "seq-01", recording())
    with pytest.raises(InputError, match="seq-01/ looks like 7-Scenes"):
        open_sequence(tmp_path)


def test_what_is_no_folder_is_told_the_names(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no such folder.*synthetic.*tum:freiburg1_desk"):
        open_sequence(tmp_path / "nothing")
    archive = tmp_path / "desk.tgz"
    archive.write_bytes(b"x")
    with pytest.raises(InputError, match=r"desk\.tgz: a file, expected a sequence's folder"):
        open_sequence(archive)


def test_a_wrong_member_of_a_collection_is_told_the_right_ones() -> None:
    with pytest.raises(InputError, match=r"synthetic:chair.*synthetic:desk, synthetic:tabletop"):
        open_sequence("synthetic:chair")
    with pytest.raises(InputError, match=r"tum: no such sequence.*tum:freiburg1_desk"):
        open_sequence("tum")


def test_strings_and_paths_and_home_relative_names_are_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_tum(tmp_path / "rec", recording())
    monkeypatch.setenv("HOME", str(tmp_path))
    assert len(open_sequence("~/rec")) == len(open_sequence(tmp_path / "rec")) == 3


def test_a_format_of_ones_own_is_asked_first(tmp_path: Path, own_registry: None) -> None:
    write_seven_scenes(tmp_path, recording())
    register_format(
        Format("mine", "corner.txt", lambda folder: (folder / "corner.txt").is_file(), corner)
    )
    assert open_sequence(tmp_path).format == "7-Scenes"
    (tmp_path / "corner.txt").write_text("x")
    assert open_sequence(tmp_path).format == "mine"
    assert formats()[0].name == "mine"


def test_a_collection_of_ones_own_has_its_names(own_registry: None) -> None:
    register_collection(Collection("mine", ("corner",), lambda member, progress: corner()))
    assert "mine:corner" in names()
    assert open_sequence("mine:corner").name == "corner"


def test_one_frame_is_no_sequence(tmp_path: Path) -> None:
    folder = write_seven_scenes(tmp_path, recording())
    for k in (10, 20):
        (folder / f"frame-{k:06d}.pose.txt").unlink()
    with pytest.raises(InputError, match=r"1 usable frame .*at least two.*2 of 3 depth maps left"):
        open_sequence(folder)


def test_a_frame_is_found_by_its_number(tmp_path: Path) -> None:
    sequence = open_sequence(write_seven_scenes(tmp_path, recording()))
    assert sequence.frame(10) is sequence.frames[1]
    with pytest.raises(InputError, match=r"no frame 13 among 3 numbered 0 to 20.*nearest is 10"):
        sequence.frame(13)


def test_a_pose_that_is_not_rigid_is_refused_wherever_it_comes_from() -> None:
    with pytest.raises(InputError, match="frame 7: pose"):
        Frame(7, np.diag([2.0, 2.0, 2.0, 1.0]), Corner())
