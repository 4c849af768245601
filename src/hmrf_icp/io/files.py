"""What every reader does with a path: see that it is a file, and name it when reading fails."""

from __future__ import annotations

import os
import stat
import threading
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from hmrf_icp.errors import InputError

_ALONE = threading.Lock()

MOST_EXPANSION = 100
"""Compressed points are a tenth to a third of their size, and a grid that is nearly empty less; a
file that says it grows more than this is damaged, or made to fill the memory."""

HARMLESS = 1 << 26
"""Bytes that may come out of a file, however small it is."""


def existing_file(path: str | os.PathLike[str]) -> Path:
    """Check that ``path`` names a file with something in it.

    Raises
    ------
    InputError
        It is missing, a directory, a pipe or a device, empty, or out of reach.
    """
    try:
        status = Path(path).stat()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be read: {reason}") from None
    if stat.S_ISDIR(status.st_mode):
        raise InputError(f"{path}: is a directory, expected a file")
    if not stat.S_ISREG(status.st_mode):
        # Reading a pipe waits until somebody writes into it, and a device may never end.
        raise InputError(f"{path}: is a pipe or a device, expected a file; save it as one first")
    if status.st_size == 0:
        raise InputError(f"{path}: the file is empty")
    return Path(path)


def is_file(path: Path) -> bool:
    """Whether there is a file; False as well for a name that no file can have."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def is_folder(path: Path) -> bool:
    """Whether there is a folder; False as well for a name that no folder can have."""
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False


@contextmanager
def reading(path: Path, what: str) -> Iterator[None]:
    """Turn whatever reading ``path`` raises into an InputError that names it.

    Whatever: on damaged files NumPy and Pillow raise a dozen kinds, among them
    errors of the tokenizer, of struct, of zlib, and SyntaxError.
    The original stays attached as the cause.

    Parameters
    ----------
    path
        The file.
    what
        What it was read as, with its article: "a PNG image".
    """
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise InputError(f"{path}: cannot be read as {what}: {reason}") from error


def require_bounded(path: Path, packed: int, unpacked: int) -> None:
    """Refuse what a few compressed bytes would make gigabytes of, before it is done.

    Raises
    ------
    InputError
        More than `HARMLESS` bytes would come out, and more than `MOST_EXPANSION` times as
        many as are stored.
    """
    if unpacked > HARMLESS and unpacked > MOST_EXPANSION * packed:
        raise InputError(
            f"{path}: {packed:,} compressed bytes would become {unpacked:,}, more than "
            f"{MOST_EXPANSION} times as many: damaged, or made to fill the memory; if it is meant, "
            "write it without compression"
        )


@contextmanager
def quietly() -> Iterator[None]:
    """Drop the warnings of a library that warns of a damaged file and then raises, or reads on.

    The filters of warnings belong to the process: one thread at a time, lest
    one restores what another had set.
    """
    with _ALONE, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def check_suffix(path: Path, known: Iterable[str], verb: str) -> str:
    """Return the suffix in lower case, or refuse one that is not among ``known``."""
    suffix = path.suffix.lower()
    known = tuple(known)
    if suffix not in known:
        found = f"the suffix {path.suffix!r}" if path.suffix else "a name without a suffix"
        raise InputError(f"{path}: cannot {verb} {found}; known are {', '.join(known)}")
    return suffix
