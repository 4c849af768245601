"""A drawing is read as points of its surface, whatever it was written as."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import InputError, PointCloud
from hmrf_icp.io import read_cloud, write_cloud

CORNERS = np.array(
    [
        *([0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0]),
        *([0.0, 0.0, 0.5], [2.0, 0.0, 0.5], [2.0, 1.0, 0.5], [0.0, 1.0, 0.5]),
    ]
)
SIDES = (
    *((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4)),
    *((1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
)
TRIANGLES = [(q[0], q[k], q[k + 1]) for q in SIDES for k in (1, 2)]


def obj():
    lines = [f"v {x} {y} {z}" for x, y, z in CORNERS]
    return "\n".join(
        [*lines, *(f"f {' '.join(str(i + 1) for i in q)}" for q in SIDES), ""]
    ).encode()


def ply():
    header = (
        "ply\nformat ascii 1.0\nelement vertex 8\nproperty double x\nproperty double y\n"
        "property double z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
        "element face 6\nproperty list uchar int vertex_index\nend_header\n"
    )
    rows = [f"{x} {y} {z} 200 100 50" for x, y, z in CORNERS]
    return (
        header + "\n".join([*rows, *(f"4 {' '.join(map(str, q))}" for q in SIDES), ""])
    ).encode()


def stl():
    facets = b"".join(
        struct.pack("<12fH", 0, 0, 0, *CORNERS[list(t)].ravel(), 0) for t in TRIANGLES
    )
    return bytes(80) + struct.pack("<I", len(TRIANGLES)) + facets


def glb(change=lambda tree: None, scale=1.0):
    """Corners at a scale that the scene takes back by a node of its own."""
    blob = (CORNERS / scale).astype("<f4").tobytes() + np.array(TRIANGLES, "<u4").tobytes()
    tree = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "scale": [scale] * 3}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 36, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 96},
            {"buffer": 0, "byteOffset": 96, "byteLength": 144},
        ],
        "buffers": [{"byteLength": len(blob)}],
    }
    change(tree)
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(blob), b"BIN\0")
    return b"glTF" + struct.pack("<II", 2, 12 + len(body) + len(blob)) + body + blob


FILES = {".obj": obj(), ".ply": ply(), ".stl": stl(), ".glb": glb(scale=0.25)}


def saved(folder, suffix, content):
    if suffix != ".ply":
        pytest.importorskip("trimesh", reason="needs trimesh (the extra 'mesh')")
    (folder / f"m{suffix}").write_bytes(content)
    return folder / f"m{suffix}"


@pytest.mark.parametrize("suffix", FILES)
def test_a_box_is_read_as_points_of_its_six_sides(tmp_path, suffix):
    cloud = read_cloud(saved(tmp_path, suffix, FILES[suffix]), samples=6000)
    assert cloud.shape == (6000,)
    middle = np.array([1.0, 0.5, 0.25])
    on_side = np.isclose(np.abs(cloud.points - middle), middle, atol=1e-6)
    assert on_side.any(axis=1).all()
    outward = np.einsum("nk,nk->n", cloud.normals, cloud.points - middle)
    assert (outward > 0.2).all()
    share = [np.abs(cloud.normals[:, axis]).sum() / 6000 for axis in range(3)]
    np.testing.assert_allclose(share, np.array([1.0, 2.0, 4.0]) / 7.0, atol=1e-3)
    assert set(cloud.attributes) == ({"red", "green", "blue"} if suffix == ".ply" else set())


def test_a_drawing_has_100000_points_unless_it_is_said(tmp_path):
    path = saved(tmp_path, ".ply", ply())
    assert read_cloud(path).shape == (100_000,)
    vertices = read_cloud(path, samples=0)
    np.testing.assert_array_equal(vertices.points, CORNERS)
    assert vertices.attributes["red"].tolist() == [200] * 8
    with pytest.raises(InputError, match=r"m\.ply: samples: expected a number of points, got -1"):
        read_cloud(path, samples=-1)


def test_a_scan_is_registered_to_its_drawing(tmp_path):
    """Two stacked boxes, and points on them in a frame of their own."""
    second = 0.5 * CORNERS + [0.2, 0.1, 0.5]
    lines = [f"v {x} {y} {z}" for x, y, z in np.r_[CORNERS, second]]
    faces = [[i + k for i in q] for k in (1, 9) for q in SIDES]
    text = "\n".join([*lines, *(f"f {' '.join(map(str, q))}" for q in faces), ""])
    drawing = read_cloud(saved(tmp_path, ".obj", text.encode()), samples=4000)
    angle = np.radians(8.0)
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]]
    )
    scan = read_cloud(tmp_path / "m.obj", samples=3001).points
    source = (scan - [0.1, -0.05, 0.02]) @ turn
    result = hmrf_icp.register(source, drawing, np.eye(4))
    np.testing.assert_allclose(result.transformation[:3, :3], turn, atol=5e-3)
    np.testing.assert_allclose(result.transformation[:3, 3], [0.1, -0.05, 0.02], atol=1e-2)


def test_obj_without_faces_is_a_cloud_with_colours_and_normals(tmp_path):
    rng = np.random.default_rng(0)
    colours = {name: rng.integers(0, 256, 9, np.uint8) for name in ("red", "green", "blue")}
    cloud = PointCloud(rng.normal(size=(9, 3)), normals=rng.normal(size=(9, 3)), attributes=colours)
    write_cloud(tmp_path / "c.obj", cloud)
    assert read_cloud(tmp_path / "c.obj") == cloud
    (tmp_path / "bad.obj").write_text("v 0 0 0\nv 1 two 3\n")
    with pytest.raises(InputError, match="line 2 should hold three numbers or more behind 'v'"):
        read_cloud(tmp_path / "bad.obj")
    (tmp_path / "no.obj").write_text("# nothing\n")
    with pytest.raises(InputError, match="no vertices in it"):
        read_cloud(tmp_path / "no.obj")


def _promise(tree):
    tree["accessors"].append({"componentType": 5126, "count": 10**10, "type": "VEC3"})


def _cycle(tree):
    tree["nodes"] = [{"mesh": 0, "children": [1]}, {"children": [0]}]


def _two_parents(tree):
    tree["nodes"] = [{"children": [1, 2]}, {"children": [3]}, {"children": [3]}, {"mesh": 0}]


def _many(tree):
    tree["nodes"] = [{"mesh": 0} for _ in range(200_000)]
    tree["scenes"] = [{"nodes": list(range(200_000))}]


def _packed(tree):
    tree["extensionsRequired"] = ["KHR_draco_mesh_compression"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (_promise, "bytes would become"),
        (_cycle, "nested deeper"),
        (_two_parents, "two parents"),
        (_packed, "packed by KHR_draco_mesh_compression"),
        (lambda tree: tree["buffers"][0].update(uri="other.bin"), "in another file"),
        (lambda tree: tree["accessors"][1].update(count=30), None),
        (lambda tree: tree.update(meshes=[]), r"m\.glb: "),
    ],
)
def test_glb_that_promises_what_it_does_not_hold(tmp_path, change, message):
    path = saved(tmp_path, ".glb", glb(change))
    if message is None:
        assert read_cloud(path, samples=10).shape == (10,)
        return
    with pytest.raises(InputError, match=message):
        read_cloud(path, samples=10)


@pytest.mark.parametrize(
    ("suffix", "content", "message"),
    [
        (".obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", r"m\.obj: "),
        (".stl", stl()[:300], r"m\.stl: cut short, or not an STL file: "),
        (".stl", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0", r"m\.stl: cut short: 1 "),
        (".stl", b"solid nothing\nendsolid\n", r"m\.stl: "),
        (".glb", glb()[:100], "cut short"),
        (".glb", b"hello, world, hello", "not a GLB file"),
        (".ply", ply().replace(b"4 0 3 2 1", b"4 0 3 2 8"), "a face lists vertices that are not"),
        (".ply", ply().replace(b"4 0 3 2 1", b"4 0 3 2 -1"), "a face lists vertices that are not"),
    ],
)
def test_meshes_that_are_damaged(tmp_path, suffix, content, message):
    with pytest.raises(InputError, match=message):
        read_cloud(saved(tmp_path, suffix, content))


def test_without_trimesh_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "trimesh", None)
    (tmp_path / "m.stl").write_bytes(stl())
    with pytest.raises(InputError, match=r"needs trimesh .*pip install 'hmrf-icp\[mesh\]'"):
        read_cloud(tmp_path / "m.stl")
