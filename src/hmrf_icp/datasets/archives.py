"""Archives fetched into a cache, and unpacked whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import gzip
import logging
import re
import shutil
import tarfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from hmrf_icp.datasets.download import DownloadError, ResumingDownloader
from hmrf_icp.datasets.sequence import Progress
from hmrf_icp.errors import InputError, MissingDependencyError
from hmrf_icp.io.whole import written_whole

_OF_THE_DISK = (
    errno.ENOSPC,
    errno.EDQUOT,
    errno.EROFS,
    errno.EACCES,
    errno.EPERM,
    errno.EIO,
    errno.EMFILE,
    errno.ENFILE,
)
"""Errors of unpacking that say nothing against the archive."""


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
                with written_whole(recorded) as partial:
                    partial.write_text(f"{digest}  {archive.file}\n", encoding="utf-8")
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
        # What a full disk left of it is no hash that anything could have.
        digest = re.match(rb"[0-9a-f]{64}(?=\s)", recorded.read_bytes())
        known = None if digest is None else digest.group().decode("ascii")
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
    """Unpack from the beginning, whatever a killed process left; return the archive's folder.

    An archive that cannot be unpacked is removed: kept, it would fail at each start.
    """
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
        if not (into / name).is_dir():
            raise DownloadError(f"{file}: holds no folder {name}; it was removed")
    except DownloadError:
        file.unlink()
        raise
    except Exception as error:  # of tarfile, gzip, zlib, or of names that no file can have
        disk = isinstance(error, OSError) and error.errno in _OF_THE_DISK
        if disk and not isinstance(error, gzip.BadGzipFile):
            raise
        file.unlink()
        raise DownloadError(
            f"{file}: a damaged archive ({error}); it was removed, run the same again"
        ) from None
    return into / name


def _inside(member: tarfile.TarInfo, name: str, file: Path) -> PurePosixPath:
    """Path of a member within the archive's folder, if that is where it would end up.

    Held to here as well as by tarfile's own filter, which older Pythons lack.
    """
    path = PurePosixPath(member.name)
    plain = member.isfile() or member.isdir()
    if not plain or path.is_absolute() or ".." in path.parts or path.parts[:1] != (name,):
        raise DownloadError(
            f"{file}: refused and removed: {member.name!r} in it is not a plain file or folder "
            f"within {name}/"
        )
    return PurePosixPath(*path.parts[1:])


def _extract(tar: tarfile.TarFile, member: tarfile.TarInfo, into: Path) -> None:
    if hasattr(tarfile, "data_filter"):
        tar.extract(member, into, filter="data")
    else:
        tar.extract(member, into, set_attrs=False)
