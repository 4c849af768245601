"""PLY, ASCII and binary, through plyfile."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.cloud import PointCloud
from hmrf_icp.errors import InputError
from hmrf_icp.io.files import quietly, reading


def read_ply(path: Path) -> PointCloud:
    """Read x, y and z of the vertices.

    A range scan in the form of the Stanford archive (an element ``range_grid``
    that lists the vertex of each pixel) comes out organised.

    Raises
    ------
    InputError
        Not a PLY file, without vertices of x, y and z, or with fewer than it promises.
    """
    from plyfile import PlyData, PlyElementParseError

    with reading(path, "a PLY file"), quietly():
        try:
            ply = PlyData.read(str(path))
        except PlyElementParseError as error:
            element = error.element
            if element is None or error.message != "early end-of-file":
                raise
            found = "fewer" if error.row is None else error.row
            raise InputError(
                f"{path}: cut short: the PLY header promises {element.count} of element "
                f"{element.name!r}, the file holds {found}"
            ) from None
        if "vertex" not in ply:
            raise InputError(f"{path}: the PLY file has no element 'vertex'")
        vertices = ply["vertex"].data
        names = vertices.dtype.names or ()
        if any(axis not in names or vertices.dtype[axis].kind not in "iuf" for axis in "xyz"):
            raise InputError(
                f"{path}: the PLY vertices need the numbers x, y and z, found {', '.join(names)}"
            )
        points = np.stack([vertices[axis].astype(np.float64) for axis in "xyz"], axis=-1)
        if "range_grid" in ply:
            points = _on_range_grid(path, ply, points)
        return PointCloud(points)


def write_ply(path: Path, cloud: PointCloud) -> None:
    """Write the observed points, binary and in double precision.

    PLY has no grid that other programs read, and several choke on NaN.
    """
    from plyfile import PlyData, PlyElement

    vertices = np.empty(len(cloud), dtype=[("x", "<f8"), ("y", "<f8"), ("z", "<f8")])
    for axis, values in zip("xyz", cloud.observed_points.T, strict=True):
        vertices[axis] = values
    PlyData([PlyElement.describe(vertices, "vertex")], byte_order="<").write(str(path))


def _on_range_grid(path: Path, ply: Any, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Lay the vertices out on the pixels that list them."""
    words = [line.split() for line in (*ply.obj_info, *ply.comments)]
    size = {w[0]: int(w[1]) for w in words if len(w) == 2 and w[0] in ("num_cols", "num_rows")}
    cells = ply["range_grid"].data["vertex_indices"]
    if len(size) != 2 or size["num_cols"] * size["num_rows"] != len(cells):
        raise InputError(
            f"{path}: the PLY range grid has {len(cells)} cells, its obj_info says "
            + (" x ".join(str(n) for n in size.values()) or "no size (num_cols, num_rows)")
        )
    grid = np.full((len(cells), 3), np.nan)
    seen = np.array([len(cell) > 0 for cell in cells], dtype=bool)
    indices = np.array([int(cell[0]) for cell in cells if len(cell)], dtype=np.int64)
    if indices.size and (indices.min() < 0 or indices.max() >= len(points)):
        raise InputError(f"{path}: the PLY range grid lists vertices that are not in the file")
    grid[seen] = points[indices]
    return grid.reshape(size["num_rows"], size["num_cols"], 3)
