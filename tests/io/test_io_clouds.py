"""A cloud comes back from every format as it was written."""

from __future__ import annotations

import importlib.util
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from hmrf_icp import InputError, PinholeCamera, PointCloud
from hmrf_icp.io import WRITABLE, read_cloud, write_cloud
from hmrf_icp.io.lzf import decompress

NEEDED = {".las": "laspy", ".laz": "lazrs", ".e57": "pye57"}
COORDINATES = st.one_of(
    st.floats(-1e6, 1e6, allow_subnormal=False), st.sampled_from([np.nan, np.inf, -np.inf])
)
UNORGANISED = hnp.arrays(
    np.float64, st.tuples(st.integers(1, 12), st.just(3)), elements=COORDINATES
)
ORGANISED = hnp.arrays(
    np.float64, st.tuples(st.integers(2, 5), st.integers(2, 5), st.just(3)), elements=COORDINATES
)
POINTS = np.array([[0.125, -1.5, 2.0], [3.0, 4.25, -5.5], [1e-3, 0.1, 1 / 3], [7.0, 8.0, 9.0]])


@settings(max_examples=40)
@given(points=UNORGANISED)
def test_every_format_keeps_the_observed_points(points, tmp_path_factory):
    cloud = PointCloud(points)
    if not len(cloud):
        return
    for suffix in WRITABLE:
        library = NEEDED.get(suffix)
        if library is not None and importlib.util.find_spec(library) is None:
            continue
        path = tmp_path_factory.mktemp("cloud") / f"c{suffix}"
        write_cloud(path, cloud)
        read = read_cloud(path).observed_points
        tolerance = 1e-4 if suffix == ".pcd" else 0.0  # which may hold single precision
        if suffix in (".las", ".laz"):  # a power of ten less than a billionth of the size
            tolerance = 1e-8 * np.ptp(cloud.observed_points, axis=0).max()
        np.testing.assert_allclose(read, cloud.observed_points, rtol=0, atol=tolerance)


@settings(max_examples=40)
@given(points=ORGANISED)
def test_pcd_npy_and_npz_keep_the_grid(points, tmp_path_factory):
    cloud = PointCloud(points)
    for suffix in (".pcd", ".npy", ".npz"):
        path = tmp_path_factory.mktemp("grid") / f"c{suffix}"
        write_cloud(path, cloud)
        np.testing.assert_allclose(read_cloud(path).points, cloud.points, rtol=0, atol=1e-4)


def test_npz_keeps_the_camera_and_the_viewpoint(tmp_path):
    camera = PinholeCamera(width=3, height=2, fx=3.0, fy=3.1, cx=1.0, cy=0.5)
    write_cloud(tmp_path / "c.npz", PointCloud(np.ones((2, 3, 3)), camera))
    assert read_cloud(tmp_path / "c.npz").camera == camera
    write_cloud(tmp_path / "v.npz", PointCloud(POINTS, viewpoint=[1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(read_cloud(tmp_path / "v.npz").viewpoint, [1.0, 2.0, 3.0])


def test_npz_of_one_array_or_of_several(tmp_path):
    np.savez(tmp_path / "one.npz", whatever=POINTS)
    np.testing.assert_array_equal(read_cloud(tmp_path / "one.npz").points, POINTS)
    np.savez(tmp_path / "two.npz", a=POINTS, b=POINTS)
    with pytest.raises(InputError, match=r"two\.npz: expected an array called 'points', found 'a'"):
        read_cloud(tmp_path / "two.npz")


def test_single_precision_of_pcd_is_left_where_it_would_move_points(tmp_path):
    northings = POINTS + np.array([500_000.0, 5_300_000.0, 400.0])
    write_cloud(tmp_path / "c.pcd", PointCloud(northings))
    np.testing.assert_array_equal(read_cloud(tmp_path / "c.pcd").points, northings)


# ---- PCD -------------------------------------------------------------------------------------


def pcd(
    data,
    body,
    fields="x y z",
    size="4 4 4",
    kind="F F F",
    count="1 1 1",
    grid=(4, 1),
    viewpoint="0 0 0 1 0 0 0",
    points=None,
):
    header = (
        f"# .PCD v.7\nVERSION .7\nFIELDS {fields}\nSIZE {size}\nTYPE {kind}\nCOUNT {count}\n"
        f"WIDTH {grid[0]}\nHEIGHT {grid[1]}\nVIEWPOINT {viewpoint}\n"
        f"POINTS {grid[0] * grid[1] if points is None else points}\nDATA {data}\n"
    )
    return header.encode() + body


def literals(data):
    """LZF that compresses nothing: runs of literal bytes."""
    runs = [data[at : at + 32] for at in range(0, len(data), 32)]
    return b"".join(bytes([len(run) - 1]) + run for run in runs)


def packed(data):
    body = literals(data)
    return np.array([len(body), len(data)], "<u4").tobytes() + body


def columns(*arrays):
    return b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)


SINGLE = POINTS.astype("<f4")


@pytest.mark.parametrize(
    "content",
    [
        pcd("ascii", b"".join(b"%r %r %r\n" % tuple(p) for p in SINGLE.tolist())),
        pcd("binary", SINGLE.tobytes()),
        pcd("binary_compressed", packed(columns(*SINGLE.T))),
    ],
    ids=["ascii", "binary", "compressed"],
)
def test_pcd_of_every_kind_of_data(tmp_path, content):
    (tmp_path / "c.pcd").write_bytes(content)
    np.testing.assert_array_equal(read_cloud(tmp_path / "c.pcd").points, SINGLE.astype(float))


def test_pcd_with_other_fields_and_padding(tmp_path):
    rows = np.zeros(4, "<u1, (3,)<f4, <f8, <f8, <f8")
    for axis in range(3):
        rows[f"f{axis + 2}"] = POINTS[:, axis]
    layout = {
        "fields": "_ normal x y z",
        "size": "1 4 8 8 8",
        "kind": "U F F F F",
        "count": "1 3 1 1 1",
    }
    (tmp_path / "b.pcd").write_bytes(pcd("binary", rows.tobytes(), **layout))
    fields = columns(*(rows[name] for name in rows.dtype.names))
    (tmp_path / "c.pcd").write_bytes(pcd("binary_compressed", packed(fields), **layout))
    text = "".join(f"0 0 0 0 {x!r} {y!r} {z!r}\n" for x, y, z in POINTS.tolist())
    (tmp_path / "a.pcd").write_bytes(pcd("ascii", text.encode(), **layout))
    for name in "abc":
        np.testing.assert_array_equal(read_cloud(tmp_path / f"{name}.pcd").points, POINTS)


def test_pcd_higher_than_one_row_is_organised(tmp_path):
    points = POINTS.copy()
    points[1] = np.nan
    body = "".join(f"{x} {y} {z}\n" for x, y, z in points)
    (tmp_path / "c.pcd").write_bytes(pcd("ascii", body.encode(), grid=(2, 2)))
    cloud = read_cloud(tmp_path / "c.pcd")
    assert cloud.shape == (2, 2)
    assert not cloud.observed[0, 1]
    np.testing.assert_array_equal(cloud.points[1, 0], POINTS[2])


def test_pcd_with_a_nan_that_signals(tmp_path):
    bits = SINGLE.view("<u4").copy()
    bits[3, 2] = 0x7FA00000
    (tmp_path / "c.pcd").write_bytes(pcd("binary", bits.tobytes()))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cloud = read_cloud(tmp_path / "c.pcd")
    assert cloud.observed.tolist() == [True, True, True, False]


@pytest.mark.parametrize(
    ("viewpoint", "expected"),
    [
        ("1 2 3 1 0 0 0", [1, 2, 3]),
        ("1 2 3 -1 0 0 0", [1, 2, 3]),
        ("0 0 0 1 0 0 0", None),
        ("1 2 3 0 1 0 0", None),
        ("nan 2 3 1 0 0 0", None),
    ],
)
def test_pcd_viewpoint_moves_no_point(tmp_path, viewpoint, expected):
    (tmp_path / "c.pcd").write_bytes(pcd("binary", SINGLE.tobytes(), viewpoint=viewpoint))
    cloud = read_cloud(tmp_path / "c.pcd")
    np.testing.assert_array_equal(cloud.points, SINGLE.astype(float))
    assert (None if cloud.viewpoint is None else cloud.viewpoint.tolist()) == expected


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (pcd("binary", SINGLE.tobytes()[:-1]), "promises 4 points, the file holds 3"),
        (pcd("ascii", b"1 2 3\n4 5 6\n"), "promises 4 points, the file holds 2"),
        (pcd("ascii", b"1 2 3\n4 5\n" * 2), "point 2 has 2 numbers"),
        (pcd("ascii", b"1 2 z\n" * 4), "cannot be read as a PCD"),
        (pcd("binary_compressed", packed(bytes(48))[:-9]), "cut short"),
        (pcd("binary_compressed", b"\1\0"), "cut short"),
        (pcd("binary_compressed", packed(bytes(36))), "holds 3"),
        (pcd("binary_compressed", b"\4\0\0\0\x30\0\0\0\xe0\1\1\1"), "damaged"),
        (pcd("binary_magic", b""), "DATA 'binary_magic'"),
        (pcd("binary", SINGLE.tobytes(), fields="x y w"), "no field z"),
        (pcd("binary", SINGLE.tobytes(), size="4 4"), "differ in length"),
        (pcd("binary", SINGLE.tobytes(), size="3 4 4"), "TYPE F, SIZE 3"),
        (pcd("binary", SINGLE.tobytes(), points=5), "5 points on a grid of 4 x 1"),
        (pcd("binary", SINGLE.tobytes(), grid=(-4, 1), points=4), "WIDTH -4"),
        (pcd("binary", SINGLE.tobytes(), grid=("four", 0), points=4), "whole numbers for WIDTH"),
        (pcd("binary", b"", viewpoint="a b"), "VIEWPOINT a b"),
        (b"ply\n", "not a PCD file"),
        (b"VERSION .7\nFIELDS x y z", "no DATA line"),
        (b"solid teapot\n" * 3, "not a PCD file"),
    ],
)
def test_bad_pcd(tmp_path, content, message):
    (tmp_path / "c.pcd").write_bytes(content)
    with pytest.raises(InputError, match=rf"c\.pcd: .*{message}"):
        read_cloud(tmp_path / "c.pcd")


def test_lzf_by_hand():
    # "ab", then 4 bytes from 2 back: the reference runs into what it writes.
    assert decompress(b"\x01ab\x40\x01", 6) == b"ababab"
    # A long reference: 2 + 7 + 5 bytes from 1 back.
    assert decompress(b"\x00a\xe0\x05\x00", 15) == b"a" * 15
    for damaged in (b"\x01a", b"\x40", b"\x00a\xe0\x05", b"\x40\x01", b"\x00a"):
        with pytest.raises(ValueError, match=r"cut short|damaged|promised"):
            decompress(damaged, 15)


# ---- Text ------------------------------------------------------------------------------------

ROWS = [[1.0, 2.0, 3.0], [-4.5, 5.0, 6e-3]]


@pytest.mark.parametrize(
    "content",
    [
        "1 2 3\n-4.5 5 6e-3\n",
        "1,2,3\n-4.5,5,6e-3",
        "1, 2, 3\r\n-4.5, 5, 6e-3\r\n",
        "1;2;3\n-4.5;5;6e-3\n\n",
        "1\t2\t3\n-4.5\t5\t6e-3\n",
        "  1   2 3 255 0 0\n\n -4.5 5 6e-3 1 2 3\n",
        "x,y,z\n1,2,3\n-4.5,5,6e-3\n",
        "\ufeffX;Y;Z\n1;2;3\n-4.5;5;6e-3\n",
        "//X Y Z R\n1 2 3 9\n-4.5 5 6e-3 9\n",
        "# a scan\n# x y z\n1 2 3\n# half way\n-4.5 5 6e-3\n",
        'id,"z","y","x"\na,3,2,1\nb,6e-3,5,-4.5\n',
        "point id,z,y,x\na,3,2,1\nb,6e-3,5,-4.5\n",
        ",x,y,z\n0,1,2,3\n1,-4.5,5,6e-3\n",
        "A title\n1 2 3\n-4.5 5 6e-3\n",
    ],
)
@pytest.mark.parametrize("suffix", [".xyz", ".csv", ".txt"])
def test_text_in_the_ways_that_people_write_it(tmp_path, content, suffix):
    (tmp_path / f"c{suffix}").write_bytes(content.encode())
    np.testing.assert_array_equal(read_cloud(tmp_path / f"c{suffix}").points, ROWS)


def test_text_with_unobserved_points(tmp_path):
    (tmp_path / "c.csv").write_text("1,2,3\nnan,nan,nan\n4,5,inf\n")
    assert read_cloud(tmp_path / "c.csv").observed.tolist() == [True, False, False]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"1 2 3\n4 5\n", "line 2 should hold three numbers or more, found '4 5'"),
        (b"x,y,z\n1,2,3\n\n4,five,6\n", "line 4 .*found '4,five,6'"),
        (b"1,5 2,5 3,5\n", "line 1"),
        (b"1 2\n3 4\n", "line 1"),
        (b"100\n1 2 3\n", "line 1"),
        (b"x y z\n", "no points"),
        (b"\n \n", "no points"),
        (b"\x93NUMPY\x01\x00v\x00", "cannot be read"),
    ],
)
def test_bad_text(tmp_path, content, message):
    (tmp_path / "c.xyz").write_bytes(content)
    with pytest.raises(InputError, match=rf"c\.xyz: .*{message}"):
        read_cloud(tmp_path / "c.xyz")


# ---- NPY -------------------------------------------------------------------------------------


def test_npy_holds_a_cloud_or_a_depth_map_by_its_shape(tmp_path):
    np.save(tmp_path / "n.npy", POINTS)
    assert read_cloud(tmp_path / "n.npy").shape == (4,)
    np.save(tmp_path / "g.npy", POINTS.reshape(2, 2, 3))
    assert read_cloud(tmp_path / "g.npy").shape == (2, 2)
    np.save(tmp_path / "d.npy", np.ones((30, 40)))
    camera = PinholeCamera(width=40, height=30, fx=40.0, fy=40.0, cx=20.0, cy=15.0)
    assert read_cloud(tmp_path / "d.npy", camera).camera == camera


def test_bad_npy(tmp_path):
    np.save(tmp_path / "s.npy", np.ones((2, 2, 5)))
    with pytest.raises(InputError, match=r"s\.npy: .*shape"):
        read_cloud(tmp_path / "s.npy")
    np.save(tmp_path / "t.npy", np.array(["a", "b"]))
    with pytest.raises(InputError, match=r"t\.npy: expected an array of numbers"):
        read_cloud(tmp_path / "t.npy")
    np.save(tmp_path / "o.npy", np.array([{}, None]), allow_pickle=True)
    with pytest.raises(InputError, match=r"o\.npy: expected an array of numbers"):
        read_cloud(tmp_path / "o.npy")
    np.savez(tmp_path / "z.npz", points=POINTS)
    (tmp_path / "z.npz").rename(tmp_path / "z.npy")
    with pytest.raises(InputError, match=r"z\.npy: an NPZ archive by the name"):
        read_cloud(tmp_path / "z.npy")
