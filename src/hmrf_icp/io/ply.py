"""PLY, ASCII and binary.

Read and written here: the package for them, plyfile, is under the GPL (version
3 or later), which every program that depends on this library would have to
take over. `ply_header` and `ply_body` read the format; here its vertices become a cloud, and a
cloud vertices.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.errors import InputError
from hmrf_icp.io.columns import (
    AXES,
    PLY_NORMALS,
    Columns,
    cloud_of,
    columns_of,
    one_number_a_column,
    storable,
    unpacked_colours,
)
from hmrf_icp.io.files import reading
from hmrf_icp.io.mesh import cloud_of_mesh
from hmrf_icp.io.ply_body import Column, read_columns
from hmrf_icp.io.ply_faces import triangles
from hmrf_icp.io.ply_header import TYPE_NAMES, Header, parse_header

_CELLS = "vertex_indices"
_FACES = ("vertex_indices", "vertex_index")
_SHOWN = 20
"""Names in a message, at most."""


def read_ply(path: Path, samples: int | None = None) -> PointCloud:
    """Read the vertices, x, y and z and every other number of theirs, or points on the faces.

    A range scan in the form of the Stanford archive (an element ``range_grid``
    that lists the vertex of each pixel) comes out organised.

    Parameters
    ----------
    path
        The file.
    samples
        Where there are faces: points that are spread over them, as `read_mesh` does. 0 takes the
        vertices and steps over the faces.

    Raises
    ------
    InputError
        Not a PLY file, malformed (with the number of the line), without
        vertices of x, y and z, or with fewer of anything than it promises.
    """
    with reading(path, "a PLY file"):
        data = path.read_bytes()
        header = parse_header(path, data)
        _require_coordinates(path, header)
        single = frozenset(
            each.name for each in header.elements["vertex"].properties if each.length is None
        )
        wanted = {"vertex": single, "range_grid": {_CELLS}}
        if samples != 0 and "range_grid" not in header.elements:
            wanted["face"] = frozenset(_FACES)
        columns = read_columns(path, header, data, wanted)
        points = np.empty((header.elements["vertex"].count, 3))
        rest = {name: column.values for name, column in columns["vertex"].items()}
        # A NaN that signals is as good as any other.
        with np.errstate(invalid="ignore"):
            for axis, name in enumerate(AXES):
                points[:, axis] = rest.pop(name)
            # In the machine's own order of bytes, which is all that some libraries take.
            rest = {
                name: values.astype(values.dtype.newbyteorder("=")) for name, values in rest.items()
            }
        if "range_grid" in columns:
            cells = columns["range_grid"].get(_CELLS)
            points, rest = _on_range_grid(path, header, cells, points, rest)
        lists = next((columns["face"][n] for n in _FACES if n in columns.get("face", ())), None)
        faces = np.empty((0, 3), np.int64) if lists is None else triangles(path, lists)
        if len(faces):
            return cloud_of_mesh(path, points, faces, rest, samples)
        return cloud_of(points, rest)


def write_ply(path: Path, cloud: PointCloud) -> None:
    """Write the observed points, binary and in double precision, with all that they have.

    PLY has no grid that other programs read, and several choke on NaN.
    """
    columns: Columns = dict(zip(AXES, np.moveaxis(cloud.points, -1, 0), strict=True))
    others = unpacked_colours(columns_of(cloud, PLY_NORMALS))
    columns |= one_number_a_column(others, len(cloud.shape))
    columns = {name: storable(values[cloud.observed]) for name, values in columns.items()}
    kinds = {name: values.dtype.newbyteorder("<") for name, values in columns.items()}
    table = np.empty(len(cloud), dtype=list(kinds.items()))
    for name, values in columns.items():
        table[name] = values
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(table)}",
        *(f"property {TYPE_NAMES[kind.str[1:]]} {name}" for name, kind in kinds.items()),
        "end_header",
    ]
    path.write_bytes(("\n".join(lines) + "\n").encode("ascii") + table.tobytes())


def _require_coordinates(path: Path, header: Header) -> None:
    if "vertex" not in header.elements:
        found = ", ".join(repr(name) for name in header.elements) or "no element at all"
        raise InputError(f"{path}: the PLY file has no element 'vertex', found {found}")
    properties = header.elements["vertex"].properties
    numbers = [each.name for each in properties if each.length is None]
    if any(axis not in numbers for axis in AXES):
        found = ", ".join(
            each.name if each.length is None else f"a list {each.name}"
            for each in properties[:_SHOWN]
        )
        if len(properties) > _SHOWN:
            found += f" and {len(properties) - _SHOWN} more"
        raise InputError(
            f"{path}: the PLY vertices need the numbers x, y and z, found {found or 'none'}"
        )


def _on_range_grid(
    path: Path,
    header: Header,
    cells: Column | None,
    points: NDArray[np.float64],
    columns: Columns,
) -> tuple[NDArray[np.float64], Columns]:
    """Lay the vertices and their columns out on the pixels that list them."""
    if cells is None or cells.lengths is None:
        raise InputError(f"{path}: the PLY range grid needs lists called {_CELLS!r}")
    size = {
        words[0]: int(words[1])
        for words in header.notes
        if len(words) == 2 and words[0] in ("num_cols", "num_rows") and words[1].isdecimal()
    }
    width, height = size.get("num_cols", 0), size.get("num_rows", 0)
    if width * height != len(cells.lengths):
        raise InputError(
            f"{path}: the PLY range grid has {len(cells.lengths)} cells, its obj_info says "
            + (f"{width} x {height}" if len(size) == 2 else "no size (num_cols, num_rows)")
        )
    seen = cells.lengths > 0
    first = (np.cumsum(cells.lengths) - cells.lengths)[seen]
    listed = cells.values[first]
    if not ((listed >= 0) & (listed < len(points))).all():  # nor is NaN, if they are such numbers
        raise InputError(f"{path}: the PLY range grid lists vertices that are not in the file")
    indices = listed.astype(np.int64)

    def laid(values: NDArray[Any]) -> NDArray[Any]:
        fill = np.nan if values.dtype.kind == "f" else 0
        grid = np.full((len(seen), *values.shape[1:]), fill, values.dtype)
        grid[seen] = values[indices]
        return grid.reshape(height, width, *values.shape[1:])

    return laid(points), {name: laid(values) for name, values in columns.items()}
