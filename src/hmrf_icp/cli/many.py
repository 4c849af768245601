"""``hmrf-icp register`` on many pairs: a row each, and a table at the end."""

from __future__ import annotations

import json
import signal
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NoReturn

import typer

from hmrf_icp.cli.evaluation_bar import EvaluationBar
from hmrf_icp.cli.ledger import BELIEVED, DOUBTFUL, FAILED, Ledger, Row, key, row_of, settings_text
from hmrf_icp.cli.loudness import is_verbose, note, say
from hmrf_icp.cli.options import method_named
from hmrf_icp.cli.outputs import FIGURE_SUFFIXES, Outputs
from hmrf_icp.cli.pair_table import names_of, pair_table
from hmrf_icp.cli.pairs import Pair, stems
from hmrf_icp.cli.progress import told_of_compiling
from hmrf_icp.cli.summary import json_text, plain, stages
from hmrf_icp.cli.tables import show
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.prepared import PreparedCloud, prepare
from hmrf_icp.errors import HmrfIcpError, InputError, RegistrationWarning
from hmrf_icp.io import WRITABLE
from hmrf_icp.presets import Registrar

if TYPE_CHECKING:
    from hmrf_icp.registration import Where

EXIT = {BELIEVED: 0, DOUBTFUL: 1, FAILED: 2}
"""What each verdict says to a shell; the largest of all pairs is the command's."""

REMEMBERED = 4
"""Clouds that are kept prepared: the target of all, or the last few of a list that is a chain."""

FILES = (*WRITABLE, *FIGURE_SUFFIXES)
"""Suffixes that no folder is meant to have."""


@dataclass
class Many:
    """A run over many pairs.

    Parameters
    ----------
    pairs
        In this order.
    read
        How a file becomes a cloud.
    method
        What registers.
    viewpoint
        As for `hmrf_icp.prepare`.
    search, num_threads
        As for `hmrf_icp.register`.
    folders
        What is written of each, as folders instead of files.
    table
        Where rows are kept, and taken from where they are done.
    inputs
        Other files that must not be written to.
    settings
        The options that a pose depends on.
    as_json, profile
        Whether to print a JSON object each, and with what.
    """

    pairs: Sequence[Pair]
    read: Callable[[Path], PointCloud]
    method: Registrar
    viewpoint: Literal["auto"] | None
    search: Where
    num_threads: int | None
    folders: Outputs
    table: Path | None
    inputs: Sequence[Path]
    settings: Mapping[str, Any]
    as_json: bool
    profile: bool
    _known: dict[Path, tuple[PointCloud, PreparedCloud]] = field(default_factory=dict, init=False)
    _warned: set[str] = field(default_factory=set, init=False)

    def run(self) -> int:
        """Register them all, print a table of what was done, and return the exit status.

        Raises
        ------
        InputError
            Something is wrong with all of them: the target that they share, an output.
        """
        settings = settings_text(dict(self.settings) | {"search": self.search})
        outputs = self._outputs()
        ledger = Ledger(self.table, settings)
        only = {pair.target for pair in self.pairs}
        if len(only) == 1:
            self._cloud(*only)
        rows: list[Row] = []
        try:
            with EvaluationBar() as bar, told_of_compiling(bar), _noticed() as asked_to_stop:
                for number, pair in enumerate(self.pairs):
                    if asked_to_stop():
                        raise KeyboardInterrupt
                    row = ledger.done(pair)
                    if row is not None and all(file.exists() for _, file in outputs[pair].files):
                        self._print_json(row.content() | {"from_table": True})
                    else:
                        bar("Registering", number, len(self.pairs))
                        if is_verbose():
                            bar.line(f"{number + 1} of {len(self.pairs)}: {self._called(pair)}")
                        row = self._one(pair, outputs[pair], settings, bar)
                        ledger.add(row)
                    rows.append(row)
                bar("Registering", len(self.pairs), len(self.pairs))
        except KeyboardInterrupt:
            note(self._left(len(rows)))
            raise
        finally:
            # Also where writing failed: what is known is said.
            if rows:
                self._print_table(rows)
        return max(EXIT[row.verdict] for row in rows)

    def _one(self, pair: Pair, outputs: Outputs, settings: str, bar: EvaluationBar) -> Row:
        """Register one pair; a file that cannot be used is its row's error, not the end."""
        import hmrf_icp
        from hmrf_icp.io import read_pose

        try:
            start = None if pair.init is None else read_pose(pair.init)
            source, target = self._cloud(pair.source)[1], self._cloud(pair.target)[1]
            with warnings.catch_warnings(record=True) as said:
                warnings.simplefilter("always", RegistrationWarning)
                result = hmrf_icp.register(
                    source,
                    target,
                    start,
                    preset=self.method,
                    viewpoint=self.viewpoint,
                    search=self.search,
                    num_threads=self.num_threads,
                    profile=self.profile or is_verbose(),
                    on_iteration=bar.iteration if is_verbose() else None,
                )
        except (HmrfIcpError, OSError) as error:
            reason = " ".join(str(error).splitlines())
            if isinstance(error, OSError) and error.filename:
                reason = f"{error.filename}: {error.strerror}"
            about = "" if reason.startswith(str(pair.source)) else f"{self._called(pair)}: "
            typer.echo(f"Error: {about}{reason}", err=True)
            failed = Row(*key(pair), FAILED, error=reason, settings=settings)
            self._print_json(failed.content())
            return failed
        self._warn(pair, said)
        if result.profile is not None and is_verbose():
            bar.line("\n".join(stages(result.profile)))
        outputs.write(
            self._cloud(pair.source)[0],
            self._cloud(pair.target)[0],
            result,
            start,
            (pair.source.name, pair.target.name),
            method_named(**self._chosen, colour=bool(self.settings.get("colour"))),
        )
        if self.as_json:
            typer.echo(json_text(result, self._named(pair)))
        return row_of(pair, result, settings)

    def _cloud(self, file: Path) -> tuple[PointCloud, PreparedCloud]:
        """Return what is in a file, as it is and prepared; the last few are remembered."""
        known = self._known.pop(file, None)
        if known is None:
            cloud = self.read(file)
            known = cloud, prepare(cloud, str(file), self.viewpoint)
        self._known[file] = known
        while len(self._known) > REMEMBERED:
            del self._known[next(iter(self._known))]
        return known

    def _outputs(self) -> dict[Pair, Outputs]:
        """Tell the files of each pair, and refuse before the work what could not be written."""
        from hmrf_icp.io.whole import require_writable

        for option, folder in self.folders.files:
            if folder.exists() and not folder.is_dir():
                raise InputError(
                    f"{option} {folder}: is a file; of many pairs it is a folder, give one"
                )
            if folder.suffix.lower() in FILES and not folder.exists():
                raise InputError(
                    f"{option} {folder}: looks like a file; of many pairs it is a folder, give one"
                )
        taken = {file.resolve(): "an input of this run" for file in self.inputs}
        for pair in self.pairs:
            for file in (pair.source, pair.target, pair.init):
                if file is not None:
                    taken[file.resolve()] = "an input of this run"
        named = stems(self.pairs)
        found = {}
        for pair, stem in named.items():
            found[pair] = mine = self.folders.in_folders(stem, pair.source)
            for option, file in mine.files:
                if file.resolve() in taken:
                    raise InputError(
                        f"{option} {file.parent}: {file} is {taken[file.resolve()]}, give another "
                        "folder"
                    )
                taken[file.resolve()] = f"what {option} writes"
        if self.table is not None and self.table.resolve() in taken:
            raise InputError(f"--table {self.table}: is {taken[self.table.resolve()]}")
        for _, folder in self.folders.files:
            folder.mkdir(parents=True, exist_ok=True)
            require_writable(folder / "row")
        return found

    def _warn(self, pair: Pair, said: Sequence[warnings.WarningMessage]) -> None:
        """Say what the library warned of: of each file once, and not what the table says."""
        for warning in said:
            message = str(warning.message)
            if not issubclass(warning.category, RegistrationWarning):
                warnings.warn_explicit(
                    warning.message, warning.category, warning.filename, warning.lineno
                )
            elif message.startswith("confidence ") and not is_verbose():
                continue
            else:
                about = pair.target.name if message.startswith("target: ") else self._called(pair)
                line = f"Warning: {about}: {message}"
                if line not in self._warned:
                    self._warned.add(line)
                    say(line, err=True)

    def _called(self, pair: Pair) -> str:
        several = len({one.target for one in self.pairs}) > 1
        return f"{pair.source} to {pair.target}" if several else str(pair.source)

    @property
    def _chosen(self) -> dict[str, Any]:
        return {name: self.settings.get(name) for name in ("preset", "rejector", "aligner")}

    def _named(self, pair: Pair) -> dict[str, Any]:
        return {**self._chosen, "source": pair.source, "target": pair.target, "init": pair.init}

    def _print_json(self, content: Mapping[str, Any]) -> None:
        if self.as_json:
            typer.echo(json.dumps(plain(dict(content)), allow_nan=False))

    def _left(self, done: int) -> str:
        """Say what an interrupted run leaves."""
        if not done:
            return "none is done yet"
        state = f"{done} of {len(self.pairs)} are done"
        if self.table is None:
            return f"{state}; with --table CSV the same command would go on from there"
        return f"{state} and kept in {self.table}; the same command goes on from there"

    def _print_table(self, rows: Sequence[Row]) -> None:
        show(pair_table(rows), names_of(rows), stderr=self.as_json)
        counts = Counter(row.verdict for row in rows)
        say(
            ", ".join(f"{counts[verdict]} {verdict}" for verdict in EXIT if counts[verdict]),
            err=self.as_json,
        )
        for option, place in [*self.folders.files, ("--table", self.table)]:
            if place is not None:
                say(f"{option}: {place}", err=self.as_json)


def refuse_for_many(**options: Any) -> None:
    """Refuse the options that are for one pair alone; None is not given."""
    given = [name.replace("_", "-") for name, value in options.items() if value is not None]
    if given:
        raise InputError(f"--{given[0]}: is for one pair alone, leave it out or give one SOURCE")


@contextmanager
def _noticed() -> Iterator[Callable[[], bool]]:
    """Let nobody swallow Ctrl-C, or what a batch system sends: tell whether one came.

    Where it falls into a callback of the compiler, Python prints it and goes on.
    """
    came: list[int] = []

    def stop(number: int, frame: Any) -> NoReturn:  # noqa: ARG001
        came.append(number)
        raise KeyboardInterrupt

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: bool(came)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
