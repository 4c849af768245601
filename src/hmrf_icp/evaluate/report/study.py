"""One evaluation, read back from its folder."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hmrf_icp.errors import InputError
from hmrf_icp.evaluate.plain import plain
from hmrf_icp.evaluate.progress import Progress, silent
from hmrf_icp.evaluate.report.hindsight import Hindsight, hindsights
from hmrf_icp.evaluate.report.methods import ReportedMethod, Roster
from hmrf_icp.evaluate.report.runs import Mask, ReportedStart, Runs, Success, read_results
from hmrf_icp.io.files import reading
from hmrf_icp.lazy import cached_property


@dataclass(frozen=True, eq=False)
class Study:
    """What a report is made from.

    Attributes
    ----------
    folder
        Where it was read.
    runs
        The rows of ``results.csv``.
    config
        ``config.json``; empty where there is none.
    pairs
        The rows of ``pairs.csv``, as text; empty where there is none.
    success
        When a run counts as solved.
    """

    folder: Path
    runs: Runs
    config: Mapping[str, Any]
    pairs: tuple[Mapping[str, str], ...]
    success: Success

    @classmethod
    def read(cls, folder: Path, success: Success | None = None, report: Progress = silent) -> Study:
        """Read the folder that ``hmrf-icp evaluate`` wrote, and report how far that is.

        Raises
        ------
        InputError
            No such folder, no results in it, or a file that cannot be read.
        """
        if not folder.is_dir():
            raise InputError(
                f"{folder}: no such folder; expected the --output of `hmrf-icp evaluate`"
            )
        success = Success() if success is None else success
        if not (success.metres > 0 and success.radians > 0):
            raise InputError(f"success: expected two positive thresholds, got {success}")
        runs = read_results(folder / "results.csv", report)
        return cls(folder, runs, _read_config(folder / "config.json"), _read_pairs(folder), success)

    @cached_property
    def roster(self) -> Roster:
        """The methods, in kinds."""
        return Roster.of(self.runs, self.config)

    @cached_property
    def hindsights(self) -> tuple[Hindsight, ...]:
        """Ways of choosing among the peers afterwards."""
        return hindsights(self.roster)

    def hindsight(self, start: ReportedStart) -> Hindsight | None:
        """Return the peers to hold runs from a start against; None without peers.

        Those that use the start where there is one, and all of them where there is none.
        """
        if not self.hindsights:
            return None
        return self.hindsights[0 if start.given else -1]

    @cached_property
    def headline(self) -> ReportedMethod:
        """The method that the report is about."""
        return self.roster.headline(self.runs, self.success)

    @cached_property
    def solved(self) -> Mask:
        """Which runs succeeded."""
        return self.runs.solved(self.success)

    @cached_property
    def scenes(self) -> Mapping[str, str]:
        """Benchmark and scene by the name of a pair; empty for sequences of frames."""
        return {row["pair"]: row["scene"] for row in self.pairs if row.get("scene")}

    @cached_property
    def criterion(self) -> str:
        """When a run counts as solved, as the end of a sentence: ``it ends within ...``."""
        own = self.config.get("criterion")
        if isinstance(own, str) and np.isfinite(self.runs["right"]).any():
            return own
        return f"it ends within {self.success} of the true pose"

    @property
    def starts(self) -> tuple[ReportedStart, ...]:
        """The different starts."""
        return self.runs.starts

    @cached_property
    def dataset(self) -> str:
        """Name of the data set, for headings."""
        dataset = self.config.get("dataset", "")
        if isinstance(dataset, Mapping):
            dataset = dataset.get("name") or dataset.get("path") or ""
        text = str(dataset).rstrip("/\\")
        return plain(text.replace("\\", "/").rsplit("/", 1)[-1] or self.folder.resolve().name)


def _read_config(path: Path) -> Mapping[str, Any]:
    if not path.is_file():
        return {}
    try:
        config = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not JSON ({error}); run `hmrf-icp evaluate` again") from None
    if not isinstance(config, Mapping):
        raise InputError(f"{path}: expected an object, found {type(config).__name__}")
    return config


def _read_pairs(folder: Path) -> tuple[Mapping[str, str], ...]:
    path = folder / "pairs.csv"
    if not path.is_file():
        return ()
    with reading(path, "a list of pairs"), path.open(encoding="utf-8", newline="") as stream:
        rows = csv.DictReader(stream, skipinitialspace=True)
        return tuple({k: v for k, v in row.items() if k and v is not None} for row in rows)
