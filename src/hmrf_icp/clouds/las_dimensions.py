"""What stands beside the coordinates in LAS, in the words of every other cloud."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

COLOURS = ("red", "green", "blue")
NORMALS = (
    ("nx", "ny", "nz"),
    ("normal_x", "normal_y", "normal_z"),
    ("normalx", "normaly", "normalz"),
)
"""Names of the extra dimensions that programs keep normals in, in lower case."""

_COORDINATES = ("X", "Y", "Z", "x", "y", "z")
_RETURNS = ("return_number", "number_of_returns")


def las_dimensions(record: Any) -> tuple[NDArray[np.float64] | None, dict[str, NDArray[Any]]]:
    """Return normals (N, 3), None where there are none, and the attributes of laspy's points.

    Every dimension of the point format comes along that says something: what is 0 for all
    points, or their return if all are the first of one, does not. Colours become bytes, as they
    are everywhere else: LAS has 16 bits for them, which some programs fill from the left and others
    from the right.
    """
    held: dict[str, NDArray[Any]] = {}
    if not hasattr(record.point_format, "dimension_names"):
        return None, held
    for name in record.point_format.dimension_names:
        if name in _COORDINATES:
            continue
        values = np.array(record[name])
        if values.dtype.kind not in "iufb" or values.ndim > 2:
            continue
        with np.errstate(invalid="ignore"):  # a NaN that signals
            if not values.any():
                continue
        if name in _RETURNS and (values == 1).all():
            continue
        held[name] = values.astype(values.dtype.newbyteorder("="))
    if all(name in record.point_format.dimension_names for name in COLOURS):
        colours = [np.array(record[name]) for name in COLOURS]
        if any(values.any() for values in colours):
            wide = max(int(values.max()) for values in colours) > 255
            for name, values in zip(COLOURS, colours, strict=True):
                held[name] = (values >> 8 if wide else values).astype(np.uint8)
    standard = {*record.point_format.standard_dimension_names}
    for name in [*held]:
        # What did not fit into a dimension of LAS was written beside it.
        bare = name.removesuffix("_2")
        if bare != name and bare in standard and bare not in held:
            held[bare] = held.pop(name)
    lower = {name.lower(): name for name in held}
    for names in NORMALS:
        if all(name in lower and held[lower[name]].ndim == 1 for name in names):
            normals = np.stack([held.pop(lower[name]) for name in names], axis=-1)
            return normals.astype(np.float64), held
        # A component that is 0 everywhere, such as those of a floor, was left out above.
        every = {name.lower(): name for name in record.point_format.extra_dimension_names}
        if all(name in every for name in names) and any(name in lower for name in names):
            for name in names:
                held.pop(every[name], None)
            parts = [np.array(record[every[name]], dtype=np.float64) for name in names]
            return np.stack(parts, axis=-1), held
    return None, held
