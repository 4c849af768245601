"""The chunks of a LAZ file, walked before a library makes room for what they promise."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import IO

from hmrf_icp.errors import InputError

_LAYERED = 3
"""LASzip's number of the way in which each chunk tells how long its layers are."""

_LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}
"""Layers of each kind of item; one of bytes (14) has as many as it has bytes."""

_BYTES = 14


def check_chunks(path: Path, stream: IO[bytes], start: int, count: int, described: bytes) -> None:
    """Refuse a table of chunks, or layers of one, that the file cannot hold.

    Parameters
    ----------
    path, stream
        The file, open.
    start
        Where its points begin.
    count
        Points that it promises.
    described
        LASzip's record of how they are packed.

    Raises
    ------
    InputError
        The file is cut short or damaged.
    """
    if not count:
        return
    size = path.stat().st_size
    table = _table(path, stream, start, size)
    stream.seek(table + 4)
    (chunks,) = struct.unpack("<I", stream.read(4))
    if chunks > min(count, size):
        raise InputError(f"{path}: damaged: {chunks:,} chunks of {count:,} points promised")
    if len(described) < 34:
        raise InputError(f"{path}: damaged: it does not say how its points are packed")
    (compressor,) = struct.unpack_from("<H", described)
    if compressor != _LAYERED:
        return
    (items,) = struct.unpack_from("<H", described, 32)
    if len(described) < 34 + 6 * items:
        raise InputError(f"{path}: damaged: {items} kinds of values promised")
    kinds = [struct.unpack_from("<HHH", described, 34 + 6 * each) for each in range(items)]
    point = sum(length for _, length, _ in kinds)
    layers = sum(length if kind == _BYTES else _LAYERS.get(kind, 0) for kind, length, _ in kinds)
    at = start + 8
    while at < table:
        stream.seek(at + point)
        head = stream.read(4 + 4 * layers)
        if len(head) < 4 + 4 * layers:
            break
        # The first point as it is, the number of points, the length of each layer, and these.
        at += point + len(head) + sum(struct.unpack_from(f"<{layers}I", head, 4))
    if at != table:
        raise InputError(f"{path}: cut short or damaged: its chunks do not end where they should")


def _table(path: Path, stream: IO[bytes], start: int, size: int) -> int:
    """Byte at which the table of chunks begins."""
    stream.seek(start)
    place = stream.read(8)
    if len(place) < 8:
        raise InputError(f"{path}: cut short: it ends where the points should begin")
    (table,) = struct.unpack("<q", place)
    if table == -1:  # written by what could not go back: it stands at the end
        stream.seek(size - 8)
        (table,) = struct.unpack("<q", stream.read(8))
    if not start + 8 <= table <= size - 8:
        raise InputError(f"{path}: cut short or damaged: its table of chunks is not in the file")
    return int(table)
