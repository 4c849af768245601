"""What an E57 file says of itself, looked at before a library in C++ believes it."""

from __future__ import annotations

import re
import struct
from pathlib import Path

from hmrf_icp.errors import InputError

PAGE, CHECKED = 1024, 1020
"""Bytes of a page, and those of them that are not its checksum."""

DEEPEST = 64
"""Elements inside each other; a scan's are eight deep."""

_SIGNATURE = b"ASTM-E57"
_TAG = re.compile(rb"<(/?)[A-Za-z_][^<>]*?(/?)>")


def check_outline(path: Path) -> None:
    """Refuse what is cut short, or whose description could fill memory or stack.

    Raises
    ------
    InputError
        No E57 file, lengths that are not the file's, entities, or elements nested deep.
    """
    size = path.stat().st_size
    with path.open("rb") as stream:
        head = stream.read(48)
        if head[:8] != _SIGNATURE:
            raise InputError(f"{path}: not an E57 file, its first bytes are {head[:8]!r}")
        if len(head) < 48:
            raise InputError(f"{path}: cut short: a header of {len(head)} bytes")
        length, start, described, page = struct.unpack_from("<QQQQ", head, 16)
        if page != PAGE or length != size or size % PAGE:
            raise InputError(
                f"{path}: cut short or damaged: {length:,} bytes in pages of {page:,} promised, "
                f"{size:,} bytes found"
            )
        if not 48 <= start < size or described > size:
            raise InputError(f"{path}: damaged: its description is not in the file")
        stream.seek(start - start % PAGE)
        pages = stream.read((start % PAGE + described) * PAGE // CHECKED + 2 * PAGE)
    logical = b"".join(pages[at : at + CHECKED] for at in range(0, len(pages), PAGE))
    text = logical[start % PAGE : start % PAGE + described]
    if b"\0" in text or re.search(rb"<!(?:DOCTYPE|ENTITY)|encoding=.UTF-16", text, re.I):
        raise InputError(f"{path}: its description has entities or is not UTF-8; no scanner's has")
    # What stands in character data is no element.
    bare = re.sub(rb"<!\[CDATA\[.*?\]\]>", b"", text, flags=re.S)
    depth = 0
    for closing, empty in _TAG.findall(bare):
        depth += -1 if closing else 0 if empty else 1
        if depth > DEEPEST:
            raise InputError(f"{path}: damaged: its description is nested deeper than {DEEPEST}")
