"""Downloads that go on where they were cut off."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hmrf_icp.datasets.sequence import Progress
from hmrf_icp.errors import InputError

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
                    "same again to go on from there once there is a connection, or fetch and "
                    "unpack the file by other means and give the folder"
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
            tag = self._validator.read_bytes() if self._validator.exists() else b""
            # What a full disk left of it would be refused as a header, at each start.
            if tag and tag.isascii() and tag.decode().isprintable() and tag == tag.strip():
                headers["If-Range"] = tag.decode()
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
