"""The faces of a PLY file as triangles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.errors import InputError
from hmrf_icp.io.ply_body import Column


def triangles(path: Path, lists: Column) -> NDArray[np.int64]:
    """Cut polygons into fans of triangles (F, 3) about their first corner.

    Points and edges, lists of one or two vertices, are left out.

    Raises
    ------
    InputError
        A number is not the row of any vertex.
    """
    values, lengths = lists.values, lists.lengths
    if lengths is None:
        raise InputError(f"{path}: the PLY faces need lists of their vertices")
    if values.size and not (np.isfinite(values).all() and (np.abs(values) < 2**62).all()):
        raise InputError(f"{path}: a PLY face lists what is no number of a vertex")
    corners = values.astype(np.int64)
    first = np.cumsum(lengths) - lengths
    fan = np.maximum(lengths - 2, 0)
    # Of each triangle: where its polygon starts, and how many of that polygon went before it.
    start = np.repeat(first, fan)
    place = np.arange(len(start)) - np.repeat(np.cumsum(fan) - fan, fan)
    return np.stack(
        [corners[start], corners[start + place + 1], corners[start + place + 2]], axis=-1
    )
