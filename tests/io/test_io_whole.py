"""An output file is written whole or not at all."""

from __future__ import annotations

import os
import stat

import pytest

from hmrf_icp import InputError
from hmrf_icp.io.whole import written_whole


def test_a_file_appears_at_the_end_and_nothing_beside_it(tmp_path):
    path = tmp_path / "out.ply"
    with written_whole(path) as partial:
        assert partial.suffix == ".ply"
        assert partial.parent == tmp_path
        partial.write_text("new")
        assert not path.exists()
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("failure", [ValueError, KeyboardInterrupt])
def test_a_failure_leaves_the_old_file_and_nothing_beside_it(tmp_path, failure):
    path = tmp_path / "out.ply"
    path.write_text("old")

    def fail():
        with written_whole(path) as partial:
            partial.write_text("half")
            raise failure

    with pytest.raises(failure):
        fail()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.skipif(os.name != "posix", reason="modes and links of POSIX")
def test_mode_and_links_stay(tmp_path):
    path, link = tmp_path / "out.ply", tmp_path / "link.ply"
    path.write_text("old")
    path.chmod(0o640)
    link.symlink_to(path)
    with written_whole(link) as partial:
        partial.write_text("new")
    assert link.is_symlink()
    assert path.read_text() == "new"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_places_that_cannot_be_written(tmp_path):
    with (
        pytest.raises(InputError, match=r"out\.ply: the folder .*none does not exist"),
        written_whole(tmp_path / "none" / "out.ply"),
    ):
        pass
    (tmp_path / "folder.ply").mkdir()
    with (
        pytest.raises(InputError, match=r"folder\.ply: is a directory"),
        written_whole(tmp_path / "folder.ply"),
    ):
        pass


@pytest.mark.skipif(not os.path.exists("/dev/null"), reason="no /dev/null here")  # noqa: PTH110
def test_a_device_is_not_replaced_by_a_file():
    with pytest.raises(InputError, match="not a regular file"), written_whole("/dev/null"):
        pass
