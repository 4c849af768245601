"""Libraries that some formats need and most people do not."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

from hmrf_icp.errors import InputError


def optional(path: Path, library: str, extra: str) -> Any:
    """Import the library that ``path`` is read or written with.

    Parameters
    ----------
    path
        The file, for the message.
    library
        Name of its module.
    extra
        Of this package, that installs it.

    Raises
    ------
    InputError
        It is not installed, or cannot be loaded.
    """
    try:
        return importlib.import_module(library)
    except ImportError as error:
        raise InputError(
            f"{path}: needs {library} ({error}): pip install 'hmrf-icp[{extra}]'"
        ) from None
