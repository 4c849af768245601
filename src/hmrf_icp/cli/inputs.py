"""What the commands read: clouds and depth maps, cameras, numbers; and whose fault an error is."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from hmrf_icp.errors import InputError

if TYPE_CHECKING:
    from hmrf_icp.clouds.cloud import PointCloud
    from hmrf_icp.io import Intrinsics

NOT_BELIEVED = 1
"""Exit status where the result is not to be believed."""


def require_positive(option: str, value: float | None, unit: str) -> None:
    """Refuse an option's number that is not finite and positive; None is no number."""
    if value is not None and not (math.isfinite(value) and value > 0):
        raise InputError(f"{option}: expected a positive number of {unit}, got {value:g}")


def position(option: str, text: str) -> tuple[float, float, float]:
    """Read the three numbers X,Y,Z of an option."""
    try:
        x, y, z = (float(word) for word in text.split(","))
    except ValueError:
        x = y = z = math.nan
    if not all(map(math.isfinite, (x, y, z))):
        raise InputError(
            f"{option}: expected three numbers X,Y,Z in metres, such as 0,0,1.8, auto or none; "
            f"got {text!r}"
        )
    return x, y, z


def lens_of(camera: Path | None, intrinsics: str | None) -> Intrinsics | None:
    """Read the intrinsics of depth maps from their file, or from the numbers given."""
    from hmrf_icp.io import parse_intrinsics, read_intrinsics

    if camera is not None and intrinsics is not None:
        raise InputError("--camera and --intrinsics: give one of them, not both")
    if camera is not None:
        return read_intrinsics(camera)
    return None if intrinsics is None else parse_intrinsics(intrinsics, "--intrinsics")


def read_input(
    path: Path,
    lens: Intrinsics | None,
    depth_scale: float | None,
    max_depth: float | None,
    samples: int | None = None,
    confidence: Path | None = None,
    min_confidence: float = 1,
) -> tuple[PointCloud, bool]:
    """Read a cloud, and say whether it came from a depth map."""
    from hmrf_icp.clouds.cloud import PointCloud
    from hmrf_icp.io.cloud import read_any, unproject

    content = read_any(path, samples, confidence, min_confidence)
    if isinstance(content, PointCloud):
        return content, False
    return unproject(path, content, lens, depth_scale, max_depth), True


def seen_from(position: tuple[float, float, float], cloud: PointCloud) -> PointCloud:
    """Say where the sensor of a cloud stood; a camera stands at the origin and stays there."""
    import numpy as np

    return cloud if cloud.camera is not None else replace(cloud, viewpoint=np.array(position))


@contextmanager
def arguments_named(files: dict[str, Path | None]) -> Iterator[None]:
    """Put the file behind the argument that the library complains about."""
    try:
        yield
    except InputError as error:
        argument, _, rest = str(error).partition(": ")
        if files.get(argument) is None:
            raise
        raise InputError(f"{argument} {files[argument]}: {rest}") from None
