"""What a GLB file promises, looked at before a library makes room for it."""

from __future__ import annotations

import json
import math
import struct
from pathlib import Path
from typing import Any

from hmrf_icp.errors import InputError
from hmrf_icp.io.files import require_bounded

_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_NUMBERS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_DEEPEST = 200
"""Nodes inside each other."""


def check_glb(path: Path, data: bytes) -> None:
    """Refuse what is no GLB of version 2, cut short, packed, or promises more than there is.

    Raises
    ------
    InputError
        One of these.
    """
    if data[:4] != b"glTF" or len(data) < 20:
        raise InputError(f"{path}: not a GLB file, its first bytes are {data[:8]!r}")
    version, length, described, kind = struct.unpack_from("<III4s", data, 4)
    if version != 2 or kind != b"JSON":
        raise InputError(f"{path}: GLB of version {version}, expected 2")
    if length > len(data) or 20 + described > len(data):
        raise InputError(f"{path}: cut short: {length:,} bytes promised, {len(data):,} found")
    content: Any = json.loads(data[20 : 20 + described])
    packed = [
        name
        for name in [*content.get("extensionsRequired", ())]
        if "compression" in str(name) or "meshopt" in str(name)
    ]
    if packed:
        raise InputError(f"{path}: a mesh packed by {packed[0]}; write it without compression")
    total = 0
    for accessor in content.get("accessors", ()):
        count = int(accessor["count"])
        if count < 0:
            raise InputError(f"{path}: damaged: {count} entries promised")
        total += count * _BYTES[accessor["componentType"]] * _NUMBERS[accessor["type"]]
    require_bounded(path, len(data), total)
    if any("uri" in buffer for buffer in content.get("buffers", ())):
        raise InputError(f"{path}: its data is in another file; write it as one GLB")
    _check_nodes(path, content.get("nodes", ()))


def _check_nodes(path: Path, nodes: Any) -> None:
    """Refuse nodes with two parents, or that are inside each other without an end."""
    children = [[int(child) for child in node.get("children", ())] for node in nodes]
    parents = [-1] * len(children)
    for place, inside in enumerate(children):
        for child in inside:
            if not 0 <= child < len(children) or parents[child] >= 0:
                raise InputError(f"{path}: damaged: node {child} is missing or has two parents")
            parents[child] = place
    depth = [math.inf] * len(children)
    level = [place for place, parent in enumerate(parents) if parent < 0]
    for number in range(_DEEPEST):
        for place in level:
            depth[place] = number
        level = [child for place in level for child in children[place]]
    if any(math.isinf(each) for each in depth):
        raise InputError(f"{path}: damaged: its nodes are nested deeper than {_DEEPEST}")
