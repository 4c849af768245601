"""Files as other programs write them: read as they are meant, or refused with what was found."""

from __future__ import annotations

import numpy as np
import pytest

from hmrf_icp import InputError
from hmrf_icp.io import read_cloud

POINTS = np.array([[0.5, -1.25, 2.0], [3.0, 4.5, -5.0], [7.0, 8.0, 9.5], [1.0, 0.0, -2.0]])


def table(header, rows, mark=","):
    return "\n".join([header, *(mark.join(map(str, row)) for row in rows)]) + "\n"


@pytest.mark.parametrize(
    "header",
    [
        "intensity,id,Points:0,Points:1,Points:2",
        "time,name,px,py,pz",
        "id,class,X_m,Y_m,Z_m",
        "frame,beam,x [m],y [m],z [m]",
        "frame,beam,X (metres),Y (metres),Z (metres)",
        "PointID;Code;Easting;Northing;Height",
        '"OID","F","POINT_X","POINT_Y","POINT_Z"',
        "a b x [m] y [m] z [m]",
        "# a b pos_x pos_y pos_z",
    ],
)
def test_coordinates_are_found_by_the_names_that_people_give_them(tmp_path, header):
    mark = next((mark for mark in ";," if mark in header), " ")
    rows = [[90 + i, 7, *point] for i, point in enumerate(POINTS.tolist())]
    (tmp_path / "scan.csv").write_text(table(header, rows, mark))
    cloud = read_cloud(tmp_path / "scan.csv")
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert [values.tolist() for values in cloud.attributes.values()] == [[90, 91, 92, 93], [7] * 4]


@pytest.mark.parametrize("header", ["lat,lon,alt", "id,u,v,w", "x_mm,y_mm,z_mm", "a;b;c;d"])
def test_a_header_that_does_not_tell_is_refused_with_the_names_it_has(tmp_path, header):
    mark = ";" if ";" in header else ","
    names = header.split(mark)
    rows = [range(i, i + len(names)) for i in range(5)]
    (tmp_path / "scan.txt").write_text(table(header, rows, mark))
    found = ", ".join(repr(name) for name in names)
    with pytest.raises(InputError, match=rf"scan\.txt: line 1 names the columns {found}"):
        read_cloud(tmp_path / "scan.txt")


def test_normals_and_other_numbers_come_by_their_names(tmp_path):
    rows = [[*p, 0, 0, 1, "wall", 2**53 + 1, 0.5] for p in POINTS.tolist()]
    header = "x,y,z,Nx,Ny,Nz,label,stamp,gain"
    (tmp_path / "scan.csv").write_text(table(header, rows))
    cloud = read_cloud(tmp_path / "scan.csv")
    np.testing.assert_array_equal(cloud.normals, [[0, 0, 1]] * 4)
    assert cloud.attributes["stamp"].tolist() == [2**53 + 1] * 4, "every digit of an integer"
    assert sorted(cloud.attributes) == ["gain", "stamp"], "words are no numbers"


def test_a_column_with_a_gap_costs_that_column_alone(tmp_path):
    rows = [[*p, 5, gap, 1] for p, gap in zip(POINTS.tolist(), (1, 2, "", 4), strict=True)]
    rows[3][5] = 1.5
    (tmp_path / "scan.csv").write_text(table("x,y,z,a,b,c", rows))
    cloud = read_cloud(tmp_path / "scan.csv")
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert {name: v.tolist() for name, v in cloud.attributes.items()} == {
        "a": [5, 5, 5, 5],
        "c": [1.0, 1.0, 1.0, 1.5],
    }


def test_a_comma_inside_quotes_moves_no_column(tmp_path):
    rows = [['"desk, left"', *p] for p in POINTS.tolist()]
    (tmp_path / "scan.csv").write_text(table("name,x,y,z", rows))
    np.testing.assert_array_equal(read_cloud(tmp_path / "scan.csv").points, POINTS)


# ---- PCD, and what Windows' C library calls nan ------------------------------------------------

PCD = (
    "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 4\nHEIGHT 1\nPOINTS 4\n"
    "DATA ascii\n"
)
ROWS = "".join(f"{x} {y} {z}\n" for x, y, z in POINTS)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("TYPE F F F", "TYPE f f f"),
        ("FIELDS", "COLUMNS"),
        ("SIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n", ""),
        ("WIDTH 4\nHEIGHT 1\n", ""),
        ("DATA ascii", "DATA ASCII"),
        ("VERSION", "\ufeff# made by hand\nVersion"),
        ("\n", "\r\n"),
    ],
)
def test_headers_that_the_point_cloud_library_reads(tmp_path, old, new):
    (tmp_path / "c.pcd").write_bytes((PCD.replace(old, new) + ROWS).encode())
    np.testing.assert_array_equal(read_cloud(tmp_path / "c.pcd").points, POINTS)


def test_a_header_that_says_a_thing_twice_is_refused(tmp_path):
    (tmp_path / "c.pcd").write_text("FIELDS y x z\n" + PCD + ROWS)
    with pytest.raises(InputError, match="two lines FIELDS"):
        read_cloud(tmp_path / "c.pcd")


NOT_FINITE = ("-nan(ind)", "nan(snan)", "1.#QNAN", "-1.#IND00", "1.#INF", "-1.#INF000", "nan")


@pytest.mark.parametrize("word", NOT_FINITE)
@pytest.mark.parametrize("suffix", [".pcd", ".ply", ".csv", ".xyz"])
def test_no_number_in_every_spelling_is_an_unobserved_point(tmp_path, word, suffix):
    rows = ROWS.replace("3.0 4.5 -5.0", f"{word} {word} {word}")
    header = {
        ".pcd": PCD,
        ".ply": "ply\nformat ascii 1.0\nelement vertex 4\n"
        + "".join(f"property float {axis}\n" for axis in "xyz")
        + "end_header\n",
        ".csv": "x y z\n",
        ".xyz": "",
    }
    (tmp_path / f"c{suffix}").write_text(header[suffix] + rows)
    cloud = read_cloud(tmp_path / f"c{suffix}")
    assert cloud.observed.tolist() == [True, False, True, True]
    np.testing.assert_array_equal(cloud.observed_points, POINTS[[0, 2, 3]])
