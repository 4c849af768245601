"""E57, the exchange format of terrestrial scanners, by pye57 (``pip install 'hmrf-icp[e57]'``)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.errors import InputError
from hmrf_icp.io.columns import RED_GREEN_BLUE, Columns
from hmrf_icp.io.e57_grid import INDICES, Grid, grid_of
from hmrf_icp.io.e57_outline import check_outline
from hmrf_icp.io.files import reading, require_bounded
from hmrf_icp.io.optional import optional

Array = NDArray[np.float64]

CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
COLOURS = ("colorRed", "colorGreen", "colorBlue")
NORMALS = ("nor:normalX", "nor:normalY", "nor:normalZ")
_OTHERS = ("intensity", "timeStamp", *INDICES)
"""Taken by their own names."""


class _Scan(NamedTuple):
    """One scan in the frame of the file, where its sensor stood if that is told, and its grid."""

    points: Array
    rest: Columns
    normals: Array | None
    stood: Array | None
    grid: Grid | None
    kept: NDArray[np.bool_]
    """(N,): all but what is marked as invalid."""


def read_e57(path: Path) -> PointCloud:
    """Read all scans of a file, in its frame and metres, as one cloud.

    A single scan whose points name the rows and columns of a grid comes out organised, as long
    as half of its pixels have one and rows are not much farther apart than columns.
    Otherwise intensity, colour (as bytes), normals, times, and the row and column of each point
    come along where every scan has them. Points marked as invalid are left out. The viewpoint
    is that of the scan, if there is a single one and the file says where it stood: by a pose
    that is not the identity, by rows and columns, or by coordinates about the sensor.

    Raises
    ------
    InputError
        Not E57, damaged, cut short, more points promised than the file can hold, or pye57 is
        missing.
    """
    libe57 = optional(path, "pye57", "e57").libe57
    with reading(path, "an E57 file"):
        check_outline(path)
        with opened(libe57, path, "r") as image:
            root = image.root()
            scans = list(root["data3D"]) if root.isDefined("data3D") else []
            if not scans:
                raise InputError(f"{path}: no scans in it")
            wanted = [_fields(libe57, path, scan) for scan in scans]
            counts = [int(scan["points"].childCount()) for scan in scans]
            total = sum(count * len(names) for count, names in zip(counts, wanted, strict=True))
            require_bounded(path, path.stat().st_size, 8 * total)
            read = [
                _read(libe57, path, image, *each)
                for each in zip(scans, wanted, counts, strict=True)
            ]
    return _joined(read)


@contextmanager
def opened(libe57: Any, path: Path, mode: str) -> Iterator[Any]:
    """Open an image file, as E57 calls itself, and close it, complete or not."""
    image = libe57.ImageFile(str(path), mode)
    try:
        yield image
    except BaseException:
        image.cancel()
        raise
    image.close()


def _fields(libe57: Any, path: Path, scan: Any) -> tuple[str, ...]:
    """Names of what is read of a scan, the coordinates first."""
    prototype = libe57.StructureNode(scan["points"].prototype())
    names = {prototype.get(place).elementName() for place in range(prototype.childCount())}
    for coordinates, invalid in (
        (CARTESIAN, "cartesianInvalidState"),
        (SPHERICAL, "sphericalInvalidState"),
    ):
        if names.issuperset(coordinates):
            rest = [name for name in (*_OTHERS, invalid) if name in names]
            for three in (COLOURS, NORMALS):
                rest += three if names.issuperset(three) else ()
            return (*coordinates, *rest)
    raise InputError(
        f"{path}: a scan without {', '.join(CARTESIAN)}; it has {', '.join(sorted(names)[:20])}"
    )


def _read(
    libe57: Any, path: Path, image: Any, scan: Any, names: tuple[str, ...], count: int
) -> _Scan:
    held: Columns = {name: np.zeros(count) for name in names}
    if count:
        buffers = libe57.VectorSourceDestBuffer()
        for name, values in held.items():
            buffers.append(libe57.SourceDestBuffer(image, name, values, count, True, True))
        reader = scan["points"].reader(buffers)
        found = int(reader.read())
        reader.close()
        if found != count:
            raise InputError(f"{path}: cut short: {count:,} points promised, {found:,} found")
    invalid = [held.pop(name) for name in [*held] if name.endswith("InvalidState")]
    kept = invalid[0] == 0 if invalid else np.ones(count, dtype=np.bool_)
    first, second, third = (held.pop(name) for name in names[:3])
    about_sensor = names[0] == SPHERICAL[0]
    points = np.stack([first, second, third], axis=-1)
    if about_sensor:
        flat = first * np.cos(third)
        points = np.stack(
            [flat * np.cos(second), flat * np.sin(second), first * np.sin(third)], axis=-1
        )
    rotation, translation = _pose(path, scan)
    on_grid = all(name in held for name in INDICES)
    grid = grid_of(*(held[name] for name in INDICES)) if on_grid else None
    known = about_sensor or on_grid
    known |= not (np.array_equal(rotation, np.eye(3)) and not translation.any())
    normals = None
    with np.errstate(all="ignore"):  # what is not finite is unobserved
        points = points @ rotation.T + translation
        if NORMALS[0] in held:
            normals = np.stack([held.pop(name) for name in NORMALS], axis=-1) @ rotation.T
    if COLOURS[0] in held:
        for name, values in zip(RED_GREEN_BLUE, _bytes(scan, held), strict=True):
            held[name] = values
    for name in INDICES:
        if name in held:
            held[name] = held[name].astype(np.int64)
    return _Scan(points, held, normals, translation if known else None, grid, kept)


def _bytes(scan: Any, held: Columns) -> list[NDArray[np.uint8]]:
    """Take the colours out, as bytes; limits of more say that they are finer."""
    colours = [held.pop(name) for name in COLOURS]
    top = 255.0
    try:
        top = max(float(scan["colorLimits"][f"{name}Maximum"].value()) for name in COLOURS)
    except Exception:  # there are no limits, or they are no numbers
        top = max((float(values.max()) for values in colours if values.size), default=top)
    scale = 255.0 / top if top > 255.0 else 1.0
    return [np.clip(np.rint(values * scale), 0, 255).astype(np.uint8) for values in colours]


def _pose(path: Path, scan: Any) -> tuple[Array, Array]:
    """Rotation (3, 3) and translation (3,), scan to file."""
    if not scan.isDefined("pose"):
        return np.eye(3), np.zeros(3)
    pose = scan["pose"]
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    if pose.isDefined("rotation"):
        # By name: the order in the file is free.
        w, x, y, z = (float(pose["rotation"][name].value()) for name in "wxyz")
    moved = np.zeros(3)
    if pose.isDefined("translation"):
        moved = np.array([float(pose["translation"][name].value()) for name in "xyz"])
    length = float(np.linalg.norm([w, x, y, z]))
    if not np.isfinite([length, *moved]).all() or abs(length - 1.0) > 1e-3:
        raise InputError(f"{path}: the pose of a scan is no rotation: quaternion {w, x, y, z}")
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_quat([x, y, z, w]).as_matrix()
    return (np.eye(3) if (x, y, z) == (0.0, 0.0, 0.0) else turned), moved


def _joined(scans: list[_Scan]) -> PointCloud:
    if len(scans) == 1:
        points, rest, normals, stood, grid, kept = scans[0]
        if grid is not None:
            held = {name: grid.laid(v, kept) for name, v in rest.items() if name not in INDICES}
            turned = None if normals is None else grid.laid(normals, kept)
            return PointCloud(grid.laid(points, kept), None, stood, turned, held)
        held = {name: values[kept] for name, values in rest.items()}
        return PointCloud(
            points[kept], None, stood, None if normals is None else normals[kept], held
        )
    shared = [name for name in scans[0].rest if all(name in scan.rest for scan in scans)]
    every = [scan.normals[scan.kept] for scan in scans if scan.normals is not None]
    return PointCloud(
        np.concatenate([scan.points[scan.kept] for scan in scans]),
        None,
        None,
        np.concatenate(every) if len(every) == len(scans) else None,
        {name: np.concatenate([scan.rest[name][scan.kept] for scan in scans]) for name in shared},
    )
