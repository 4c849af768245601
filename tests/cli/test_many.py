"""``hmrf-icp register`` on many pairs: rows, resumption, exit status, files."""

from __future__ import annotations

import csv
import json
import sys
from dataclasses import replace

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import PinholeCamera, PointCloud, se3
from hmrf_icp.cli import main, many
from hmrf_icp.cli.pairs import Pair, asked_for, labels, read_pairs, stems
from hmrf_icp.errors import InputError, RegistrationWarning
from hmrf_icp.io import read_cloud, read_pose, write_cloud, write_pose

CAMERA = PinholeCamera(width=48, height=36, fx=50.0, fy=50.0, cx=23.5, cy=17.5)
TRUTH = se3.exp([0.004, -0.006, 0.005, 0.004, 0.003, -0.002])


@pytest.fixture
def command(monkeypatch, capsys):
    """Run ``hmrf-icp register`` with arguments: exit status, stdout, stderr."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["hmrf-icp", "register", *map(str, arguments)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as stop:
            main()
        return stop.value.code, *capsys.readouterr()

    return run


def surface():
    v, u = np.mgrid[:36, :48].astype(float)
    depth = 1.5 + 0.12 * np.sin(u / 5) + 0.1 * np.cos(v / 4) + 0.08 * np.sin((u + 2 * v) / 9)
    return PointCloud.from_depth(depth, CAMERA).observed_points


@pytest.fixture
def scans(tmp_path, monkeypatch):
    """A folder with two scans, their target among them, and what is none."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "scans"
    folder.mkdir()
    for name in ("scan-2.ply", "scan-10.pcd"):
        write_cloud(folder / name, PointCloud(se3.transform(se3.inverse(TRUTH), surface())))
    write_cloud(folder / "target.ply", PointCloud(surface()))
    (folder / "camera.txt").write_text("1 0 0\n")
    (folder / "README.md").write_text("scans")
    return folder


@pytest.fixture
def registered(monkeypatch):
    """The sources that were registered, and as how believable: one real result stands for all."""
    points = surface()
    found = hmrf_icp.register(points[::3], points[::3], rejector="all")
    calls = []

    class Registered:
        clouds = calls
        confidence = 0.9

    def stub(source, target, init, **options):
        calls.append((source, target, init))
        return replace(found, confidence=Registered.confidence)

    monkeypatch.setattr(hmrf_icp, "register", stub)
    return Registered


def rows_of(path):
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_a_folder_onto_one_target(command, scans):
    status, out, err = command(
        scans, scans / "target.ply", "--table", "t.csv", "-o", "out", "--pose", "out"
    )
    assert status == 0
    assert "Warning" not in err
    lines = out.splitlines()
    assert [line.split()[:2] for line in lines[1:3]] == [
        ["scan-2.ply", "believed"],
        ["scan-10.pcd", "believed"],
    ], "in the order of their numbers, without the target"
    assert "2 believed" in out
    for row, stem in zip(rows_of(scans.parent / "t.csv"), ("scan-2", "scan-10"), strict=True):
        pose = read_pose(scans.parent / "out" / f"{stem}.txt")
        np.testing.assert_allclose(pose, TRUTH, atol=1e-5)
        told = np.array([float(word) for word in row["transformation"].split()])
        np.testing.assert_allclose(told.reshape(4, 4), pose, atol=1e-12)
        assert row["verdict"] == "believed"
    moved = read_cloud(scans.parent / "out" / "scan-10.pcd").observed_points
    np.testing.assert_allclose(moved, surface(), atol=1e-5)


def test_json_is_an_object_a_line_and_nothing_else(command, scans, registered):
    (scans / "broken.ply").write_text("ply\nrubbish")
    status, out, err = command(scans, scans / "target.ply", "--json", "--table", "t.csv")
    assert status == 2
    content = [json.loads(line) for line in out.splitlines()]
    assert [one["source"].rpartition("/")[2] for one in content] == [
        "broken.ply",
        "scan-2.ply",
        "scan-10.pcd",
    ]
    assert [one["believed"] for one in content] == [False, True, True]
    assert "end_header" in content[0]["error"]
    assert content[0]["confidence"] is content[0]["transformation"] is None
    assert "Error: " in err
    assert "1 failed" in err
    _, again, _ = command(scans, scans / "target.ply", "--json", "--table", "t.csv")
    kept = [json.loads(line) for line in again.splitlines()][1:]
    for new, old in zip(content[1:], kept, strict=True):
        assert old["from_table"] is True
        for name in ("source", "target", "believed", "confidence", "overlap", "transformation"):
            assert old[name] == new[name]


def test_quiet_says_what_went_wrong_alone(command, scans, registered):
    assert command(scans, scans / "target.ply", "-q") == (0, "", "")
    (scans / "broken.ply").write_text("ply\nrubbish")
    status, out, err = command(scans, scans / "target.ply", "--quiet")
    assert (status, out) == (2, "")
    assert [line.partition(":")[0] for line in err.splitlines()] == ["Error"]


@pytest.mark.parametrize(("confidence", "status"), [(0.9, 0), (0.1, 1)])
def test_the_status_is_0_for_all_believed_alone(command, scans, registered, confidence, status):
    registered.confidence = confidence
    assert command(scans, scans / "target.ply")[0] == status


def test_the_same_command_goes_on_from_its_table(command, scans, registered, tmp_path):
    arguments = (scans, scans / "target.ply", "--table", "t.csv", "--pose", "poses")
    broken = scans / "broken.ply"
    broken.write_text("ply\nrubbish")
    assert command(*arguments)[0] == 2
    assert len(registered.clouds) == 2
    write_cloud(broken, PointCloud(surface()))
    status, out, _ = command(*arguments)
    assert status == 0
    assert len(registered.clouds) == 3, "only the one that failed is done again"
    assert "3 believed" in out
    (tmp_path / "poses" / "scan-2.txt").unlink()
    command(*arguments)
    assert len(registered.clouds) == 4, "and the one whose file is gone"
    status, _, err = command(*arguments, "--rejector", "x84")
    assert status == 2
    assert '"rejector": "x84"' in err


def test_an_interrupt_keeps_what_is_done(command, scans, registered, monkeypatch, tmp_path):
    stub = hmrf_icp.register

    def interrupted(*arguments, **options):
        if registered.clouds:
            raise KeyboardInterrupt
        return stub(*arguments, **options)

    monkeypatch.setattr(hmrf_icp, "register", interrupted)
    arguments = (scans, scans / "target.ply", "--table", "t.csv")
    status, out, err = command(*arguments)
    assert status == 130
    assert "scan-2.ply" in out
    assert "1 of 2 are done and kept in t.csv; the same command goes on from there" in err
    assert [row["source"] for row in rows_of(tmp_path / "t.csv")] == [str(scans / "scan-2.ply")]
    monkeypatch.setattr(hmrf_icp, "register", stub)
    assert command(*arguments)[0] == 0
    assert len(registered.clouds) == 2


def test_the_target_is_read_and_prepared_once(command, scans, registered, monkeypatch):
    prepared, prepare = [], many.prepare
    monkeypatch.setattr(
        many,
        "prepare",
        lambda cloud, name, view: prepared.append(name) or prepare(cloud, name, view),
    )
    command(scans, scans / "target.ply")
    assert sorted(prepared) == sorted(
        str(scans / name) for name in ("target.ply", "scan-2.ply", "scan-10.pcd")
    )
    first, second = (target for _, target, _ in registered.clouds)
    assert first is second


def test_each_pair_of_a_list_has_its_own_target_and_start(command, scans, registered, tmp_path):
    write_pose(tmp_path / "start.txt", TRUTH)
    (tmp_path / "list.txt").write_text(
        "scans/scan-2.ply scans/target.ply start.txt\nscans/target.ply scans/scan-10.pcd\n"
    )
    status, out, _ = command("--pairs", "list.txt", "--pose", "poses")
    assert status == 0
    assert [init is None for *_, init in registered.clouds] == [False, True]
    assert out.splitlines()[0].split()[:3] == ["source", "target", "start"]
    assert {file.name for file in (tmp_path / "poses").iterdir()} == {
        "scan-2-to-target.txt",
        "target-to-scan-10.txt",
    }


def test_what_the_library_warns_of_names_its_file(command, scans, registered, monkeypatch):
    import warnings

    stub = hmrf_icp.register

    def warning(*arguments, **options):
        warnings.warn("source: 12 points stand for nothing", RegistrationWarning, stacklevel=2)
        warnings.warn("target: 3 points stand for nothing", RegistrationWarning, stacklevel=2)
        return stub(*arguments, **options)

    monkeypatch.setattr(hmrf_icp, "register", warning)
    _, _, err = command(scans, scans / "target.ply")
    assert err.count("scan-2.ply: source: 12 points") == 1
    assert err.count("target.ply: target: 3 points") == 1


@pytest.mark.parametrize("width", [60, 80])
def test_no_two_rows_of_the_table_look_the_same(
    command, scans, registered, monkeypatch, width, tmp_path
):
    monkeypatch.setenv("COLUMNS", str(width))
    long = "a-recording-with-a-name-that-is-longer-than-any-terminal-is-wide-"
    for k in range(3):
        write_cloud(tmp_path / f"{long}{k}.ply", PointCloud(surface()))
    sources = sorted(tmp_path.glob("a-*.ply"))
    _, out, _ = command(*sources, scans / "target.ply")
    assert max(map(len, out.splitlines())) <= width
    rows = [line for line in out.splitlines() if " believed " in line and "%" in line]
    assert len({line.split()[0] for line in rows}) == len(rows) == 3


# ---- What is asked for ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["scans", "scans/target.ply", "-o", "scans"], "is an input of this run"),
        (["scans", "scans/target.ply", "-o", "all.ply"], "of many pairs it is a folder"),
        (["scans", "scans/target.ply", "--pose", "old.txt"], "of many pairs it is a folder"),
        (["scans", "scans/target.ply", "--table", "old.txt"], "is not a table of this command"),
        (["scans", "scans/nobody.ply"], "nobody.ply: no such file"),
        (["empty", "scans/target.ply"], "is a directory in which no file ends in"),
        (["scans", "scans/target.ply", "--html", "a.html"], "is for one pair alone"),
        (["scans"], "expected SOURCE and TARGET"),
        (["scans", "scans/target.ply", "--pairs", "old.txt"], "not both"),
        (["--pairs", "old.txt"], "has 1 entries"),
        (["--pairs", "nobody.txt"], "no such file"),
    ],
)
def test_what_cannot_be_is_refused_before_the_work(
    command, scans, registered, tmp_path, arguments, said
):
    (tmp_path / "old.txt").write_text("something")
    (tmp_path / "empty").mkdir()
    before = sorted(tmp_path.rglob("*"))
    status, out, err = command(*arguments)
    assert (status, out) == (2, "")
    assert said in err
    assert not registered.clouds
    assert sorted(tmp_path.rglob("*")) == before


def test_a_list_may_have_commas_quotes_comments_and_a_heading(tmp_path):
    listed = tmp_path / "list.csv"
    listed.write_text(
        'source,target,init\na.ply,b.ply,\n# not this\n\n"with, comma.ply", "b c.ply", p.txt\n'
        "'with blank.ply' /there/b.ply\n"
    )
    assert read_pairs(listed) == [
        Pair(tmp_path / "a.ply", tmp_path / "b.ply"),
        Pair(tmp_path / "with, comma.ply", tmp_path / "b c.ply", tmp_path / "p.txt"),
        Pair(tmp_path / "with blank.ply", type(tmp_path)("/there/b.ply")),
    ]
    listed.write_text("a.ply 'b.ply\n")
    with pytest.raises(InputError, match="line 1 has a quote"):
        read_pairs(listed)


def test_two_files_are_one_pair_unless_a_table_is_asked_for(tmp_path):
    a, b = tmp_path / "a.ply", tmp_path / "b.ply"
    assert asked_for([a], b, None, None, None) == Pair(a, b)
    assert asked_for([a], b, None, None, tmp_path / "t.csv") == (Pair(a, b),)
    assert asked_for([a, b, a], b, None, None, None) == (Pair(a, b), Pair(b, b))


def test_names_are_as_short_as_tells_them_apart(tmp_path):
    files = [tmp_path / name for name in ("x/1/a.ply", "x/2/a.ply", "b.ply", "b.pcd")]
    assert list(labels(files).values()) == ["1/a.ply", "2/a.ply", "b.ply", "b.pcd"]
    pairs = [Pair(file, tmp_path / "t.ply") for file in (*files, tmp_path / "1-a.ply")]
    named = [name.lower() for name in stems(pairs).values()]
    assert len(set(named)) == len(pairs)
