"""How evaluations and reports tell whoever waits how far they are."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

Progress: TypeAlias = Callable[[str, int, "int | None"], None]
"""Called with what is being done ("Registering"), how much of it is, and how much there is.

None where nobody knows how much there is.
"""

REGISTERING = "Registering"

IN_BYTES = {"download": "Downloading", "unpack": "Unpacking"}
"""Stages that are counted in bytes, by what the data sets call them."""


def silent(stage: str, done: int, total: int | None) -> None:
    """Tell nobody."""
