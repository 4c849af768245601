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


def existing_file(path: str | os.PathLike[str]) -> Path:
    """Check that ``path`` names a file with something in it.

    Raises
    ------
    InputError
        It is missing, a directory, empty, or out of reach.
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
    if stat.S_ISREG(status.st_mode) and status.st_size == 0:
        raise InputError(f"{path}: the file is empty")
    return Path(path)


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
