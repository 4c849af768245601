"""Points spread evenly over the triangles of a mesh, the same ones every time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.errors import InputError

Array = NDArray[np.float64]

SAMPLES = 100_000
"""Points that a mesh is made into unless it is said: five times what registration looks at."""

FEWEST_VERTICES = 5_000
"""Vertices that are enough to stand for the surface themselves."""

SPARSE = 3.0
"""Edges of a triangle that are longer than this, in spacings that the vertices would have if they
were spread evenly, make it one that they do not stand for."""

GOLDEN = 0.7548776662466927, 0.5698402909980532
"""Steps of the sequence that fills a square most evenly (R2, after the plastic number)."""

CELLS = 10
"""Bits of a coordinate that triangles are put in order by."""


def vertices_suffice(vertices: Array, faces: NDArray[np.int64]) -> bool:
    """Whether the vertices (V, 3) stand for the surface about as well as points spread over it.

    Those of a scan do. Those of a drawing stand at its corners.

    Parameters
    ----------
    vertices, faces
        (V, 3) and (F, 3), rows of vertices.
    """
    if len(vertices) < FEWEST_VERTICES:
        return False
    corners = vertices[faces]
    sides = corners - np.roll(corners, 1, axis=1)
    longest = np.sqrt((sides**2).sum(axis=2).max(axis=1))
    area = _areas(corners)[1]
    total = float(np.nansum(area))
    spacing = np.sqrt(total / len(vertices))
    return bool(np.nansum(area[longest > SPARSE * spacing]) <= 0.5 * total)


def sampled_surface(
    vertices: Array,
    faces: NDArray[np.int64],
    count: int = SAMPLES,
    columns: Mapping[str, NDArray[Any]] | None = None,
) -> PointCloud:
    """Spread points over a surface, as many to each part as its area is worth.

    Triangles are walked in the order of a curve that fills space, and a point is put down
    whenever the same area has gone by: no seed, no chance, and more even than chance. A
    triangle with several points has them spread by a sequence that leaves no gaps.

    Parameters
    ----------
    vertices
        (V, 3), metres or what the file has.
    faces
        (F, 3) rows of vertices, counter-clockwise seen from outside.
    count
        Points.
    columns
        Values by vertex, (V,) or (V, k): floats and bytes are interpolated, of other
        whole numbers that of the nearest vertex is taken.

    Returns
    -------
    A cloud of ``count`` points with the normals of their triangles.

    Raises
    ------
    InputError
        A face names a vertex that is not there, or the surface has no area.
    """
    if len(faces) and not (faces.min() >= 0 and faces.max() < len(vertices)):
        raise InputError(f"a face lists vertices that are not among the {len(vertices):,}")
    if count < 1:
        raise InputError(f"samples: expected 1 point or more, got {count}")
    normals, area = _areas(vertices[faces])
    whole = np.isfinite(area) & (area > 0.0)
    faces, normals, area = faces[whole], normals[whole], area[whole]
    total = float(area.sum())
    if not len(faces) or not np.isfinite(total) or not total > 0.0:
        raise InputError("a mesh without a face that has an area")
    order = _along_curve(vertices[faces].mean(axis=1))
    passed = np.cumsum(area[order])
    marks = (np.arange(count) + 0.5) * (passed[-1] / count)
    rows = order[np.minimum(np.searchsorted(passed, marks), len(order) - 1)]
    a, b = ((0.5 + step * np.arange(count)) % 1.0 for step in GOLDEN)
    # The square is folded onto the triangle, which keeps areas.
    over = a + b > 1.0
    a, b = np.where(over, 1.0 - a, a), np.where(over, 1.0 - b, b)
    weights = np.stack([1.0 - a - b, a, b], axis=1)
    corners = faces[rows]
    points = np.einsum("nk,nkd->nd", weights, vertices[corners])
    attributes = {
        name: _at_samples(values, corners, weights) for name, values in (columns or {}).items()
    }
    return PointCloud(points, normals=normals[rows], attributes=attributes)


def _areas(corners: Array) -> tuple[Array, Array]:
    """Return normals of unit length (F, 3) and areas (F,) of triangles (F, 3, 3)."""
    with np.errstate(all="ignore"):
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        double = np.linalg.norm(across, axis=1)
        return across / np.where(double > 0.0, double, 1.0)[:, None], 0.5 * double


def _along_curve(centres: Array) -> NDArray[np.int64]:
    """Order (F,) in which places that are near each other are near each other."""
    low = centres.min(axis=0)
    top = (1 << CELLS) - 1
    with np.errstate(all="ignore"):  # a mesh as large as numbers get keeps its order
        side = float((centres.max(axis=0) - low).max())
        cells = (centres - low) * (top / side if side > 0.0 else 0.0)
    cells = np.clip(np.nan_to_num(cells), 0, top).astype(np.int64)
    key = np.zeros(len(centres), np.int64)
    for bit in range(CELLS):
        for axis in range(3):
            key |= (cells[:, axis] >> bit & 1) << (3 * bit + axis)
    return np.argsort(key, kind="stable")


def _at_samples(values: NDArray[Any], corners: NDArray[np.int64], weights: Array) -> NDArray[Any]:
    floating, colour = values.dtype.kind == "f", values.dtype == np.uint8
    if not (floating or colour):
        nearest = np.take_along_axis(corners, weights.argmax(axis=1)[:, None], axis=1)[:, 0]
        taken: NDArray[Any] = values[nearest]
        return taken
    mixed = np.asarray(np.einsum("nk,nk...->n...", weights, values[corners].astype(np.float64)))
    return (np.rint(mixed) if colour else mixed).astype(values.dtype)
