"""Meshes, OBJ, STL and GLB, by trimesh (``pip install 'hmrf-icp[mesh]'``), as points."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.sampled_surface import SAMPLES, sampled_surface, vertices_suffice
from hmrf_icp.errors import InputError
from hmrf_icp.io.columns import RED_GREEN_BLUE, Columns, cloud_of
from hmrf_icp.io.files import quietly, reading, require_bounded
from hmrf_icp.io.glb_outline import check_glb
from hmrf_icp.io.obj_points import has_faces, read_obj_points
from hmrf_icp.io.optional import optional

Array = NDArray[np.float64]

MOST_PARTS = 100_000
"""Places at which a scene may show a mesh."""


def read_mesh(path: Path, samples: int | None = None) -> PointCloud:
    """Read a mesh as points of its surface, with the normals of its faces and its colours.

    Parameters
    ----------
    path
        OBJ, STL or GLB. An OBJ file without faces is a cloud of its vertices.
    samples
        Points that are spread over the surface; 0 takes the vertices. None is the vertices where
        they are many and evenly spread, as a scan's are, and 100,000 samples otherwise.

    Raises
    ------
    InputError
        Damaged, without faces, larger than its file can hold, or trimesh is missing.
    """
    suffix = path.suffix.lower()
    with reading(path, f"{'an' if suffix == '.obj' else 'a'} {suffix[1:].upper()} mesh"):
        data = path.read_bytes()
        if suffix == ".obj" and not has_faces(data):
            return read_obj_points(path, data)
        trimesh = optional(path, "trimesh", "mesh")
        if suffix == ".glb":
            check_glb(path, data)
        if suffix == ".stl":
            _check_stl(path, data)
        with quietly(), np.errstate(all="ignore"):
            # Without a resolver no other file is looked for, and none on the network.
            scene = trimesh.load_scene(
                io.BytesIO(data),
                file_type=suffix[1:],
                process=False,
                skip_materials=True,
            )
            vertices, faces, columns = _gathered(path, scene, len(data))
    return cloud_of_mesh(path, vertices, faces, columns, samples)


def _check_stl(path: Path, data: bytes) -> None:
    """Refuse what does not hold the triangles that it promises."""
    if data[:5].lower() == b"solid" and b"facet" in data[:2000].lower():
        begun, ended = data.lower().count(b"facet normal"), data.lower().count(b"endfacet")
        if begun != ended:
            raise InputError(f"{path}: cut short: {begun:,} facets begin and {ended:,} end")
        return
    promised = int.from_bytes(data[80:84], "little")
    found = max(0, len(data) - 84) // 50
    if not 0 < promised <= found:
        raise InputError(
            f"{path}: cut short, or not an STL file: {promised:,} triangles promised, {found:,} "
            "found"
        )


def cloud_of_mesh(
    path: Path,
    vertices: Array,
    faces: NDArray[np.int64],
    columns: Columns,
    samples: int | None,
) -> PointCloud:
    """Make a cloud of a mesh, of its vertices or of points on its surface; see `read_mesh`.

    Raises
    ------
    InputError
        The faces are not those of a surface; the message names ``path``.
    """
    try:
        if samples is not None and samples < 0:
            raise InputError(f"samples: expected a number of points, got {samples}")
        # What sampled_surface checks first; the rule of the vertices needs it too.
        sound = bool(len(faces)) and faces.min() >= 0 and faces.max() < len(vertices)
        if samples == 0 or (samples is None and sound and vertices_suffice(vertices, faces)):
            return cloud_of(vertices, columns)
        others = {
            name: values for name, values in columns.items() if name not in ("nx", "ny", "nz")
        }
        return sampled_surface(vertices, faces, SAMPLES if samples is None else samples, others)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _gathered(path: Path, scene: Any, size: int) -> tuple[Array, NDArray[np.int64], Columns]:
    """All meshes of a scene as one, each where the scene shows it."""
    shown = list(scene.graph.nodes_geometry)
    if len(shown) > MOST_PARTS:
        raise InputError(
            f"{path}: {len(shown):,} meshes in one scene; expected a file of one model"
        )
    parts = []
    total = 0
    for node in shown:
        pose, name = scene.graph[node]
        mesh = scene.geometry[name]
        if not hasattr(mesh, "faces") or not len(mesh.faces):
            continue
        total += mesh.vertices.nbytes + mesh.faces.nbytes
        require_bounded(path, size, total)
        parts.append((np.asarray(pose, dtype=np.float64), mesh))
    if not parts:
        raise InputError(f"{path}: no faces in it")
    vertices, faces, colours = [], [], []
    before = 0
    for pose, mesh in parts:
        moved = np.asarray(mesh.vertices, dtype=np.float64) @ pose[:3, :3].T + pose[:3, 3]
        listed = np.asarray(mesh.faces, dtype=np.int64)
        if not (listed.min() >= 0 and listed.max() < len(moved)):
            raise InputError(f"{path}: a face lists vertices that are not in the file")
        if np.linalg.det(pose[:3, :3]) < 0.0:  # mirrored: what was outside stays so
            listed = listed[:, ::-1]
        vertices.append(moved)
        faces.append(listed + before)
        before += len(moved)
        colours.append(_colours(mesh))
    columns: Columns = {}
    if all(each is not None for each in colours):
        every = np.concatenate([each for each in colours if each is not None])
        columns = {name: every[:, place] for place, name in enumerate(RED_GREEN_BLUE)}
    return np.concatenate(vertices), np.concatenate(faces), columns


def _colours(mesh: Any) -> NDArray[np.uint8] | None:
    """Colours (V, 3) where the file has some for each vertex."""
    visual = mesh.visual
    if getattr(visual, "kind", None) == "vertex" and getattr(visual, "defined", False):
        colours = np.asarray(visual.vertex_colors)
        if colours.dtype == np.uint8 and colours.shape[:1] == (len(mesh.vertices),):
            return colours[:, :3]
    return None
