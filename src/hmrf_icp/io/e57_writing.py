"""E57 written: one scan, with what the format has names for."""

from __future__ import annotations

import hashlib
import uuid
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.io.columns import RED_GREEN_BLUE, Columns, columns_of, unpacked_colours
from hmrf_icp.io.e57 import CARTESIAN, COLOURS, NORMALS, opened
from hmrf_icp.io.e57_grid import INDICES
from hmrf_icp.io.optional import optional

_NORMALS_URI = "http://www.libe57.org/E57_NOR_surface_normals.txt"


def write_e57(path: Path, cloud: PointCloud) -> None:
    """Write the observed points as one scan, in double precision, with what E57 has names for.

    That is intensity, colour and normals, the viewpoint as the pose of the scan, and the rows
    and columns of an organised cloud with a viewpoint: they say that a sensor stood there.
    """
    libe57 = optional(path, "pye57", "e57").libe57
    stood = np.zeros(3) if cloud.viewpoint is None else cloud.viewpoint
    columns = _columns(cloud, stood)
    with opened(libe57, path, "w") as image:
        image.extensionsAdd("", libe57.E57_V1_0_URI)
        image.extensionsAdd("nor", _NORMALS_URI)
        root, scan = image.root(), libe57.StructureNode(image)
        for name, text in (("formatName", "ASTM E57 3D Imaging Data File"), ("guid", _guid(cloud))):
            root.set(name, libe57.StringNode(image, text))
        root.set("versionMajor", libe57.IntegerNode(image, libe57.E57_FORMAT_MAJOR))
        root.set("versionMinor", libe57.IntegerNode(image, libe57.E57_FORMAT_MINOR))
        data = libe57.VectorNode(image, True)
        root.set("data3D", data)
        scan.set("guid", libe57.StringNode(image, _guid(cloud)))
        if cloud.viewpoint is not None:
            pose = libe57.StructureNode(image)
            scan.set("pose", pose)
            for part, names, numbers in (
                ("rotation", "wxyz", (1.0, 0.0, 0.0, 0.0)),
                ("translation", "xyz", tuple(map(float, stood))),
            ):
                node = libe57.StructureNode(image)
                for name, number in zip(names, numbers, strict=True):
                    node.set(name, libe57.FloatNode(image, number))
                pose.set(part, node)
        prototype, buffers = libe57.StructureNode(image), libe57.VectorSourceDestBuffer()
        for name, values in columns.items():
            prototype.set(name, _number(libe57, image, name, values))
            buffers.append(libe57.SourceDestBuffer(image, name, values, len(cloud), True, True))
        if "intensity" in columns:
            _limits(libe57, image, scan, "intensity", columns["intensity"])
        if COLOURS[0] in columns:
            limits = libe57.StructureNode(image)
            for name in COLOURS:
                limits.set(f"{name}Minimum", libe57.IntegerNode(image, 0, 0, 255))
                limits.set(f"{name}Maximum", libe57.IntegerNode(image, 255, 0, 255))
            scan.set("colorLimits", limits)
        points = libe57.CompressedVectorNode(image, prototype, libe57.VectorNode(image, True))
        scan.set("points", points)
        data.append(scan)
        writer = points.writer(buffers)
        writer.write(len(cloud))
        writer.close()


def _columns(cloud: PointCloud, stood: NDArray[np.float64]) -> Columns:
    """Return what is written of the observed points, in the types that it is written from."""
    points = cloud.observed_points - stood
    columns: Columns = {
        name: np.ascontiguousarray(points[:, axis]) for axis, name in enumerate(CARTESIAN)
    }
    held = unpacked_colours(columns_of(cloud, ()))
    single = {
        name: values[cloud.observed] for name, values in held.items() if values.shape == cloud.shape
    }
    if "intensity" in single and np.isfinite(single["intensity"]).all():
        columns["intensity"] = single["intensity"].astype(np.float64)
    if all(name in single and single[name].dtype == np.uint8 for name in RED_GREEN_BLUE):
        for name, colour in zip(COLOURS, RED_GREEN_BLUE, strict=True):
            columns[name] = np.ascontiguousarray(single[colour])
    if cloud.normals is not None and np.isfinite(cloud.normals[cloud.observed]).all():
        normals = cloud.normals[cloud.observed]
        for axis, name in enumerate(NORMALS):
            columns[name] = np.ascontiguousarray(normals[:, axis])
    if cloud.organised and cloud.viewpoint is not None:
        for name, places in zip(INDICES, np.nonzero(cloud.observed), strict=True):
            columns[name] = places.astype(np.float64)  # pye57 takes an int64 for two
    return columns


def _number(libe57: Any, image: Any, name: str, values: NDArray[Any]) -> Any:
    if name in COLOURS:
        return libe57.IntegerNode(image, 0, 0, 255)
    if name in INDICES:
        return libe57.IntegerNode(image, 0, 0, int(values.max(initial=0)))
    return libe57.FloatNode(image, 0.0, libe57.E57_DOUBLE)


def _limits(libe57: Any, image: Any, scan: Any, name: str, values: NDArray[Any]) -> None:
    limits = libe57.StructureNode(image)
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
    limits.set(f"{name}Minimum", libe57.FloatNode(image, low))
    limits.set(f"{name}Maximum", libe57.FloatNode(image, high))
    scan.set(f"{name}Limits", limits)


def _guid(cloud: PointCloud) -> str:
    """Name the cloud by what it holds: the same cloud is the same file."""
    digest = hashlib.blake2b(cloud.observed_points.tobytes(), digest_size=16).digest()
    return f"{{{uuid.UUID(bytes=digest)}}}"
