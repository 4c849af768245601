"""Every run of an evaluation, numbered: pair by pair, start by start, axis by axis, by method."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from hmrf_icp.evaluate.protocol import Pair, Start
from hmrf_icp.lazy import cached_property

RUNS_PER_TASK = 8
"""Runs of one pair that a worker does in one go: what a kill can cost it."""


@dataclass(frozen=True)
class Run:
    """One registration: which pair, from where, by which method.

    Parameters
    ----------
    number
        Its place in the plan, from zero.
    """

    number: int
    pair: Pair
    start: Start
    axis: int
    method: str


@dataclass(frozen=True)
class Plan:
    """All combinations of pairs, starts, axes and methods.

    Without a start there is nothing to turn, and one axis: the first.

    A run is known by its number, so that what is done takes a byte a run to
    remember, and rows in the order of their numbers are sorted.
    """

    pairs: tuple[Pair, ...]
    starts: tuple[Start, ...]
    axes: int
    methods: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.pairs) * self._per_pair

    @property
    def _per_pair(self) -> int:
        return len(self._begun) * len(self.methods)

    @cached_property
    def _begun(self) -> tuple[tuple[Start, int], ...]:
        """Starts with their axes, in order."""
        return tuple(
            (start, axis)
            for start in self.starts
            for axis in range(self.axes if start.given else 1)
        )

    def run(self, number: int) -> Run:
        """Return the run of this number."""
        rest, method = divmod(number, len(self.methods))
        pair, begun = divmod(rest, len(self._begun))
        return Run(number, self.pairs[pair], *self._begun[begun], self.methods[method])

    def number(self, pair: str, start: Start, axis: int, method: str) -> int:
        """Return the number of a run; KeyError where there is none like it."""
        places = self._places
        rest = places.pairs[pair] * len(self._begun) + places.begun[start, axis]
        return rest * len(self.methods) + places.methods[method]

    @cached_property
    def _places(self) -> _Places:
        return _Places(
            {pair.name: place for place, pair in enumerate(self.pairs)},
            {begun: place for place, begun in enumerate(self._begun)},
            {method: place for place, method in enumerate(self.methods)},
        )

    def batches(self, done: Sequence[int]) -> Iterator[tuple[Run, ...]]:
        """Yield what is left to do, a few runs of one pair at a time.

        Parameters
        ----------
        done
            Something true at the number of every run that needs no doing.
        """
        for first in range(0, len(self), self._per_pair):
            batch: list[Run] = []
            for number in range(first, first + self._per_pair):
                if done[number]:
                    continue
                batch.append(self.run(number))
                if len(batch) == RUNS_PER_TASK:
                    yield tuple(batch)
                    batch = []
            if batch:
                yield tuple(batch)


@dataclass(frozen=True)
class _Places:
    pairs: dict[str, int]
    begun: dict[tuple[Start, int], int]
    methods: dict[str, int]
