"""From a folder or a name to a sequence, through formats that anybody may add to."""

from __future__ import annotations

import os
from pathlib import Path

from hmrf_icp.datasets import (
    clouds,
    fragment_benchmark,
    fragments,
    infinitam,
    kitti,
    pair_folders,
    redwood,
    seven_scenes,
    synthetic,
    tum,
    tum_download,
)
from hmrf_icp.datasets.folders import describe
from hmrf_icp.datasets.formats import Collection, Format
from hmrf_icp.datasets.pair_set import PairSet
from hmrf_icp.datasets.sequence import Progress, Sequence
from hmrf_icp.errors import InputError

# Asked in this order: the more telling layouts first.
_FORMATS: list[Format] = [
    tum.FORMAT,
    seven_scenes.FORMAT,
    kitti.FORMAT,
    infinitam.FORMAT,
    redwood.FORMAT,
    fragment_benchmark.FORMAT,
    pair_folders.FORMAT,
    fragments.FORMAT,
    clouds.FORMAT,
]
_COLLECTIONS: dict[str, Collection] = {
    collection.prefix: collection for collection in (synthetic.COLLECTION, tum_download.COLLECTION)
}


def formats() -> tuple[Format, ...]:
    """Return the formats that folders are recognised by, in the order in which they are asked."""
    return tuple(_FORMATS)


def names() -> tuple[str, ...]:
    """Return every name that `open_sequence` knows beside folders."""
    return tuple(name for collection in _COLLECTIONS.values() for name in collection.names)


def register_format(new: Format) -> None:
    """Make a layout of folders known; it is asked before those that came with the package.

    One of the same name is replaced.
    """
    _FORMATS[:] = [new, *(known for known in _FORMATS if known.name != new.name)]


def register_collection(new: Collection) -> None:
    """Make named sequences known; a collection of the same prefix is replaced."""
    _COLLECTIONS[new.prefix] = new


def open_sequence(source: str | os.PathLike[str], *, progress: Progress | None = None) -> Sequence:
    """Open a recording: what `open_dataset` opens, but for lists of pairs.

    Raises
    ------
    InputError
        As `open_dataset`; a list of pairs.
    MissingDependencyError
        A download without pooch.
    """
    found = open_dataset(source, progress=progress)
    if isinstance(found, PairSet):
        raise InputError(
            f"{source}: a list of pairs ({found.format}), expected a sequence of frames; open it "
            "with hmrf_icp.datasets.open_dataset"
        )
    return found


def open_dataset(
    source: str | os.PathLike[str], *, progress: Progress | None = None
) -> Sequence | PairSet:
    """Open a recording, or a data set that lists its pairs.

    Parameters
    ----------
    source
        A folder, whose format is recognised by what is in it, or a name:
        ``synthetic``, ``synthetic:tabletop``, ``tum:freiburg1_desk`` (downloaded into the
        user's cache the first time) and the others of `names`. A folder that is called
        like a name is meant by ``./NAME``.
    progress
        Told of downloads: what is being done, bytes done, bytes in all or None.

    Raises
    ------
    InputError
        Neither a folder nor a name; a folder of no known format (the message
        lists those, and what was found); files missing, malformed or in
        contradiction; fewer than two usable frames; no connection.
    MissingDependencyError
        A download without pooch.
    """
    if isinstance(source, str):
        prefix, colon, member = source.partition(":")
        collection = _COLLECTIONS.get(prefix)
        if collection is not None:
            return _open_named(
                collection, source, member if colon else collection.default, progress
            )
    from hmrf_icp.io.files import is_folder

    try:
        folder = Path(os.path.abspath(Path(source).expanduser()))  # noqa: PTH100 (keeps symlinks)
    except RuntimeError as error:  # nobody has that name
        raise InputError(f"{source}: no such folder: {error}") from None
    if is_folder(folder):
        return _open_folder(folder)
    if os.path.exists(folder):  # noqa: PTH110 (False for a name that nothing can have)
        raise InputError(f"{source}: a file, expected a sequence's folder; unpack an archive first")
    raise InputError(f"{source}: no such folder, nor a name; names are {', '.join(names())}")


def _open_named(
    collection: Collection, name: str, member: str | None, progress: Progress | None
) -> Sequence:
    if member is not None:
        member = collection.aliases.get(member, member)
    if member is None or member not in collection.members:
        raise InputError(f"{name}: no such sequence; known are {', '.join(collection.names)}")
    return collection.open(member, progress)


def _open_folder(folder: Path) -> Sequence | PairSet:
    found = describe(folder)
    for known in _FORMATS:
        if known.recognises(folder):
            return known.open(folder)
    inside = [
        f"{path.name}/ looks like {known.name}"
        for path in sorted(folder.iterdir())
        if path.is_dir()
        for known in _FORMATS
        if known.recognises(path)
    ]
    hint = f"; {', '.join(inside[:4])}: open that instead" if inside else ""
    raise InputError(
        f"{folder}: not a format that is known.\n"
        f"Found: {found}{hint}.\n"
        "Known: " + "; ".join(f"{known.name} ({known.layout})" for known in _FORMATS) + "."
    )
