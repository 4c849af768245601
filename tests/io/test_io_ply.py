"""PLY in the dialects that scanners, meshes and archives come in."""

from __future__ import annotations

import struct
import warnings

import numpy as np
import pytest

from hmrf_icp import InputError, PointCloud
from hmrf_icp.io import read_cloud, write_cloud

POINTS = np.array([[0.125, -1.5, 2.0], [3.0, 4.25, -5.5], [1e-3, 0.1, 1 / 3], [7.0, 8.0, 9.0]])
WHOLE = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [100.0, 0.0, 9.0], [7.0, 8.0, 9.0]])

TYPES = {
    "char": "b",
    "uchar": "B",
    "short": "h",
    "ushort": "H",
    "int": "i",
    "uint": "I",
    "float": "f",
    "double": "d",
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "float32": "f",
    "float64": "d",
}
FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
XYZ = ("double x", "double y", "double z")


def row_of(properties, values, order):
    """One row; the value of a list is a sequence."""
    out = b""
    for each, value in zip(properties, values, strict=True):
        words = each.split()
        numbers = [(words[-2], value)]
        if words[0] == "list":
            numbers = [(words[1], len(value)), *((words[2], entry) for entry in value)]
        for kind, number in numbers:
            if order:
                out += struct.pack(order + TYPES[kind], number)
            else:
                out += f"{number!r} ".encode()
    return out if order else out + b"\n"


def ply(kind, *elements, notes=(), newline="\n"):
    """A file of (name, properties, rows) elements."""
    lines = ["ply", f"format {kind} 1.0", *notes]
    body = b""
    for name, properties, rows in elements:
        lines += [f"element {name} {len(rows)}", *(f"property {each}" for each in properties)]
        body += b"".join(row_of(properties, row, FORMATS[kind]) for row in rows)
    return "".join(line + newline for line in [*lines, "end_header"]).encode("latin-1") + body


@pytest.fixture
def points_of(tmp_path):
    """Write bytes as a PLY file and read its points."""

    def read(content):
        (tmp_path / "c.ply").write_bytes(content)
        return read_cloud(tmp_path / "c.ply", samples=0).points

    return read


VERTICES = ("vertex", XYZ, POINTS.tolist())
TRIANGLES = ("face", ("list uchar int vertex_indices",), [[(0, 1, 2)], [(1, 2, 3)]])
POLYGONS = (
    "face",
    ("uchar flags", "list uchar int vertex_indices", "list short float texture", "uchar last"),
    [[9, (0, 1, 2), (), 1], [8, (0, 1, 2, 3), (0.5, 0.25), 2], [7, (), (0.5,), 3]],
)


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("name", TYPES)
def test_numbers_of_every_type_and_format(points_of, kind, name):
    points = POINTS if TYPES[name] in "fd" else WHOLE
    rows = points if TYPES[name] in "fd" else points.astype(int)
    content = ply(kind, ("vertex", [f"{name} {axis}" for axis in "xyz"], rows.tolist()))
    tolerance = 1e-7 if TYPES[name] == "f" else 0
    np.testing.assert_allclose(points_of(content), points, rtol=tolerance)


@pytest.mark.parametrize("kind", FORMATS)
def test_coordinates_stand_among_other_properties(points_of, kind):
    properties = ("uchar red", "double z", "double x", "float nx", "double y")
    rows = [(200, z, x, 0.5, y) for x, y, z in POINTS.tolist()]
    np.testing.assert_array_equal(points_of(ply(kind, ("vertex", properties, rows))), POINTS)


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("faces", [TRIANGLES, POLYGONS, ("face", TRIANGLES[1], [])])
def test_faces_before_or_after_the_vertices_are_stepped_over(points_of, kind, faces):
    np.testing.assert_array_equal(points_of(ply(kind, VERTICES, faces)), POINTS)
    np.testing.assert_array_equal(points_of(ply(kind, faces, VERTICES)), POINTS)
    nothing = ("material", (), [])
    np.testing.assert_array_equal(points_of(ply(kind, nothing, faces, VERTICES)), POINTS)


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("sizes", [(2, 2, 2, 2), (0, 3, 1, 0)])
def test_vertices_may_have_lists(points_of, kind, sizes):
    properties = ("double x", "list uint uchar seen_from", "double y", "double z")
    rows = [(x, (5,) * n, y, z) for n, (x, y, z) in zip(sizes, POINTS.tolist(), strict=True)]
    np.testing.assert_array_equal(points_of(ply(kind, ("vertex", properties, rows))), POINTS)


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_line_ends_comments_and_notes(points_of, kind, newline):
    notes = ("comment made by a scanner, at 20 °C", "obj_info", "comment element of surprise")
    content = ply(kind, VERTICES, notes=notes, newline=newline)
    np.testing.assert_array_equal(points_of(content), POINTS)


def test_text_may_have_blank_lines_and_windows_line_ends(points_of):
    content = ply("ascii", VERTICES).replace(b"\n", b"\r\n\r\n")
    np.testing.assert_array_equal(points_of(content), POINTS)


@pytest.mark.parametrize("kind", FORMATS)
def test_unobserved_vertices(points_of, kind):
    points = POINTS.copy()
    points[1, 2] = np.nan
    points[2, 0] = -np.inf
    read = points_of(ply(kind, ("vertex", XYZ, points.tolist())))
    np.testing.assert_array_equal(np.isnan(read[:, 0]), [False, True, True, False])


def test_a_nan_that_signals_is_an_unobserved_point_and_no_warning(points_of):
    signalling = struct.pack("<I", 0x7FA00000)
    content = ply("binary_little_endian", ("vertex", ("float x", "float y", "float z"), POINTS))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read = points_of(content[:-4] + signalling)
    assert np.isnan(read[3]).all()


# ---- Range grids ------------------------------------------------------------------------------

SIZE = ("obj_info num_cols 3", "obj_info num_rows 2")
LISTS = ("list uchar int vertex_indices",)
GRID = [[()], [(1,)], [()], [()], [()], [(0,)]]


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("first", ["vertex", "range_grid"])
def test_range_grid_comes_out_organised(tmp_path, kind, first):
    elements = [VERTICES, ("range_grid", LISTS, GRID)]
    elements.sort(key=lambda element: element[0] != first)
    (tmp_path / "scan.ply").write_bytes(ply(kind, *elements, notes=SIZE))
    cloud = read_cloud(tmp_path / "scan.ply")
    assert cloud.shape == (2, 3)
    np.testing.assert_array_equal(cloud.points[0, 1], POINTS[1])
    np.testing.assert_array_equal(cloud.points[1, 2], POINTS[0])
    assert len(cloud) == 2


@pytest.mark.parametrize("kind", FORMATS)
def test_range_grid_without_and_with_every_pixel(points_of, kind):
    every = ply(kind, VERTICES, ("range_grid", LISTS, [[(i % 4,)] for i in range(6)]), notes=SIZE)
    np.testing.assert_array_equal(points_of(every)[1], POINTS[[3, 0, 1]])
    none = ply(kind, VERTICES, ("range_grid", LISTS, [[()]] * 6), notes=SIZE)
    assert np.isnan(points_of(none)).all()


@pytest.mark.parametrize(
    ("notes", "properties", "cells", "message"),
    [
        (SIZE, LISTS, GRID[:5], "has 5 cells, its obj_info says 3 x 2"),
        ((), LISTS, GRID, r"has 6 cells, its obj_info says no size \(num_cols, num_rows\)"),
        (("obj_info num_cols 6",), LISTS, GRID, "no size"),
        (("obj_info num_cols a", "obj_info num_rows 6"), LISTS, GRID, "no size"),
        (SIZE, LISTS, [[(4,)]] * 6, "vertices that are not in the file"),
        (SIZE, LISTS, [[(-1,)]] * 6, "vertices that are not in the file"),
        (SIZE, ("list uchar int cells",), GRID, "needs lists called 'vertex_indices'"),
        (SIZE, ("int vertex_indices",), [[1]] * 6, "needs lists called 'vertex_indices'"),
    ],
)
def test_bad_range_grid(points_of, notes, properties, cells, message):
    content = ply("ascii", VERTICES, ("range_grid", properties, cells), notes=notes)
    with pytest.raises(InputError, match=rf"c\.ply: .*{message}"):
        points_of(content)


# ---- What goes wrong --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ("format ascii 2.0", "line 2 .* 'format ascii 2.0', expected 'format KIND 1.0'"),
        ("format middle_endian 1.0", "line 2 .*expected 'format KIND 1.0'.*binary_big_endian"),
        ("format ascii 1.0\nformat ascii 1.0", "line 3 .*expected 'format"),
        ("comment no format", "no line 'format KIND 1.0'"),
        ("format ascii 1.0\nelement face", "line 3 .* 'element face', expected 'element NAME"),
        ("format ascii 1.0\nelement face -1", "line 3 .*expected 'element NAME COUNT'"),
        ("format ascii 1.0\nelement face 1e3", "line 3 .*expected 'element NAME COUNT'"),
        ("format ascii 1.0\nelement vertex 4", "line 4 .*each name once"),
        ("format ascii 1.0\nproperty float x", "line 3 .*after its element"),
        ("format ascii 1.0\nelement a 1\nproperty half x", "line 4 .*of types such as char"),
        ("format ascii 1.0\nelement a 1\nproperty list float int x", "line 4 .*property list TYPE"),
        (
            "format ascii 1.0\nelement a 1\nproperty int x\nproperty int x",
            "line 5 .*each name once",
        ),
        ("format ascii 1.0\nelement a 1", "promises 1 of element 'a' without any property"),
        ("format ascii 1.0\nfromat", "line 3 .* 'fromat', expected format, element, property"),
    ],
)
def test_a_malformed_header_is_named_with_its_line(points_of, wrong, message):
    content = ply("ascii", VERTICES).replace(b"format ascii 1.0", wrong.encode())
    with pytest.raises(InputError, match=rf"c\.ply: .*{message}"):
        points_of(content)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"solid teapot\n", "not a PLY file: it starts with 'solid teapot'"),
        (b"plyable\n", "not a PLY file"),
        (b"ply", "cut short: its PLY header has no line 'end_header'"),
        (b"ply\nformat ascii 1.0\nelement ver", "cut short: its PLY header"),
        (ply("ascii"), "no element 'vertex', found no element at all"),
        (ply("ascii", ("vertices", XYZ, [])), "no element 'vertex', found 'vertices'"),
        (ply("ascii", ("vertex", ("float x",), [[1.0]])), "numbers x, y and z, found x"),
        (
            ply("ascii", ("vertex", ("float x", "float y", "list char char z"), [])),
            "numbers x, y and z, found x, y, a list z",
        ),
    ],
)
def test_not_a_ply_file_of_points(points_of, content, message):
    with pytest.raises(InputError, match=rf"c\.ply: .*{message}"):
        points_of(content)


@pytest.mark.parametrize(
    ("line", "found"),
    [
        (b"1 2", "'1 2'"),
        (b"1 2 3 4", "'1 2 3 4'"),
        (b"1 2 three", "'1 2 three'"),
        (b"1,2,3", "'1,2,3'"),
        (b"1 2 \xb3", "'1 2 .'"),
    ],
)
@pytest.mark.parametrize("row", [0, 2, 3])
def test_a_malformed_line_is_named_with_its_number(points_of, line, found, row):
    rows = [b"1 2 3"] * 4
    rows[row] = line
    header = ply("ascii", ("vertex", XYZ, [])).replace(b"vertex 0", b"vertex 4")
    message = rf"c\.ply: line {row + 9} should hold the numbers x y z of element 'vertex', found "
    with pytest.raises(InputError, match=message + found):
        points_of(header + b"\n" + b"\n".join(rows) + b"\n")


@pytest.mark.parametrize("line", [b"1.0 4 7 8 2 3", b"1.0 -1 2 3", b"1.0 1.5 7 2 3", b"1.0"])
def test_a_malformed_list_is_named_with_its_line(points_of, line):
    properties = ("double x", "list int uchar seen", "double y", "double z")
    content = ply("ascii", ("vertex", properties, [])).replace(b"vertex 0", b"vertex 2")
    with pytest.raises(InputError, match=r"line 10 .*numbers x LENGTH seen y z of element"):
        points_of(content + b"1 2 7 8 2 3\n" + line + b"\n")


def test_a_list_of_negative_length(points_of):
    lists = ("face", ("list char char x",), [[(1, 2)], [()]])
    content = ply("binary_little_endian", lists, VERTICES)
    with pytest.raises(InputError, match="row 2 of element 'face' has a list 'x' of length -1"):
        points_of(content.replace(b"\x02\x01\x02\x00", b"\x02\x01\x02\xff"))


@pytest.mark.parametrize("kind", FORMATS)
def test_fewer_vertices_than_promised(points_of, kind):
    for promised in ("5", "999999999999999"):
        content = ply(kind, VERTICES).replace(b"vertex 4", f"vertex {promised}".encode())
        message = f"cut short: .*promises {promised} of element 'vertex', the file holds 4"
        with pytest.raises(InputError, match=message):
            points_of(content)


@pytest.mark.parametrize("kind", list(FORMATS)[1:])
@pytest.mark.parametrize("faces", [TRIANGLES, POLYGONS])
def test_a_file_cut_anywhere_in_its_faces_is_refused(points_of, kind, faces):
    content = ply(kind, VERTICES, faces)
    body = len(ply(kind, faces)) - len(ply(kind, (*faces[:2], [])))
    for missing in range(1, body + 1):
        with pytest.raises(InputError, match=r"promises [23] of element 'face', the file holds"):
            points_of(content[:-missing])


# ---- Other programs ---------------------------------------------------------------------------


@pytest.mark.parametrize("text", [True, False])
def test_what_open3d_writes_is_read_and_what_is_written_open3d_reads(tmp_path, text):
    open3d = pytest.importorskip("open3d")
    vectors = open3d.utility.Vector3dVector
    cloud = open3d.geometry.PointCloud(vectors(POINTS))
    cloud.colors = vectors(np.full((4, 3), 0.5))
    cloud.normals = vectors(np.eye(3)[[0, 1, 2, 0]])
    assert open3d.io.write_point_cloud(str(tmp_path / "cloud.ply"), cloud, write_ascii=text)
    triangles = open3d.utility.Vector3iVector([[0, 1, 2], [1, 2, 3]])
    mesh = open3d.geometry.TriangleMesh(vectors(POINTS), triangles)
    assert open3d.io.write_triangle_mesh(str(tmp_path / "mesh.ply"), mesh, write_ascii=text)
    for name in ("cloud.ply", "mesh.ply"):
        # Its text has six digits.
        np.testing.assert_allclose(read_cloud(tmp_path / name, samples=0).points, POINTS, rtol=1e-5)
    write_cloud(tmp_path / "own.ply", PointCloud(POINTS))
    read = open3d.io.read_point_cloud(str(tmp_path / "own.ply"))
    np.testing.assert_array_equal(np.asarray(read.points), POINTS)
