"""PLY, ASCII and binary.

Read and written here: the package for them, plyfile, is under the GPL (version
3 or later), which every program that depends on this library would have to
take over. `ply_header` and `ply_body` read the format; here its vertices become a cloud.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.errors import InputError
from hmrf_icp.io.files import reading
from hmrf_icp.io.ply_body import Column, read_columns
from hmrf_icp.io.ply_header import Header, parse_header

_AXES = ("x", "y", "z")
_CELLS = "vertex_indices"
_WANTED = {"vertex": _AXES, "range_grid": (_CELLS,)}


def read_ply(path: Path) -> PointCloud:
    """Read x, y and z of the vertices; all else, such as faces and colours, is stepped over.

    A range scan in the form of the Stanford archive (an element ``range_grid``
    that lists the vertex of each pixel) comes out organised.

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
        columns = read_columns(path, header, data, _WANTED)
        points = np.empty((header.elements["vertex"].count, 3))
        # A NaN that signals is as good as any other.
        with np.errstate(invalid="ignore"):
            for axis, name in enumerate(_AXES):
                points[:, axis] = columns["vertex"][name].values
        if "range_grid" in columns:
            points = _on_range_grid(path, header, columns["range_grid"].get(_CELLS), points)
        return PointCloud(points)


def write_ply(path: Path, cloud: PointCloud) -> None:
    """Write the observed points, binary and in double precision.

    PLY has no grid that other programs read, and several choke on NaN.
    """
    points = cloud.observed_points
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(points)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        "end_header\n"
    )
    path.write_bytes(header.encode("ascii") + points.astype("<f8").tobytes())


def _require_coordinates(path: Path, header: Header) -> None:
    if "vertex" not in header.elements:
        found = ", ".join(repr(name) for name in header.elements) or "no element at all"
        raise InputError(f"{path}: the PLY file has no element 'vertex', found {found}")
    properties = header.elements["vertex"].properties
    numbers = [each.name for each in properties if each.length is None]
    if any(axis not in numbers for axis in _AXES):
        found = ", ".join(
            each.name if each.length is None else f"a list {each.name}" for each in properties
        )
        raise InputError(
            f"{path}: the PLY vertices need the numbers x, y and z, found {found or 'none'}"
        )


def _on_range_grid(
    path: Path, header: Header, cells: Column | None, points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Lay the vertices out on the pixels that list them."""
    if cells is None or cells.lengths is None:
        raise InputError(f"{path}: the PLY range grid needs lists called {_CELLS!r}")
    size = {
        words[0]: int(words[1])
        for words in header.notes
        if len(words) == 2 and words[0] in ("num_cols", "num_rows") and words[1].isdecimal()
    }
    columns, rows = size.get("num_cols", 0), size.get("num_rows", 0)
    if columns * rows != len(cells.lengths):
        raise InputError(
            f"{path}: the PLY range grid has {len(cells.lengths)} cells, its obj_info says "
            + (f"{columns} x {rows}" if len(size) == 2 else "no size (num_cols, num_rows)")
        )
    seen = cells.lengths > 0
    first = (np.cumsum(cells.lengths) - cells.lengths)[seen]
    indices = cells.values[first].astype(np.int64)
    if indices.size and (indices.min() < 0 or indices.max() >= len(points)):
        raise InputError(f"{path}: the PLY range grid lists vertices that are not in the file")
    grid = np.full((len(cells.lengths), 3), np.nan)
    grid[seen] = points[indices]
    return grid.reshape(rows, columns, 3)
