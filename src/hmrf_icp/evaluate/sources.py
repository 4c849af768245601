"""What an evaluation takes its pairs from: a sequence of frames, or a list of pairs."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from hmrf_icp import datasets
from hmrf_icp.datasets import Criterion, Frame, ListedPair, PairSet
from hmrf_icp.errors import InputError
from hmrf_icp.evaluate import protocol, work
from hmrf_icp.evaluate.configuration import Configuration
from hmrf_icp.evaluate.progress import Progress
from hmrf_icp.evaluate.protocol import Pair
from hmrf_icp.evaluate.workers import Lost, Workers, outcomes

FRAMES_PER_TASK = 4
"""Source frames whose overlap a worker measures in one go."""

MEASURING = "Measuring overlaps"


@dataclass(frozen=True)
class Posed:
    """The two frames of a pair, with what its data set says of an answer.

    Parameters
    ----------
    target, source
        Their poses have the true transformation between them.
    criterion
        When a pose is right; None where the data set leaves that to the report.
    unit
        What a metre of a shift is in the clouds' unit.
    """

    target: Frame
    source: Frame
    criterion: Criterion | None = None
    unit: float = 1.0


class PairSource(Protocol):
    """Where the pairs come from."""

    @property
    def targets(self) -> tuple[int, ...]:
        """Indices of the target frames; none where the pairs are listed."""

    @property
    def criterion(self) -> str:
        """When a pose is right, in words; empty where the report says it."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader should know of the data."""

    def find(
        self, configuration: Configuration, clouds: work.Clouds, team: Workers, report: Progress
    ) -> tuple[Pair, ...]:
        """Choose the pairs."""

    def posed(self, pair: Pair) -> Posed:
        """Return what a pair is registered from."""

    def gaps(self, pairs: Sequence[Pair]) -> Iterator[str]:
        """Say which overlaps have no pair."""


def source_of(
    data: datasets.Sequence | PairSet, configuration: Configuration
) -> FrameSource | ListSource:
    """Return where the pairs of a data set come from.

    Raises
    ------
    InputError
        Target frames are asked for and there are none, or a benchmark likewise.
    """
    if isinstance(data, PairSet):
        if configuration.targets:
            raise InputError(
                f"{configuration.dataset}: lists its pairs, there is no reference frame to choose"
            )
        return ListSource(data.only(configuration.benchmark) if configuration.benchmark else data)
    if configuration.benchmark:
        raise InputError(f"{configuration.dataset}: a sequence of frames, which has no benchmarks")
    return FrameSource(data, _targets(data, configuration.targets))


def _targets(sequence: datasets.Sequence, wanted: tuple[int, ...] | None) -> tuple[int, ...]:
    if wanted is None:
        return protocol.spread_targets(frame.index for frame in sequence.frames)
    if len(set(wanted)) < len(wanted):
        raise InputError("reference frames: one is given twice")
    return tuple(sorted(sequence.frame(index).index for index in wanted))


# --- frames -----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class FrameSource:
    """Pairs of a sequence: drawn from each decile of the overlap with some target frames."""

    sequence: datasets.Sequence
    targets: tuple[int, ...]
    criterion: str = ""

    @property
    def notes(self) -> tuple[str, ...]:
        """Those of the sequence."""
        return self.sequence.notes

    def posed(self, pair: Pair) -> Posed:
        """Return the two frames; InputError where the sequence has not got them."""
        return Posed(self.sequence.frame(pair.target), self.sequence.frame(pair.source))

    def find(
        self, configuration: Configuration, clouds: work.Clouds, team: Workers, report: Progress
    ) -> tuple[Pair, ...]:
        """Measure every frame's overlap with the targets, and draw from each decile."""
        sequence = self.sequence
        targets = tuple(sequence.frame(index) for index in self.targets)
        tasks = [
            work.OverlapTask(clouds, targets, sequence.frames[first : first + FRAMES_PER_TASK])
            for first in range(0, len(sequence), FRAMES_PER_TASK)
        ]
        overlaps = {}
        for task, found in _measured(configuration, tasks, len(sequence), team, report):
            for frame in task.sources:
                for target in self.targets:
                    overlaps[target, frame.index] = found[target, frame.index]
        pairs = tuple(
            pair
            for index in self.targets
            for pair in protocol.select(
                index,
                {source: share for (target, source), share in overlaps.items() if target == index},
                configuration.frames_per_decile,
                configuration.seed,
                configuration.minimum_overlap,
            ).pairs
        )
        if not pairs:
            raise InputError(
                f"{configuration.dataset}: no frame overlaps target frame "
                f"{' or '.join(map(str, self.targets))} by {configuration.minimum_overlap:g} or "
                "more; choose another with --reference-frame"
            )
        return pairs

    def gaps(self, pairs: Sequence[Pair]) -> Iterator[str]:
        """Say which deciles of overlap have no pair."""
        for target in self.targets:
            covered = {protocol.decile(pair.overlap) for pair in pairs if pair.target == target}
            missing = [tenth for tenth in range(protocol.DECILES) if tenth not in covered]
            if missing:
                yield f"target frame {target}: no pair with an overlap of {_ranges(missing)}"


def _measured(
    configuration: Configuration,
    tasks: Sequence[work.OverlapTask],
    count: int,
    team: Workers,
    report: Progress,
) -> Iterator[tuple[work.OverlapTask, dict[tuple[int, int], float]]]:
    """Have overlaps measured; an overlap that cannot be is an error."""
    done = 0
    report(MEASURING, 0, count)
    for task, found in outcomes(team, work.measure_overlaps, iter(tasks)):
        if isinstance(found, Lost):
            frame = task.sources[0]
            where = f"{frame.scene}, cloud" if frame.scene else "frame"
            raise InputError(f"{configuration.dataset}, {where} {frame.index}: {found.reason}")
        yield task, found
        done += len(task.sources)
        report(MEASURING, done, count)


def _ranges(tenths: Sequence[int]) -> str:
    """Write runs of neighbouring deciles as one: [0, 1, 5] is '0 to 0.2 or 0.5 to 0.6'."""
    groups = itertools.groupby(enumerate(tenths), key=lambda item: item[1] - item[0])
    spans = [[tenth for _, tenth in group] for _, group in groups]
    return " or ".join(f"{span[0] / 10:g} to {(span[-1] + 1) / 10:g}" for span in spans)


# --- lists ------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class ListSource:
    """Pairs that the data set lists."""

    pair_set: PairSet
    targets: tuple[int, ...] = ()
    _pairs: Mapping[tuple[str, int, int], ListedPair] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Sort the pairs by their place."""
        pairs = {(pair.place, pair.target, pair.source): pair for pair in self.pair_set.pairs}
        object.__setattr__(self, "_pairs", pairs)

    @property
    def criterion(self) -> str:
        """That of the data set."""
        return self.pair_set.criterion

    @property
    def notes(self) -> tuple[str, ...]:
        """Those of the data set."""
        return self.pair_set.notes

    def posed(self, pair: Pair) -> Posed:
        """Return the two clouds of a pair; InputError where the list has not got it."""
        listed = self._pairs.get((pair.scene, pair.target, pair.source))
        if listed is None:
            raise InputError(f"{self.pair_set.source}: no pair {pair.name} in this data set")
        return Posed(*listed.frames, listed.criterion, listed.unit)

    def find(
        self, configuration: Configuration, clouds: work.Clouds, team: Workers, report: Progress
    ) -> tuple[Pair, ...]:
        """Take every pair that overlaps enough; measure where the data do not say."""
        overlaps = {key: pair.overlap for key, pair in self._pairs.items()}
        unknown = [key for key, share in overlaps.items() if share is None]
        tasks, keys = [], {}
        for key in unknown:
            target, source = self._pairs[key].frames
            tasks.append(work.OverlapTask(clouds, (target,), (source,)))
            keys[id(tasks[-1])] = key
        if tasks:
            for task, found in _measured(configuration, tasks, len(tasks), team, report):
                overlaps[keys[id(task)]] = next(iter(found.values()))
        pairs = tuple(
            Pair(target, source, share, place)
            for (place, target, source), share in overlaps.items()
            if share is not None and share > 0 and share >= configuration.minimum_overlap
        )
        if not pairs:
            raise InputError(
                f"{configuration.dataset}: no pair overlaps by {configuration.minimum_overlap:g} "
                "or more; lower --minimum-overlap"
            )
        return pairs

    def gaps(self, pairs: Sequence[Pair]) -> Iterator[str]:  # noqa: ARG002
        """Say nothing: the list is what it is."""
        yield from ()
