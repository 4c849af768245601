"""Which pairs ``hmrf-icp register`` is asked for: files, folders, or a list of them."""

from __future__ import annotations

import csv
import re
import shlex
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hmrf_icp.errors import InputError

HOW = (
    "register: expected SOURCE and TARGET, SOURCE... TARGET, FOLDER TARGET, or --pairs LIST "
    "(hmrf-icp register --help)"
)

AMBIGUOUS = (".txt", ".csv")
"""Suffixes of clouds that poses, cameras and tables have too: not taken from a folder."""

COLUMNS = ("source", "target", "init")


@dataclass(frozen=True)
class Pair:
    """What is registered to what, and from where.

    Attributes
    ----------
    source, target
        Files.
    init
        The file of the start; None where nothing is known.
    """

    source: Path
    target: Path
    init: Path | None = None


def asked_for(
    sources: Sequence[Path],
    target: Path | None,
    listed: Path | None,
    init: Path | None,
    table: Path | None,
) -> Pair | tuple[Pair, ...]:
    """Tell what the command line asks for: one pair, or as many as there are.

    Parameters
    ----------
    sources, target
        The arguments; a source may be a folder.
    listed
        ``--pairs``.
    init
        ``--init``, for those that have none in a list.
    table
        ``--table``, which makes a single pair one of a table.

    Raises
    ------
    InputError
        Too little, too much, or a list or a folder in which there are no pairs.
    """
    if listed is not None:
        if sources or target is not None:
            raise InputError("register: give SOURCE and TARGET or --pairs LIST, not both")
        return tuple(Pair(one.source, one.target, one.init or init) for one in read_pairs(listed))
    if not sources or target is None:
        raise InputError(HOW)
    if len(sources) == 1 and table is None and not sources[0].is_dir():
        return Pair(sources[0], target, init)
    files = [file for source in sources for file in _files(source, target)]
    return tuple(Pair(file, target, init) for file in dict.fromkeys(files))


def _files(source: Path, target: Path) -> list[Path]:
    """List the clouds and depth maps of a folder, as people count; a file is itself."""
    from hmrf_icp.io import READABLE

    if not source.is_dir():
        return [source]
    kinds = [suffix for suffix in READABLE if suffix not in AMBIGUOUS]
    found = [
        file
        for file in sorted(source.iterdir(), key=_as_people_count)
        if file.suffix.lower() in kinds
        and not file.name.startswith(".")
        and file.is_file()
        and file.resolve() != target.resolve()
    ]
    if not found:
        raise InputError(
            f"{source}: is a directory in which no file ends in {', '.join(kinds)} "
            f"({' and '.join(AMBIGUOUS)} are taken only by name)"
        )
    return found


def _as_people_count(file: Path) -> list[tuple[int, str]]:
    """Order scan-9 before scan-10."""
    return [
        (int(part), "") if part.isdecimal() else (-1, part)
        for part in re.split(r"(\d+)", file.name)
        if part
    ]


def read_pairs(listed: Path) -> list[Pair]:
    """Read a list: source, target and perhaps a start on each line.

    Blanks stand between them, or commas where the list is called ``.csv`` or a line has
    any; names with blanks stand in quotes. ``#`` begins a comment. A first line may name
    the columns. Paths that are not absolute are seen from the folder of the list.

    Raises
    ------
    InputError
        It cannot be read, a line has one word or more than three, or there is none.
    """
    from hmrf_icp.io.files import existing_file, reading

    existing_file(listed)
    with reading(listed, "a list of pairs"):
        lines = listed.read_text(encoding="utf-8-sig").splitlines()
    pairs = []
    for number, line in enumerate(lines, 1):
        words = _words(line, listed, number)
        if not words or tuple(word.lower() for word in words) == COLUMNS[: len(words)]:
            continue
        if not 2 <= len(words) <= 3:
            raise InputError(
                f"{listed}: line {number} has {len(words)} entries, expected a source, a target "
                "and perhaps a file with the start; names with blanks go in quotes"
            )
        pairs.append(Pair(*(listed.parent / word for word in words)))
    if not pairs:
        raise InputError(f"{listed}: no pairs, expected a source and a target on each line")
    return pairs


def _words(line: str, listed: Path, number: int) -> list[str]:
    if line.lstrip().startswith("#"):
        return []
    if "," in line:
        rows = csv.reader([line], skipinitialspace=True)
        words = [word.strip() for row in rows for word in row]
        return words[:-1] if words and not words[-1] else words
    try:
        # No escapes: a backslash is a separator of paths somewhere.
        lexer = shlex.shlex(line, posix=True, punctuation_chars=False)
        lexer.whitespace_split, lexer.escape = True, ""
        return list(lexer)
    except ValueError:
        raise InputError(f"{listed}: line {number} has a quote without its other half") from None


def labels(files: Sequence[Path]) -> dict[Path, str]:
    """Name each file as shortly as tells it from the others: its end, from some folder on.

    Parameters
    ----------
    files
        Several times the same is one.
    """
    everyone = dict.fromkeys(files)
    named = dict.fromkeys(everyone, 1)
    while True:
        shown = {file: "/".join(file.parts[-named[file] :]) for file in everyone}
        often = Counter(shown.values())
        short = [f for f in everyone if often[shown[f]] > 1 and named[f] < len(f.parts)]
        if not short:
            return shown
        for file in short:
            named[file] += 1


def stems(pairs: Sequence[Pair]) -> dict[Pair, str]:
    """Name the files that each pair is written to, without suffix; no two alike.

    By the source; and by the target, where there are several.
    """
    sources = labels([pair.source.with_suffix("") for pair in pairs])
    targets = labels([pair.target.with_suffix("") for pair in pairs])
    taken: Counter[str] = Counter()
    named = {}
    for pair in dict.fromkeys(pairs):
        name = sources[pair.source.with_suffix("")]
        if len(targets) > 1:
            name += f"-to-{targets[pair.target.with_suffix('')]}"
        name = re.sub(r"[/\\:]+", "-", name).lstrip(".-") or "pair"
        taken[name.lower()] += 1
        while taken[name.lower()] > 1:
            name += f"-{taken[name.lower()]}"
            taken[name.lower()] += 1
        named[pair] = name
    return named
