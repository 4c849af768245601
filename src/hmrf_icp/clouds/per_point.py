"""What a cloud holds for each point beside coordinates: normals, colours, intensities."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmrf_icp.errors import InputError


class Attributes(Mapping[str, NDArray[Any]]):
    """Arrays by name, one value (or several) a point, that travel with a cloud untouched.

    A mapping that does not change: names are those of the file, types too, and the arrays are
    read-only. A colour is the three attributes ``red``, ``green`` and ``blue``, as in PLY.

    Parameters
    ----------
    arrays
        Each of shape ``shape`` or ``(*shape, k)``, numbers or truth values.
    shape
        That of the cloud, (H, W) or (N,).

    Raises
    ------
    InputError
        An array of another shape, or of something else.
    """

    __slots__ = ("_arrays",)

    def __init__(self, arrays: Mapping[str, ArrayLike], shape: tuple[int, ...]) -> None:
        self._arrays = {
            str(name): one_a_point(values, shape, f"attributes: {name!r}")
            for name, values in arrays.items()
        }

    @classmethod
    def of(cls, arrays: Mapping[str, ArrayLike], shape: tuple[int, ...]) -> Attributes:
        """Take arrays as the constructor does; attributes, which do not change, as they are."""
        return arrays if isinstance(arrays, cls) else cls(arrays, shape)

    def at(self, observed: NDArray[np.bool_], rows: NDArray[np.integer]) -> Attributes:
        """Take those of some rows of the observed points, in the order of ``rows``."""
        places = np.flatnonzero(observed)[rows]
        flat = {
            name: values.reshape(observed.size, *values.shape[observed.ndim :])[places]
            for name, values in self._arrays.items()
        }
        return Attributes(flat, places.shape)

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self._arrays[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._arrays)

    def __len__(self) -> int:
        return len(self._arrays)

    def __repr__(self) -> str:
        inside = ", ".join(f"{name}: {values.dtype}" for name, values in self._arrays.items())
        return f"Attributes({inside})"


def one_a_point(values: ArrayLike, shape: tuple[int, ...], name: str) -> NDArray[Any]:
    """Copy and freeze an array of ``shape`` or ``(*shape, k)``.

    Raises
    ------
    InputError
        It has another shape, or holds neither numbers nor truth values.
    """
    try:
        array = np.array(values)
    except ValueError as error:
        raise InputError(f"{name}: expected an array of numbers, got {error}") from None
    if array.dtype.kind not in "iufb":
        raise InputError(f"{name}: expected an array of numbers, got one of {array.dtype}")
    if array.shape[: len(shape)] != shape or array.ndim > len(shape) + 1:
        raise InputError(
            f"{name}: expected one value, or one row of values, for each point of {shape}, "
            f"got shape {array.shape}"
        )
    array.flags.writeable = False
    return array


def normals_for(points: NDArray[np.float64], normals: ArrayLike) -> NDArray[np.float64]:
    """Copy and freeze normals of the points' own shape, (H, W, 3) or (N, 3); any length.

    Raises
    ------
    InputError
        They have another shape, or are no numbers.
    """
    array = one_a_point(normals, points.shape[:-1], "normals")
    if array.shape != points.shape:
        raise InputError(f"normals: expected shape {points.shape}, got {array.shape}")
    with np.errstate(invalid="ignore", over="ignore"):  # a NaN that signals is as good as any
        array = array.astype(np.float64)
    array.flags.writeable = False
    return array


def beside_points(cloud: Any, count: int) -> dict[str, Any]:
    """Take normals and colours of an object with ``.points``, such as Open3D's, if it has them.

    What is not an array with a row for each of the ``count`` points is left: other libraries call
    other things by these names.
    """
    found: dict[str, Any] = {}
    normals = _rows(getattr(cloud, "normals", None), count, (3,))
    if normals is not None:
        found["normals"] = normals
    colours = _rows(getattr(cloud, "colors", None), count, (3, 4))
    if colours is not None:
        if colours.dtype.kind == "f":  # Open3D's, from 0 to 1
            colours = np.rint(255.0 * np.clip(np.nan_to_num(colours), 0.0, 1.0)).astype(np.uint8)
        names = ("red", "green", "blue", "alpha")
        found["attributes"] = dict(zip(names, colours.T, strict=False))
    return found


def _rows(values: Any, count: int, widths: tuple[int, ...]) -> NDArray[Any] | None:
    if values is None or callable(values):
        return None
    try:
        array = np.asarray(values)
    except ValueError:
        return None
    fits = array.ndim == 2 and len(array) == count > 0 and array.shape[1] in widths
    return array if fits and array.dtype.kind in "iuf" else None
