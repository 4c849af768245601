"""Rows that nobody can have beforehand: the best peer setting, and any peer at any threshold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hmrf_icp.evaluate.report.methods import ReportedMethod, Roster, best, family_label
from hmrf_icp.evaluate.report.runs import Mask, Runs, Success
from hmrf_icp.evaluate.report.statistics import Share


@dataclass(frozen=True, eq=False)
class Oracle:
    """Problems (a pair from one start) that some peers tried, and whether any solved it.

    Attributes
    ----------
    problems
        One run a problem, for its overlap and start.
    solved
        (len(problems),) whether any of the peers' runs of it was a success.
    """

    problems: Runs
    solved: Mask

    def share(self, among: Mask | None = None) -> Share:
        """Recall over the problems, or over those under a mask."""
        return Share.of(self.solved if among is None else self.solved[among])


def oracle(runs: Runs, peers: Sequence[ReportedMethod], success: Success) -> Oracle:
    """Count a problem as solved if any peer at any threshold solved it."""
    tried = np.flatnonzero(np.isin(runs["method"], [peer.name for peer in peers]))
    numbers, first, place = np.unique(runs.problem[tried], return_index=True, return_inverse=True)
    solved = np.zeros(numbers.size, dtype=np.bool_)
    np.logical_or.at(solved, place, runs.solved(success)[tried])
    return Oracle(runs.where(tried[first]), solved)


@dataclass(frozen=True)
class Hindsight:
    """One way of choosing among peers afterwards.

    Attributes
    ----------
    label
        The peers that are chosen among, in words.
    peers
        Those peers.
    """

    label: str
    peers: tuple[ReportedMethod, ...]

    def best(self, runs: Runs, success: Success) -> ReportedMethod:
        """Return the single setting that solves most of some runs."""
        return best(runs, self.peers, success)

    def oracle(self, runs: Runs, success: Success) -> Oracle:
        """Return what any of the peers solved."""
        return oracle(runs, self.peers, success)


def hindsights(roster: Roster) -> tuple[Hindsight, ...]:
    """With the peers that use the start and, where there are others, with all of them."""
    local = tuple(peer for peer in roster.peers if peer.needs_start)
    if not roster.peers:
        return ()
    if len(local) in (0, len(roster.peers)):
        return (Hindsight("all peers", roster.peers),)
    others = sorted({family_label(peer.family) for peer in roster.peers if not peer.needs_start})
    return (
        Hindsight("the peers that use the start", local),
        Hindsight(f"all peers, with {'; '.join(others)}", roster.peers),
    )
