"""Sequences by name: fetched once, gone on with after a cut, checked, unpacked whole."""

from __future__ import annotations

import hashlib
import io
import logging
import sys
import tarfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from loopback import FOLDER, PATH, Host, serving

from hmrf_icp.datasets import archives, open_sequence, progress_bar, tum_download
from hmrf_icp.datasets.archives import Archive, fetch
from hmrf_icp.datasets.download import CHUNK, DownloadError
from hmrf_icp.errors import InputError, MissingDependencyError


def archive(host: Host, tgz: bytes | None = None) -> Archive:
    digest = None if tgz is None else hashlib.sha256(tgz).hexdigest()
    return Archive(host.url + PATH, FOLDER, digest, None if tgz is None else len(tgz))


def left_in(cache: Path) -> list[str]:
    return sorted(path.name for path in cache.iterdir() if not path.name.endswith(".lock"))


def test_a_name_becomes_a_sequence_and_is_fetched_once(host: Host, cache: Path, named: str) -> None:
    sequence = open_sequence(named)
    assert (sequence.name, len(sequence)) == (named, 3)
    assert sequence.source == cache / FOLDER
    sequence.frames[0].load()
    open_sequence(named)
    assert len(host.asked) == 1
    assert left_in(cache) == [FOLDER, f"{FOLDER}.tgz.sha256"]
    assert not (cache / FOLDER / "rgb").exists()  # colour is not needed


def test_a_connection_that_is_cut_is_taken_up_where_it_was(
    host: Host, cache: Path, tgz: bytes
) -> None:
    host.cut_after = [3 * CHUNK, 4 * CHUNK + 100]
    fetch(archive(host, tgz), cache)
    assert host.asked == [None, f"bytes={3 * CHUNK}-", f"bytes={7 * CHUNK}-"]
    assert host.sent == len(tgz) + 100  # of a cut chunk nothing is kept


HELD = 5 * CHUNK


def cut_off(host: Host, cache: Path, tgz: bytes) -> None:
    """Fetch until the line is dead: an answer of ``HELD`` bytes, then one of none."""
    host.cut_after = [HELD, 0]
    with pytest.raises(DownloadError, match=rf"closed in the middle. {HELD:,} bytes are kept"):
        fetch(archive(host, tgz), cache)


def test_a_second_start_goes_on_where_the_first_ended(host: Host, cache: Path, tgz: bytes) -> None:
    cut_off(host, cache, tgz)
    assert not (cache / FOLDER).exists()
    told: list[tuple[str, int, int | None]] = []
    fetch(archive(host, tgz), cache, progress=lambda *state: told.append(state))
    assert host.asked[-1] == f"bytes={HELD}-"
    assert host.sent == len(tgz)
    assert left_in(cache) == [FOLDER, f"{FOLDER}.tgz.sha256"]
    downloads = [(done, total) for doing, done, total in told if doing == "download"]
    assert downloads[0][0] > HELD
    assert downloads[-1] == (len(tgz), len(tgz))
    assert told[-1] == ("unpack", len(tgz), len(tgz))


def test_a_file_that_changed_meanwhile_is_fetched_anew(host: Host, cache: Path, tgz: bytes) -> None:
    host.files[PATH] = b"x" * len(tgz)
    cut_off(host, cache, tgz)
    host.files[PATH], host.tag = tgz, '"two"'
    assert fetch(archive(host, tgz), cache).is_dir()


@pytest.mark.parametrize("weak", [True, False])
def test_a_server_without_tags_still_resumes(
    host: Host, cache: Path, tgz: bytes, weak: bool
) -> None:
    host.tag = 'W/"weak"' if weak else None
    cut_off(host, cache, tgz)
    assert fetch(archive(host, tgz), cache).is_dir()
    assert host.asked[-1] == f"bytes={HELD}-"


def test_a_server_that_knows_no_ranges_is_asked_for_all(
    host: Host, cache: Path, tgz: bytes
) -> None:
    part_of(cache).write_bytes(tgz[:HELD])
    host.ranges = False
    assert fetch(archive(host, tgz), cache).is_dir()
    assert host.sent == len(tgz)


def part_of(cache: Path) -> Path:
    part = cache / f".{FOLDER}.fetching" / f"{FOLDER}.tgz.part"
    part.parent.mkdir(parents=True)
    return part


def test_a_download_killed_after_its_last_byte_needs_no_more(
    host: Host, cache: Path, tgz: bytes
) -> None:
    part_of(cache).write_bytes(tgz)
    assert fetch(archive(host, tgz), cache).is_dir()
    assert host.sent == 0


def test_a_part_longer_than_the_file_is_begun_anew(host: Host, cache: Path, tgz: bytes) -> None:
    part_of(cache).write_bytes(tgz + b"more")
    assert fetch(archive(host, tgz), cache).is_dir()
    assert host.sent == len(tgz)


@pytest.mark.skipif(sys.platform == "win32", reason="files are not locked there")
def test_two_who_fetch_at_once_download_once(host: Host, cache: Path, tgz: bytes) -> None:
    with ThreadPoolExecutor(2) as both:
        folders = list(both.map(lambda _: fetch(archive(host, tgz), cache), range(2)))
    assert folders == [cache / FOLDER] * 2
    assert host.sent == len(tgz)


def test_another_hash_is_refused_and_not_kept(host: Host, cache: Path, tgz: bytes) -> None:
    wrong = Archive(host.url + PATH, FOLDER, "0" * 64)
    with pytest.raises(DownloadError, match="another SHA-256 than the one pinned"):
        fetch(wrong, cache)
    assert not (cache / FOLDER).exists()
    assert fetch(archive(host, tgz), cache).is_dir()
    assert host.sent == 2 * len(tgz)


def test_another_size_is_refused_before_it_is_downloaded(
    host: Host, cache: Path, tgz: bytes
) -> None:
    wrong = Archive(host.url + PATH, FOLDER, None, len(tgz) + 1)
    with pytest.raises(DownloadError, match=rf"{len(tgz):,} bytes on the server, expected"):
        fetch(wrong, cache)


def test_an_unpinned_hash_is_recorded_and_checked_from_then_on(
    host: Host, cache: Path, tgz: bytes
) -> None:
    folder = fetch(archive(host), cache)
    recorded = (cache / f"{FOLDER}.tgz.sha256").read_text().split()[0]
    assert recorded == hashlib.sha256(tgz).hexdigest()
    folder.rename(cache / "elsewhere")
    host.files[PATH] = tgz + b"another file under the same name"
    with pytest.raises(DownloadError, match="than that of the first download"):
        fetch(archive(host), cache)
    host.files[PATH] = tgz
    assert fetch(archive(host), cache).is_dir()


def test_what_the_server_has_not_is_named(host: Host, cache: Path) -> None:
    gone = Archive(f"{host.url}/gone.tgz", FOLDER)
    with pytest.raises(DownloadError, match=r"gone\.tgz: the server answered 404 Not Found"):
        fetch(gone, cache)


def test_without_a_server_the_error_says_so_and_what_to_do(cache: Path) -> None:
    with serving(Host({})) as host:
        url = host.url
    with pytest.raises(InputError, match=r"no connection: refused .*run the same again"):
        fetch(Archive(url + PATH, FOLDER), cache)


def test_a_killed_extraction_is_done_again(
    host: Host, cache: Path, tgz: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    extract, count = archives._extract, 0

    def killed(tar: tarfile.TarFile, member: tarfile.TarInfo, into: Path) -> None:
        nonlocal count
        count += 1
        if count == 3:
            raise KeyboardInterrupt
        extract(tar, member, into)

    monkeypatch.setattr(archives, "_extract", killed)
    with pytest.raises(KeyboardInterrupt):
        fetch(archive(host, tgz), cache)
    assert not (cache / FOLDER).exists()
    monkeypatch.setattr(archives, "_extract", extract)
    folder = fetch(archive(host, tgz), cache)
    assert len(list((folder / "depth").iterdir())) == 3
    assert host.sent == len(tgz)  # the archive itself was whole
    assert left_in(cache) == [FOLDER, f"{FOLDER}.tgz.sha256"]


def packed(*members: tuple[str, bytes | str]) -> bytes:
    """A tar of files (bytes) and symbolic links (str)."""
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w:gz") as tar:
        for name, content in members:
            member = tarfile.TarInfo(name)
            if isinstance(content, str):
                member.type, member.linkname = tarfile.SYMTYPE, content
                tar.addfile(member)
            else:
                member.size = len(content)
                tar.addfile(member, io.BytesIO(content))
    return stream.getvalue()


@pytest.mark.parametrize(
    "member",
    [
        (f"{FOLDER}/../../outside.txt", b"x"),
        ("/tmp/hmrf_icp_outside.txt", b"x"),
        (f"{FOLDER}/link", "/etc/passwd"),
        ("other/file.txt", b"x"),
    ],
)
def test_an_archive_that_would_write_elsewhere_is_refused(
    host: Host, cache: Path, member: tuple[str, bytes | str]
) -> None:
    host.files[PATH] = packed((f"{FOLDER}/depth.txt", b"1 a\n"), member)
    with pytest.raises(DownloadError, match="refused"):
        fetch(archive(host), cache)
    assert not (cache / FOLDER).exists()
    assert not list(cache.parent.rglob("outside.txt"))


def test_a_damaged_archive_is_removed_so_that_the_next_start_fetches_it(
    host: Host, cache: Path, tgz: bytes
) -> None:
    host.files[PATH] = tgz[: len(tgz) // 2]
    with pytest.raises(DownloadError, match=r"a damaged archive .* removed"):
        fetch(archive(host), cache)
    host.files[PATH] = tgz
    assert fetch(archive(host), cache).is_dir()


def test_an_archive_that_is_something_else_is_refused(host: Host, cache: Path) -> None:
    host.files[PATH] = b"<html>please log in</html>" * 100
    with pytest.raises(DownloadError, match="a damaged archive"):
        fetch(archive(host), cache)


def test_a_cache_that_cannot_be_written_is_named(host: Host, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="the cache cannot be used"):
        fetch(archive(host), tmp_path / "file" / "cache")


def test_without_pooch_the_extra_is_named(
    host: Host, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pooch", None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'hmrf-icp\[evaluate\]'"):
        fetch(archive(host), cache)


def test_downloading_prints_nothing_unless_a_bar_is_asked_for(
    host: Host, cache: Path, tgz: bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    fetch(archive(host, tgz), cache)
    assert capfd.readouterr() == ("", "")
    level = logging.getLogger("pooch").level
    with progress_bar() as bar:
        fetch(archive(host, tgz), cache.with_name("second"), progress=bar)
    shown = capfd.readouterr()
    assert shown.out == ""
    assert "download" in shown.err
    assert "unpack" in shown.err
    assert logging.getLogger("pooch").level == level


def test_the_desk_of_the_paper_is_pinned_and_the_others_have_an_address() -> None:
    desk = tum_download.archive("freiburg1_desk")
    assert desk.url.endswith("/freiburg1/rgbd_dataset_freiburg1_desk.tgz")
    assert desk.size == 344_011_403
    assert desk.sha256 is not None
    assert desk.sha256.startswith("e983d683")
    office = tum_download.archive("freiburg3_long_office_household")
    assert "/freiburg3/" in office.url
    assert office.sha256 is None


@pytest.mark.shared
def test_every_sequence_of_the_follow_up_has_a_name(shared: Path) -> None:
    rows = (shared / "paper" / "tum_2019.csv").read_text().splitlines()[1:]
    collection = tum_download.COLLECTION
    for name in {row.partition(",")[0].strip() for row in rows}:
        assert collection.aliases.get(name, name) in collection.members
