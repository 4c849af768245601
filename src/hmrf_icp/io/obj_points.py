"""OBJ without faces: a cloud of vertices, with colours and normals."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.errors import InputError
from hmrf_icp.io.columns import RED_GREEN_BLUE, Columns, columns_of, unpacked_colours

_FACE = re.compile(rb"^[ \t]*f[ \t]", re.M)


def has_faces(data: bytes) -> bool:
    """Whether an OBJ file holds a mesh."""
    return _FACE.search(data) is not None


def read_obj_points(path: Path, data: bytes) -> PointCloud:
    """Read the vertices; three numbers behind the coordinates are a colour, from 0 to 1 or to 255.

    Normals are taken where there are as many as vertices.

    Raises
    ------
    InputError
        No vertices, or a line that is no numbers (the message has its number).
    """
    rows: dict[str, list[list[float]]] = {"v": [], "vn": []}
    for number, line in enumerate(data.decode("utf-8", "replace").splitlines(), 1):
        words = line.split()
        if not words or words[0] not in rows:
            continue
        try:
            numbers = [float(word) for word in words[1:]]
        except ValueError:
            numbers = []
        if len(numbers) < 3:
            raise InputError(
                f"{path}: line {number} should hold three numbers or more behind "
                f"{words[0]!r}, found {line.strip()[:60]!r}"
            )
        rows[words[0]].append(numbers)
    if not rows["v"]:
        raise InputError(f"{path}: no vertices in it")
    points = np.array([row[:3] for row in rows["v"]])
    attributes: Columns = {}
    widths = {len(row) for row in rows["v"]}
    if widths <= {6, 7}:
        colours = np.array([row[-3:] for row in rows["v"]])
        attributes = _bytes(colours)
    normals = None
    if len(rows["vn"]) == len(points):
        normals = np.array([row[:3] for row in rows["vn"]])
    return PointCloud(points, None, None, normals, attributes)


def write_obj(path: Path, cloud: PointCloud) -> None:
    """Write the observed points as vertices, with colours from 0 to 1 and normals."""
    columns = [cloud.observed_points]
    held = unpacked_colours(columns_of(cloud, ()))
    colours = [held.get(name) for name in RED_GREEN_BLUE]
    if all(each is not None and each.dtype == np.uint8 for each in colours):
        seen = [each[cloud.observed] for each in colours if each is not None]
        if all(each.ndim == 1 for each in seen):
            columns.append(np.stack(seen, axis=-1) / 255.0)
    lines = _lines("v", np.concatenate(columns, axis=1))
    if cloud.normals is not None:
        lines += _lines("vn", cloud.normals[cloud.observed])
    with path.open("w", encoding="ascii", newline="\n") as stream:
        stream.writelines(lines)


def _lines(word: str, values: NDArray[np.float64]) -> list[str]:
    return [f"{word} {' '.join(map(repr, row))}\n" for row in values.tolist()]


def _bytes(colours: NDArray[np.float64]) -> Columns:
    if not np.isfinite(colours).all() or colours.min() < 0.0 or colours.max() > 255.0:
        return {}
    scale = 255.0 if colours.max() <= 1.0 else 1.0
    whole = np.rint(colours * scale).astype(np.uint8)
    return {name: whole[:, place] for place, name in enumerate(RED_GREEN_BLUE)}
