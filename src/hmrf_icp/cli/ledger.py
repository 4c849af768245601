"""What became of each of many pairs: rows, and the file that keeps them."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hmrf_icp.errors import InputError

if TYPE_CHECKING:
    from hmrf_icp.cli.pairs import Pair
    from hmrf_icp.result import RegistrationResult

BELIEVED, DOUBTFUL, FAILED = "believed", "doubtful", "failed"
"""The pose is to be believed; it is not; there is none, because a file could not be used."""


@dataclass(frozen=True)
class Row:
    """What became of a pair. Of a failed one, the numbers are NaN.

    Attributes
    ----------
    source, target, init
        Files, as they were given; no start is empty.
    verdict
        `BELIEVED`, `DOUBTFUL` or `FAILED`.
    confidence
        NaN too where the method gives none.
    overlap, fitness
        Shares, of the source's surface and of its points.
    inlier_rmse
        Metres.
    seconds
        Of the registration alone.
    converged, iterations
        As the result has them.
    transformation
        The matrix, source to target, row by row with blanks.
    error
        Why it failed.
    settings
        The options that the pose depends on, as JSON.
    """

    source: str
    target: str
    init: str
    verdict: str
    confidence: float = math.nan
    overlap: float = math.nan
    fitness: float = math.nan
    inlier_rmse: float = math.nan
    seconds: float = math.nan
    converged: bool = False
    iterations: int = 0
    transformation: str = ""
    error: str = ""
    settings: str = ""

    @property
    def key(self) -> tuple[str, str, str]:
        """What tells a pair from others."""
        return self.source, self.target, self.init

    def content(self) -> dict[str, Any]:
        """Return what a program wants of a row: numbers, and a matrix as one."""
        values = asdict(self)
        words = [float(word) for word in values.pop("transformation").split()]
        values["transformation"] = [words[k : k + 4] for k in range(0, 16, 4)] if words else None
        values["believed"] = values.pop("verdict") == BELIEVED
        values["error"] = self.error or None
        values["init"] = self.init or None
        values["settings"] = json.loads(self.settings or "{}")
        return values


def key(pair: Pair) -> tuple[str, str, str]:
    """Return what tells a pair from others, as its row has it."""
    return str(pair.source), str(pair.target), "" if pair.init is None else str(pair.init)


def settings_text(settings: Mapping[str, Any]) -> str:
    """Write down the options that a pose depends on; those that were not given are left out."""
    given = {name: str(value) for name, value in settings.items() if value is not None}
    return json.dumps(given, sort_keys=True)


def row_of(pair: Pair, result: RegistrationResult, settings: str) -> Row:
    """Say what became of a pair that was registered."""
    return Row(
        *key(pair),
        BELIEVED if result.believed else DOUBTFUL,
        confidence=math.nan if result.confidence is None else float(result.confidence),
        overlap=float(result.overlap),
        fitness=float(result.fitness),
        inlier_rmse=float(result.inlier_rmse),
        seconds=float(result.seconds),
        converged=bool(result.converged),
        iterations=result.iterations,
        transformation=" ".join(repr(float(value)) for value in result.transformation.ravel()),
        settings=settings,
    )


class Ledger:
    """The rows of a ``--table``, written whole whenever one is added.

    Parameters
    ----------
    path
        Where they are kept; None keeps them in memory alone.
    settings
        Of this run; rows that were made with others are no company for it.

    Raises
    ------
    InputError
        The file is no such table, or its rows were made with other settings.
    """

    def __init__(self, path: Path | None, settings: str) -> None:
        self._path = path
        self._rows: dict[tuple[str, str, str], Row] = {}
        if path is not None:
            from hmrf_icp.io.whole import require_writable

            require_writable(path)
            if path.exists() and path.stat().st_size:
                self._rows = {row.key: row for row in _read(path)}
        for row in self._rows.values():
            if row.settings != settings:
                raise InputError(
                    f"--table {path}: its rows were made with {row.settings}, this run has "
                    f"{settings}; give another name, or remove it"
                )

    def done(self, pair: Pair) -> Row | None:
        """Return the row of a pair; None where there is none yet, or it failed."""
        row = self._rows.get(key(pair))
        return None if row is None or row.verdict == FAILED else row

    def add(self, row: Row) -> None:
        """Keep a row, instead of an earlier one of the same pair."""
        self._rows[row.key] = row
        if self._path is not None:
            _write(self._path, self._rows.values())


_NAMES = tuple(field.name for field in fields(Row))


def _write(path: Path, rows: Iterable[Row]) -> None:
    from hmrf_icp.io.whole import written_whole

    with written_whole(path) as partial, partial.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, _NAMES)
        writer.writeheader()
        for row in rows:
            writer.writerow({k: "" if v != v else v for k, v in asdict(row).items()})


def _read(path: Path) -> list[Row]:
    from hmrf_icp.io.files import reading

    with reading(path, "a table of registrations"), path.open(encoding="utf-8", newline="") as file:
        reader = csv.DictReader(file)
        if tuple(reader.fieldnames or ()) != _NAMES:
            raise InputError(
                f"--table {path}: is not a table of this command, whose columns are "
                f"{', '.join(_NAMES)}; give another name"
            )
        return [_parsed(row) for row in reader]


def _parsed(row: Mapping[str, str]) -> Row:
    values: dict[str, Any] = dict(row)
    for name in ("confidence", "overlap", "fitness", "inlier_rmse", "seconds"):
        values[name] = float(row[name] or "nan")
    values["converged"] = row["converged"] == "True"
    values["iterations"] = int(row["iterations"])
    return Row(**values)
