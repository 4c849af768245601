"""Pairs from anywhere: a folder each, with two arrays of points, the pose, and what is known."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.datasets.criterion import Tolerance
from hmrf_icp.datasets.formats import Format
from hmrf_icp.datasets.pair_set import ListedPair, PairSet
from hmrf_icp.errors import InputError

SHARE, DEGREES = 0.02, 2.0
"""Tolerance of a pair that names none: this share of its size, and these degrees.

Registered from the true pose, pairs whose truth is good end within 1.8 % and 1.4 degrees of it.
"""

_TRUTH, _ABOUT = "gt.txt", "meta.json"


@dataclass(frozen=True)
class PointsFile:
    """An archive of NumPy with ``points``, (N, 3) or (H, W, 3).

    Parameters
    ----------
    path
        The file.
    camera
        Of an organised cloud, at the origin; None where it is not known.
    viewpoint
        (3,) where the sensor stood, None likewise.
    """

    path: Path
    camera: PinholeCamera | None = None
    viewpoint: tuple[float, ...] | None = None

    def load(self) -> PointCloud:
        """Read the points.

        Raises
        ------
        InputError
            The file is missing or damaged, or does not fit the camera.
        """
        from hmrf_icp.io import read_cloud

        points = read_cloud(self.path).points
        stood = None if self.viewpoint is None else np.array(self.viewpoint)
        try:
            return PointCloud(points, self.camera, stood)
        except InputError as error:
            raise InputError(f"{self.path}: {error}") from None


def open_pair_folders(folder: Path) -> PairSet:
    """Open a folder of pairs, or of one.

    Each has ``source.npz`` and ``target.npz``, ``gt.txt`` (4 x 4, source to target) and
    ``meta.json``: ``size`` (root mean square distance from the centroid, measured on the source
    where it is not given), ``tol`` (distance and degrees, or null), ``camera`` (width, height, fx,
    fy, cx, cy, or null), ``viewpoint`` (or null) and ``room`` (whether it is a room in metres, so
    that a start may be shifted by metres; else a "metre" is the size).

    Raises
    ------
    InputError
        A file is missing or malformed.
    """
    folders = [folder] if _is_pair(folder) else _pairs_in(folder)
    pairs = tuple(_pair(path) for path in folders)
    criterion = (
        f"the source's centroid and its rotation are within the pair's own tolerance, or, where it "
        f"names none, within {100 * SHARE:g} % of its size and {DEGREES:g} degrees"
    )
    return PairSet(folder.name, FORMAT.name, pairs, criterion, False, folder)


def _is_pair(folder: Path) -> bool:
    return (folder / _ABOUT).is_file() and (folder / "source.npz").is_file()


def _pairs_in(folder: Path) -> list[Path]:
    return [path for path in sorted(folder.iterdir()) if path.is_dir() and _is_pair(path)]


def _pair(folder: Path) -> ListedPair:
    from hmrf_icp.io.pose import read_pose

    path = folder / _ABOUT
    try:
        about = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: not JSON ({error})") from None
    if not isinstance(about, Mapping):
        raise InputError(f"{path}: expected an object, found {type(about).__name__}")
    camera = _camera(path, about)
    viewpoint = _numbers(path, about, "viewpoint", 3)
    source, target = (
        PointsFile(folder / f"{end}.npz", camera, viewpoint) for end in ("source", "target")
    )
    given = _numbers(path, about, "size", None)
    size = given[0] if given else _rms(source.load())
    if not size > 0:
        raise InputError(f"{path}: size: expected a positive length, got {size:g}")
    distance, degrees = _numbers(path, about, "tol", 2) or (SHARE * size, DEGREES)
    return ListedPair(
        "",
        folder.name,
        0,
        1,
        target,
        source,
        read_pose(folder / _TRUTH),
        Tolerance(distance, float(np.radians(degrees))),
        unit=1.0 if about.get("room", False) else size,
    )


def _numbers(
    path: Path, about: Mapping[str, Any], name: str, count: int | None
) -> tuple[float, ...] | None:
    """Numbers of an entry, None where it is null or missing; ``count`` None is a single one."""
    value = about.get(name)
    if value is None:
        return None
    values = value if isinstance(value, list) and count is not None else [value]
    try:
        numbers = tuple(float(one) for one in values)
    except (TypeError, ValueError):
        numbers = ()
    if len(numbers) != (count or 1) or not np.isfinite(numbers).all():
        expected = "a number" if count is None else f"{count} numbers"
        raise InputError(f"{path}: {name}: expected {expected} or null, found {value!r}")
    return numbers


def _camera(path: Path, about: Mapping[str, Any]) -> PinholeCamera | None:
    numbers = _numbers(path, about, "camera", 6)
    if numbers is None:
        return None
    width, height, fx, fy, cx, cy = numbers
    return PinholeCamera(int(width), int(height), fx, fy, cx, cy)


def _rms(cloud: PointCloud) -> float:
    offset = cloud.observed_points - cloud.observed_points.mean(axis=0)
    return float(np.sqrt((offset**2).sum(axis=1).mean()))


FORMAT = Format(
    "pairs",
    "folders with source.npz, target.npz, gt.txt and meta.json",
    lambda folder: _is_pair(folder) or bool(_pairs_in(folder)),
    open_pair_folders,
)
