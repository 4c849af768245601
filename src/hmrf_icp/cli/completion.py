"""What a shell is told when it asks how a word may go on."""

from __future__ import annotations

from collections.abc import Callable, Iterable


def words(known: Iterable[str]) -> Callable[[str], list[str]]:
    """Return what an option's ``autocompletion`` takes: the known words that begin as typed."""
    everyone = tuple(known)

    def begins(incomplete: str) -> list[str]:
        return [word for word in everyone if word.startswith(incomplete)]

    return begins


def listed(known: Iterable[str]) -> Callable[[str], list[str]]:
    """Do the same where several words stand with commas between them."""
    everyone = tuple(known)

    def begins(incomplete: str) -> list[str]:
        done, comma, last = incomplete.rpartition(",")
        taken = done.split(",")
        return [
            f"{done}{comma}{word}"
            for word in everyone
            if word.startswith(last) and word not in taken
        ]

    return begins
