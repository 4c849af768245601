"""Downloads that go on where they were cut off, and archives unpacked whole or not at all."""

from __future__ import annotations

import contextlib
import gzip
import logging
import shutil
import tarfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from hmrf_icp.datasets.sequence import Progress
from hmrf_icp.errors import InputError, MissingDependencyError

if TYPE_CHECKING:
    import requests

CHUNK = 1 << 14
"""Bytes handed on at a time, and how many of them a connection that breaks can lose."""


class DownloadError(InputError):
    """A file could not be fetched, or is not the one it should be."""


class ResumingDownloader:
    """Downloader for pooch that goes on where an earlier one was cut off.

    Pooch hands a downloader a temporary file and removes it when something
    goes wrong, and its own begins anew each time. This one writes into ``part``, which
    stays, and only moves it to pooch's file when it is complete. A second
    start asks the server for the rest (``Range: bytes=N-``), on the condition
    that the file there is still the same (``If-Range`` with the ``ETag`` or
    ``Last-Modified`` of the first answer, kept in a file beside ``part``); a server that
    knows no ranges, or has another file by now, sends all of it and ``part``
    is begun anew. A connection that breaks in the middle is taken up again at once, as long
    as each attempt brings bytes.

    Parameters
    ----------
    part
        Where unfinished downloads are kept.
    size
        Bytes that the whole file should have, None if unknown.
    progress
        Told of the bytes that are there, those of earlier starts included.
    timeout
        Seconds without an answer or a byte after which the connection counts as broken.
    """

    def __init__(
        self,
        part: Path,
        size: int | None = None,
        progress: Progress | None = None,
        timeout: float = 30.0,
    ) -> None:
        self.part = part
        self.size = size
        self.progress = progress
        self.timeout = timeout

    def __call__(
        self,
        url: str,
        output_file: Any,
        pooch: Any = None,  # noqa: ARG002
        check_only: bool = False,
    ) -> bool | None:
        """Fetch ``url`` into ``output_file``, as pooch calls it.

        Raises
        ------
        DownloadError
            No connection, or the server has not got the file.
        """
        import requests

        if check_only:
            return bool(requests.head(url, timeout=self.timeout, allow_redirects=True).ok)
        while True:
            before = self._held()
            try:
                if self._attempt(url):
                    break
                reason = "it was closed in the middle"
            except requests.RequestException as error:
                reason = _reason(error)
            except OSError as error:
                raise DownloadError(f"{self.part}: cannot be written: {error.strerror}") from None
            if self._held() <= before:
                raise DownloadError(
                    f"{url}: no connection: {reason}. {self._held():,} bytes are kept; run the "
                    "same again to go on from there once there is a connection, or fetch and unpack "
                    "the file by other means and give the folder"
                )
        shutil.move(self.part, output_file)
        self._validator.unlink(missing_ok=True)
        return None

    @property
    def _validator(self) -> Path:
        return self.part.with_name(f"{self.part.name}.validator")

    def _held(self) -> int:
        return self.part.stat().st_size if self.part.exists() else 0

    def _attempt(self, url: str) -> bool:
        """Ask for what is missing; return whether all of it has come."""
        import requests

        held = self._held()
        # Compressed on the way, the bytes of a range would not be those of the file.
        headers = {"Accept-Encoding": "identity"}
        if held:
            headers["Range"] = f"bytes={held}-"
            if self._validator.exists():
                headers["If-Range"] = self._validator.read_text(encoding="latin-1")
        with requests.get(url, headers=headers, stream=True, timeout=self.timeout) as answer:
            if answer.status_code == 416 and held:
                if _whole_size(answer) == held:
                    return True
                self.part.unlink()
                return self._attempt(url)
            if not answer.ok:
                raise DownloadError(
                    f"{url}: the server answered {answer.status_code} {answer.reason}"
                )
            resumed = answer.status_code == 206 and _first_byte(answer) == held
            if answer.status_code == 206 and not resumed:
                raise DownloadError(f"{url}: the server sent another range than it was asked for")
            start = held if resumed else 0
            length = answer.headers.get("Content-Length")
            total = start + int(length) if length else None
            if self.size is not None and total not in (None, self.size):
                raise DownloadError(
                    f"{url}: {total:,} bytes on the server, expected {self.size:,}: the file has "
                    "changed"
                )
            if not resumed:
                self._remember(answer)
            with self.part.open("ab" if resumed else "wb") as stream:
                for chunk in answer.iter_content(CHUNK):
                    stream.write(chunk)
                    if self.progress is not None:
                        self.progress("download", stream.tell(), total)
            return total is None or self._held() == total

    def _remember(self, answer: requests.Response) -> None:
        """Keep what tells this version of the file from a later one; weak tags do not."""
        tag = answer.headers.get("ETag", "")
        tag = answer.headers.get("Last-Modified", "") if tag.startswith("W/") or not tag else tag
        if tag:
            self._validator.write_text(tag, encoding="latin-1")
        else:
            self._validator.unlink(missing_ok=True)


def _whole_size(answer: requests.Response) -> int | None:
    total = answer.headers.get("Content-Range", "").rpartition("/")[2]
    return int(total) if total.isdigit() else None


_REASONS = {
    "IncompleteRead": "it was closed in the middle",
    "Connection aborted": "it was closed in the middle",
    "Connection refused": "refused by the server",
    "NameResolution": "the server's name cannot be resolved; this machine may be offline",
    "timed out": "the server did not answer in time",
    "unreachable": "the network cannot be reached",
}
"""What people understand, by a mark of it in what the library says."""


def _first_byte(answer: requests.Response) -> int | None:
    first = answer.headers.get("Content-Range", "").removeprefix("bytes ").partition("-")[0]
    return int(first) if first.isdigit() else None


def _reason(error: Exception) -> str:
    """Find the innermost reason of nested exceptions, the one that people understand."""
    text = str(error)
    for mark, meaning in _REASONS.items():
        if mark.lower() in text.lower():
            return meaning
    return text[:200] or type(error).__name__


@dataclass(frozen=True)
class Archive:
    """A tar file on a server that holds one folder.

    Parameters
    ----------
    url
        Where it is.
    folder
        Name of the folder in it.
    sha256
        Hash of the file where it is known. Where it is not, that of the first
        download is recorded, and later ones must have it.
    size
        Bytes, where known.
    """

    url: str
    folder: str
    sha256: str | None = None
    size: int | None = None

    @property
    def file(self) -> str:
        """Name of the tar file."""
        return self.url.rpartition("/")[2]


def fetch(
    archive: Archive,
    cache: Path,
    progress: Progress | None = None,
    wanted: Callable[[PurePosixPath], bool] = lambda path: True,  # noqa: ARG005
) -> Path:
    """Return the archive's folder in the cache, downloaded and unpacked if it is not there yet.

    The folder appears under its name only when it is complete: what a killed
    process leaves behind is a part of the download, which the next goes on
    with, or a half-unpacked folder, which the next removes.

    Parameters
    ----------
    archive
        What to fetch.
    cache
        Folder to keep it in; made if need be.
    progress
        Told of "download" and "unpack".
    wanted
        Which files to unpack, by their path in the archive's folder.

    Raises
    ------
    DownloadError
        No connection, no such file on the server, another hash, or a damaged archive.
    InputError
        The cache cannot be written.
    MissingDependencyError
        Pooch is not installed.
    """
    folder = cache / archive.folder
    if folder.is_dir():
        return folder
    recorded = cache / f"{archive.file}.sha256"
    work = cache / f".{archive.folder}.fetching"
    try:
        work.mkdir(parents=True, exist_ok=True)
        with _alone(cache / f".{archive.folder}.lock"):
            if not folder.is_dir():
                work.mkdir(exist_ok=True)  # whoever held the lock has removed it
                file, digest = _download(archive, recorded, work, progress)
                unpacked = _unpack(file, archive.folder, work, progress, wanted)
                recorded.write_text(f"{digest}  {archive.file}\n", encoding="utf-8")
                unpacked.rename(folder)
            shutil.rmtree(work, ignore_errors=True)
    except OSError as error:
        raise InputError(f"{cache}: the cache cannot be used: {error}") from None
    return folder


@contextlib.contextmanager
def _alone(lock: Path) -> Iterator[None]:
    """Wait until no other process fetches the same; two would write into one file."""
    with lock.open("w") as stream:
        with contextlib.suppress(ImportError):  # Windows has no fcntl, and is not kept apart
            import fcntl

            fcntl.flock(stream, fcntl.LOCK_EX)
        yield


def _download(
    archive: Archive, recorded: Path, work: Path, progress: Progress | None
) -> tuple[Path, str]:
    """Fetch the archive into a folder; return its file and SHA-256."""
    try:
        import pooch
    except ImportError:
        raise MissingDependencyError(
            "downloading a data set needs pooch: pip install 'hmrf-icp[evaluate]'"
        ) from None
    known = archive.sha256
    if known is None and recorded.is_file():
        known = recorded.read_text(encoding="utf-8").split()[0]
    downloader = ResumingDownloader(work / f"{archive.file}.part", archive.size, progress)
    try:
        with _quiet(pooch.get_logger()):
            file = pooch.retrieve(
                archive.url,
                known_hash=None if known is None else f"sha256:{known}",
                fname=archive.file,
                path=work,
                downloader=downloader,
            )
    except DownloadError:
        raise
    except ValueError:
        since = "the one pinned for it" if archive.sha256 else "that of the first download"
        raise DownloadError(
            f"{archive.url}: the file that came has another SHA-256 than {since}, {known}; it was "
            "not kept: try again, and if that does not help the file on the server has changed"
        ) from None
    return Path(file), known or pooch.file_hash(file)


@contextlib.contextmanager
def _quiet(logger: logging.Logger) -> Iterator[None]:
    """Keep a logger that prints by default from doing so."""
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(level)


def _unpack(
    file: Path,
    name: str,
    work: Path,
    progress: Progress | None,
    wanted: Callable[[PurePosixPath], bool],
) -> Path:
    """Unpack from the beginning, whatever a killed process left; return the archive's folder."""
    into = work / "unpacked"
    shutil.rmtree(into, ignore_errors=True)
    into.mkdir()
    size = file.stat().st_size
    try:
        with file.open("rb") as stream, tarfile.open(fileobj=stream) as tar:
            for member in tar:
                inside = _inside(member, name, file)
                if member.isfile() and wanted(inside):
                    _extract(tar, member, into)
                if progress is not None:
                    progress("unpack", min(stream.tell(), size), size)
    except (tarfile.TarError, EOFError, zlib.error, gzip.BadGzipFile) as error:
        file.unlink()
        raise DownloadError(
            f"{file}: a damaged archive ({error}); it was removed, run the same again"
        ) from None
    if not (into / name).is_dir():
        raise DownloadError(f"{file}: holds no folder {name}")
    return into / name


def _inside(member: tarfile.TarInfo, name: str, file: Path) -> PurePosixPath:
    """Path of a member within the archive's folder, if that is where it would end up.

    Held to here as well as by tarfile's own filter, which older Pythons lack.
    """
    path = PurePosixPath(member.name)
    plain = member.isfile() or member.isdir()
    if not plain or path.is_absolute() or ".." in path.parts or path.parts[:1] != (name,):
        raise DownloadError(
            f"{file}: refused: {member.name!r} in it is not a plain file or folder within {name}/"
        )
    return PurePosixPath(*path.parts[1:])


def _extract(tar: tarfile.TarFile, member: tarfile.TarInfo, into: Path) -> None:
    if hasattr(tarfile, "data_filter"):
        tar.extract(member, into, filter="data")
    else:
        tar.extract(member, into, set_attrs=False)
