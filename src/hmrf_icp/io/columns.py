"""From the named columns of a file to a cloud with all that it has, and back.

Three columns that are called as normals are in PLY (``nx``) or in PCD
(``normal_x``) become the cloud's normals; every other column beside x, y and z becomes an
attribute. A colour is packed into one number in PCD and stands in three columns elsewhere: the two
are exchanged, so that it stays a colour in whatever is written.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.cloud import PointCloud

AXES = ("x", "y", "z")
PLY_NORMALS = ("nx", "ny", "nz")
PCD_NORMALS = ("normal_x", "normal_y", "normal_z")
RED_GREEN_BLUE = ("red", "green", "blue")

Columns = dict[str, NDArray[Any]]


def cloud_of(
    points: NDArray[Any],
    columns: Mapping[str, NDArray[Any]],
    viewpoint: NDArray[np.float64] | None = None,
) -> PointCloud:
    """Make a cloud of points, (H, W, 3) or (N, 3), and of columns of the same shape by name."""
    rest = dict(columns)
    normals = None
    for names in (PLY_NORMALS, PCD_NORMALS):
        if normals is None and all(n in rest and rest[n].ndim == points.ndim - 1 for n in names):
            normals = np.stack([rest.pop(name) for name in names], axis=-1)
    return PointCloud(points, None, viewpoint, normals, rest)


def columns_of(cloud: PointCloud, normals: Iterable[str]) -> Columns:
    """Return everything of a cloud beside the coordinates, in its shape; normals by these names.

    Attributes that would be taken for a coordinate or a normal when they are read back get
    a name of their own.
    """
    columns: Columns = {}
    if cloud.normals is not None:
        for axis, name in enumerate(normals):
            columns[name] = cloud.normals[..., axis]
    names = Names((*AXES, *(PLY_NORMALS + PCD_NORMALS if columns else ())))
    for name, values in cloud.attributes.items():
        columns[names.free(name)] = values
    return columns


def one_number_a_column(columns: Mapping[str, NDArray[Any]], dimensions: int) -> Columns:
    """Split columns of several numbers a point into columns of one."""
    flat: Columns = {}
    names = Names()
    for name, values in columns.items():
        if values.ndim == dimensions:
            flat[names.free(name)] = values
        else:
            for place in range(values.shape[-1]):
                flat[names.free(f"{name}_{place}")] = values[..., place]
    return flat


class Names:
    """Names of columns that a header can hold, each given once."""

    def __init__(self, taken: Iterable[str] = ()) -> None:
        self._taken = set(taken)
        self._next: dict[str, int] = {}

    def free(self, name: str) -> str:
        """Return the name in letters, digits and a few marks; with a number if it is taken."""
        plain = re.sub(r"[^A-Za-z0-9_.:\[\]()-]+", "_", name)
        if not plain.strip("_"):
            plain = "unnamed"  # "_" is a gap between the fields of a PCD
        found, number = plain, self._next.get(plain, 2)
        while found in self._taken:
            found, number = f"{plain}_{number}", number + 1
        self._next[plain] = number  # where the next of that name goes on looking
        self._taken.add(found)
        return found


def unpacked_colours(columns: Mapping[str, NDArray[Any]]) -> Columns:
    """Replace PCD's ``rgb`` or ``rgba``, four bytes in one number, by red, green and blue."""
    result: Columns = {}
    for name, values in columns.items():
        packed = name in ("rgb", "rgba") and values.dtype.itemsize == 4 and values.dtype.kind != "b"
        if not packed or any(colour in columns for colour in RED_GREEN_BLUE):
            result[name] = values
            continue
        bits = np.ascontiguousarray(values).view(np.uint32)
        for place, colour in enumerate(RED_GREEN_BLUE):
            result[colour] = (bits >> (16 - 8 * place) & 255).astype(np.uint8)
        if name == "rgba":
            result["alpha"] = (bits >> 24).astype(np.uint8)
    return result


def packed_colours(columns: Mapping[str, NDArray[Any]]) -> Columns:
    """Replace red, green and blue of one byte each by the ``rgb`` that readers of PCD know."""
    colours = [columns.get(name) for name in RED_GREEN_BLUE]
    if any(colour is None or colour.dtype != np.uint8 for colour in colours) or "rgb" in columns:
        return dict(columns)
    red, green, blue = (np.asarray(colour).astype(np.uint32) for colour in colours)
    if not red.shape == green.shape == blue.shape:
        return dict(columns)
    result = {name: values for name, values in columns.items() if name not in RED_GREEN_BLUE}
    result["rgb"] = (red << 16 | green << 8 | blue).view(np.float32)
    return result


def bytes_of_colours(columns: Mapping[str, NDArray[Any]]) -> Columns:
    """Give colours that are whole numbers from 0 to 255 the type that says they are colours."""
    result = dict(columns)
    colours = [result.get(name) for name in RED_GREEN_BLUE]
    if all(
        each is not None
        and each.dtype.kind in "iu"
        and (not each.size or (each.min() >= 0 and each.max() <= 255))
        for each in colours
    ):
        for name in RED_GREEN_BLUE:
            result[name] = result[name].astype(np.uint8)
    return result


def storable(values: NDArray[Any]) -> NDArray[Any]:
    """Give numbers a type that PLY and PCD have: integers up to 32 bits, floats of 32 and 64."""
    kind, size = values.dtype.kind, values.dtype.itemsize
    if kind == "b":
        return values.astype(np.uint8)
    if kind == "f":
        return values.astype(np.float32 if size <= 4 else np.float64)
    if size <= 4:
        return values
    fits = not values.size or (values.min() >= -(2**31) and values.max() < 2**31)
    return values.astype(np.int32 if fits else np.float64)
