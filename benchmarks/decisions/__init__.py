"""Decisions of the default and of the paper's loop, each with a change that breaks it.

One file a room. ``benchmarks/broken_decisions.py`` breaks them one at a time and asks
which test notices; ``tests/test_broken_decisions.py`` holds that each text is there once.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Decision:
    """One decision, and how it is broken.

    Attributes
    ----------
    name
        What is broken, unique, in a few words.
    decides
        What the decision is, in a line.
    file
        Where it stands, below ``src/hmrf_icp``.
    old, new
        Text that is there exactly once, and what takes its place.
    tests
        Test files, or single tests, that should notice; below ``tests``.
    """

    name: str
    decides: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]


def rooms() -> dict[str, tuple[Decision, ...]]:
    """Give the decisions of every room, in the order in which they are broken."""
    from decisions import aligners, clouds, features, field, paper, registration, search, visibility

    return {
        "the paper's loop": paper.DECISIONS,
        "loop: aligners, degeneracy, last steps": aligners.DECISIONS,
        "field": field.DECISIONS,
        "clouds": clouds.DECISIONS,
        "search: visibility and confidence": visibility.DECISIONS,
        "search: candidates": search.DECISIONS,
        "search: planes and features": features.DECISIONS,
        "registration": registration.DECISIONS,
    }
