"""Output files that appear whole or not at all."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hmrf_icp.errors import InputError


def require_writable(path: str | os.PathLike[str]) -> Path:
    """Check that a file can be written at ``path``, without touching it.

    For a command to call before work that takes minutes, so that a mistyped
    folder does not cost the result.

    Returns
    -------
    The path with symbolic links followed: replacing a link would cut it loose
    from the file that it stands for.

    Raises
    ------
    InputError
        Its folder is missing or not writable, something that is not a file stands there, or no
        file can have that name.
    """
    try:
        final = Path(os.path.realpath(path))
        there = final.exists()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be written: {reason}") from None
    if there and not final.is_file():
        kind = "a directory" if final.is_dir() else "not a regular file"
        raise InputError(f"{path}: is {kind}, expected the name of a file to write")
    if not final.parent.is_dir():
        raise InputError(f"{path}: the folder {final.parent} does not exist; make it first")
    if not os.access(final.parent, os.W_OK | os.X_OK):
        raise InputError(f"{path}: the folder {final.parent} is not writable")
    return final


@contextmanager
def written_whole(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Write a file beside its place and move it there once it is complete.

    Whoever reads ``path`` meanwhile sees the old file or the new one, never
    half of one, and an exception leaves the old one as it was.

    Parameters
    ----------
    path
        Where the file belongs; an existing one is replaced and its mode kept.

    Yields
    ------
    A name in the same folder and with the same suffix (by which libraries
    choose the format), to write to.

    Raises
    ------
    InputError
        As `require_writable`.
    """
    final = require_writable(path)
    # A hidden name, so that a folder listed or globbed meanwhile looks as it did; the suffix stays.
    partial = final.with_name(f".{final.stem}.{secrets.token_hex(4)}{final.suffix}")
    try:
        yield partial
        if final.exists():
            shutil.copymode(final, partial)
        partial.replace(final)
    finally:
        partial.unlink(missing_ok=True)
