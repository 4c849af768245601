"""What a data set's format is, and what a collection of named sequences is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from hmrf_icp.datasets.pair_set import PairSet
from hmrf_icp.datasets.sequence import Progress, Sequence


@dataclass(frozen=True)
class Format:
    """A layout of folders on disk.

    Parameters
    ----------
    name
        What people call it.
    layout
        What has to be in the folder, in words, for messages and documents.
    recognises
        Whether a folder looks like it. Lenient: a folder with half of what is
        needed is better opened, and refused with the name of what is missing.
    open
        Reads a folder; raises InputError.
    """

    name: str
    layout: str
    recognises: Callable[[Path], bool]
    open: Callable[[Path], Sequence | PairSet]


@dataclass(frozen=True)
class Collection:
    """Sequences that have a name instead of a folder: ``PREFIX:MEMBER``.

    Parameters
    ----------
    prefix
        Before the colon.
    members
        What may stand after it.
    open
        Opens a member; a callback, or None, is told of the progress.
    default
        Member that the prefix alone stands for, None if it does not.
    aliases
        Other names that members go by, not listed.
    """

    prefix: str
    members: tuple[str, ...]
    open: Callable[[str, Progress | None], Sequence]
    default: str | None = None
    aliases: Mapping[str, str] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Every full name."""
        full = tuple(f"{self.prefix}:{member}" for member in self.members)
        return full if self.default is None else (self.prefix, *full)
