"""A data set that lists its pairs, each with its pose and its own criterion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hmrf_icp.datasets.criterion import Criterion
from hmrf_icp.datasets.sequence import Frame, Scan
from hmrf_icp.errors import InputError
from hmrf_icp.se3 import Array


@dataclass(frozen=True, eq=False)
class ListedPair:
    """Two clouds whose relative pose is known.

    Parameters
    ----------
    benchmark
        Which list it stands in; empty where there is one list alone.
    scene
        What it shows. Recall is the mean over scenes.
    target, source
        Numbers of the two clouds within the scene.
    target_scan, source_scan
        Read the clouds, each in a frame of its own.
    truth
        (4, 4) source to target.
    criterion
        When a pose is right.
    overlap
        Share of the source that the target has too, where the data says it; None has it measured.
    unit
        What one metre of a shifted start is in the clouds' unit.
    """

    benchmark: str
    scene: str
    target: int
    source: int
    target_scan: Scan
    source_scan: Scan
    truth: Array
    criterion: Criterion
    overlap: float | None = None
    unit: float = 1.0

    @property
    def place(self) -> str:
        """Benchmark and scene."""
        return f"{self.benchmark}/{self.scene}" if self.benchmark else self.scene

    @property
    def frames(self) -> tuple[Frame, Frame]:
        """Target and source as frames; the target's is the world."""
        return (
            Frame(self.target, np.eye(4), self.target_scan, scene=self.scene),
            Frame(self.source, self.truth, self.source_scan, scene=self.scene),
        )


@dataclass(frozen=True, eq=False)
class PairSet:
    """Pairs of clouds with known poses.

    Parameters
    ----------
    name
        What to call it in reports.
    format
        Name of the format that it was read as.
    pairs
        In the order of benchmarks and scenes.
    criterion
        When a pose is right, in words that end a sentence ("... counts as solved when").
    metres
        Whether all clouds are in metres and of the size of a room, which distances in metres need.
    source
        Its folder.
    notes
        What a reader of results should know.

    Raises
    ------
    InputError
        No pair.
    """

    name: str
    format: str
    pairs: tuple[ListedPair, ...]
    criterion: str
    metres: bool
    source: Path
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse what holds no pair."""
        if not self.pairs:
            raise InputError(f"{self.source}: no pair in this {self.format} data set")

    def __len__(self) -> int:
        return len(self.pairs)

    @property
    def benchmarks(self) -> tuple[str, ...]:
        """Names of the lists."""
        return tuple(dict.fromkeys(pair.benchmark for pair in self.pairs))

    def only(self, benchmark: str) -> PairSet:
        """Return the pairs of one list.

        Raises
        ------
        InputError
            There is none of that name.
        """
        known = {name.lower(): name for name in self.benchmarks}
        if benchmark.lower() not in known:
            raise InputError(
                f"{self.source}: no benchmark {benchmark!r}; there are "
                f"{', '.join(name or '(one without a name)' for name in self.benchmarks)}"
            )
        return self.where(lambda pair: pair.benchmark == known[benchmark.lower()])

    def where(self, keep: Callable[[ListedPair], bool]) -> PairSet:
        """Return the pairs that a function says yes to."""
        return replace(self, pairs=tuple(pair for pair in self.pairs if keep(pair)))
