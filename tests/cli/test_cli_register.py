"""``hmrf-icp register``, as someone at a terminal meets it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import warnings
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

import hmrf_icp
from hmrf_icp import PinholeCamera, PointCloud, presets, se3
from hmrf_icp.cli import main
from hmrf_icp.io import read_cloud, read_pose, write_cloud, write_pose

CAMERA = PinholeCamera(width=48, height=36, fx=50.0, fy=50.0, cx=23.5, cy=17.5)
INTRINSICS = ("--intrinsics", "50,50,23.5,17.5")
TRUTH = se3.exp([0.004, -0.006, 0.005, 0.004, 0.003, -0.002])


@pytest.fixture
def command(monkeypatch, capsys):
    """Run ``hmrf-icp`` with arguments: exit status, stdout, stderr."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["hmrf-icp", *map(str, arguments)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as stop:
            main()
        return stop.value.code, *capsys.readouterr()

    return run


def surface():
    """A wall with three waves, which fixes all six degrees of freedom; metres."""
    v, u = np.mgrid[:36, :48].astype(float)
    return 1.5 + 0.12 * np.sin(u / 5) + 0.1 * np.cos(v / 4) + 0.08 * np.sin((u + 2 * v) / 9)


@pytest.fixture
def pair(tmp_path):
    """Two depth maps of one view, in millimetres, each with other holes."""
    for name, hole in (("source", np.s_[5:9, 5:12]), ("target", np.s_[20:26, 30:40])):
        depth = np.round(1000 * surface()).astype(np.uint16)
        depth[hole] = 0
        Image.fromarray(depth).save(tmp_path / f"{name}.png")
    return tmp_path / "source.png", tmp_path / "target.png"


@pytest.fixture
def clouds(tmp_path):
    """An organised source and an unorganised target that is the source moved by TRUTH."""
    source = PointCloud.from_depth(surface(), CAMERA)
    write_cloud(tmp_path / "source.pcd", source)
    target = PointCloud(se3.transform(TRUTH, source.observed_points))
    write_cloud(tmp_path / "target.ply", target)
    return tmp_path / "source.pcd", tmp_path / "target.ply"


def test_two_depth_maps(command, pair):
    status, out, err = command("register", *pair, *INTRINSICS)
    assert status == 0
    assert "source.png to target.png: to be believed, confidence 0.9" in out
    assert "converged after" in out
    assert "overlap" in out
    assert "transformation, source to target:" in out
    assert not [line for line in err.splitlines() if "compiling" not in line]


def test_json_is_one_strict_object_and_nothing_else(command, clouds):
    def refuse(constant):
        raise AssertionError(f"{constant} is not JSON")

    status, out, err = command("register", *clouds, "--json")
    content = json.loads(out, parse_constant=refuse)
    assert status == 0
    assert {
        "transformation",
        "believed",
        "confidence",
        "visibility",
        "source_view",
        "converged",
        "iterations",
        "em_iterations",
        "overlap",
        "inlier_rmse",
        "seconds",
    } <= content.keys()
    assert out.count("\n") == 1
    assert content["converged"] is True
    assert content["believed"] is True
    assert content["visibility"].keys() > {"agree", "front", "views"}
    assert np.shape(content["transformation"]) == (4, 4)
    assert 0 <= content["overlap"] <= 1
    assert content["preset"] == presets.DEFAULT
    assert "transformation, source to target" in err, "what is for people stands on stderr"


def test_a_profile_is_a_table_and_a_list_in_json(command, clouds):
    _, out, _ = command("register", *clouds, "--profile")
    head, *rows = out[out.index("  stage") :].splitlines()
    assert head.split() == ["stage", "own", "time", "share", "calls"]
    shares = [float(row.rpartition("%")[0].split()[-1]) for row in rows if "%" in row]
    assert sum(shares) == pytest.approx(100.0, abs=0.1 * len(shares))

    _, out, _ = command("register", *clouds, "--profile", "--json")
    content = json.loads(out)["profile"]
    result = hmrf_icp.register(*map(read_cloud, clouds), profile=True)
    assert {stage["name"]: stage["calls"] for stage in content} == {
        stage.name: stage.calls for stage in result.profile
    }
    assert all(stage["seconds"] >= 0 for stage in content)


def test_without_asking_there_is_no_profile(command, clouds):
    _, out, err = command("register", *clouds, "--json")
    assert "profile" not in json.loads(out)
    assert "own time" not in err


def test_json_says_what_the_library_says(command, clouds):
    _, out, _ = command("register", *clouds, "--json", "--rejector", "x84")
    result = hmrf_icp.register(*map(read_cloud, clouds), rejector="x84")
    content = json.loads(out)
    np.testing.assert_array_equal(content["transformation"], result.transformation)
    assert content["iterations"] == result.iterations
    assert content["overlap"] == result.overlap


def test_another_metric_and_what_a_bare_wall_leaves_free(command, tmp_path):
    slope = np.add.outer(np.arange(36) * 0.3, np.arange(48) * 0.2)
    Image.fromarray(np.round(1500 + slope).astype(np.uint16)).save(tmp_path / "wall.png")
    wall = tmp_path / "wall.png"
    options = (*INTRINSICS, "--rejector", "all", "--aligner", "point-to-plane")
    _, out, _ = command("register", wall, wall, *options)
    assert "slide along themselves" in out
    assert out.count("translation along") == 2
    _, out, _ = command("register", wall, wall, *options, "--json")
    content = json.loads(out)
    assert content["aligner"] == "point-to-plane"
    assert np.shape(content["information"]) == (6, 6)
    assert [np.shape(free["twist"]) for free in content["degenerate"]] == [(6,)] * 3
    assert content["degenerate"][0]["motion"].startswith("rotation about")


def test_an_unknown_metric_is_named(command, clouds):
    status, out, err = command("register", *clouds, "--aligner", "chamfer")
    assert (status, out) == (2, "")
    assert "aligner: unknown 'chamfer'" in err
    assert "plane-to-plane" in err


def test_the_start_is_used(command, clouds, tmp_path):
    write_pose(tmp_path / "init.txt", TRUTH)
    status, out, _ = command("register", *clouds, "--init", tmp_path / "init.txt", "--json")
    assert status == 0
    np.testing.assert_allclose(json.loads(out)["transformation"], TRUTH, atol=1e-3)


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".xyz", ".csv", ".npy", ".npz"])
def test_output_is_the_source_in_the_frame_of_the_target(command, clouds, tmp_path, suffix):
    aligned = tmp_path / f"aligned{suffix}"
    _, out, err = command("register", *clouds, "--json", "--output", aligned)
    motion = np.array(json.loads(out)["transformation"])
    expected = se3.transform(motion, read_cloud(clouds[0]).observed_points)
    np.testing.assert_allclose(read_cloud(aligned).observed_points, expected, atol=1e-6)
    assert f"written: {aligned}" in err


def test_every_rejector_can_be_asked_for(command, pair):
    for name in presets.rejector_names():
        status, out, _ = command("register", *pair, *INTRINSICS, "--rejector", name, "--json")
        assert status in (0, 1)
        assert json.loads(out)["rejector"] == name


def test_camera_from_a_file_and_scale_and_max_depth(command, pair, tmp_path):
    np.savetxt(tmp_path / "k.txt", CAMERA.matrix)
    options = ("--camera", tmp_path / "k.txt", "--depth-scale", 2000, "--max-depth", 0.8)
    aligned = tmp_path / "aligned.npy"
    status, _, _ = command("register", *pair, *options, "--output", aligned)
    assert status == 0
    assert np.nanmax(np.load(aligned)[..., 2]) < 0.81


@pytest.fixture
def one_iteration(monkeypatch):
    """Let every registration stop after one iteration, not converged."""
    register = hmrf_icp.register

    def stopped(source, target, init, preset, **options):
        criteria = hmrf_icp.Criteria(translation=0.0, rotation=0.0, max_iterations=1)
        return register(source, target, init, preset=preset, criteria=criteria, **options)

    monkeypatch.setattr(hmrf_icp, "register", stopped)


def test_not_converged_is_status_1_where_there_is_no_confidence(
    command, pair, tmp_path, one_iteration
):
    options = (*INTRINSICS, "--preset", "paper", "--json", "--output", tmp_path / "aligned.ply")
    status, out, err = command("register", *pair, *options)
    assert status == 1
    content = json.loads(out)
    assert (content["converged"], content["believed"]) == (False, False)
    assert (content["confidence"], content["visibility"]) == (None, None)
    assert "did not converge (this method gives no confidence)" in err
    assert "more iterations" in err
    assert (tmp_path / "aligned.ply").exists()


def test_a_pose_that_convinces_is_believed_whether_or_not_the_loop_converged(
    command, pair, one_iteration
):
    status, out, err = command("register", *pair, *INTRINSICS, "--json")
    assert status == 0
    content = json.loads(out)
    assert (content["converged"], content["believed"]) == (False, True)
    assert "did NOT converge after" in err


def test_a_pose_that_does_not_convince_is_status_1_and_says_what_to_try(command, tmp_path):
    rng = np.random.default_rng(0)
    for name in ("a.ply", "b.ply"):
        write_cloud(tmp_path / name, PointCloud(rng.normal(size=(2000, 3))))
    status, out, err = command("register", tmp_path / "a.ply", tmp_path / "b.ply", "--json")
    content = json.loads(out)
    assert status == 1
    assert content["believed"] is False
    assert content["confidence"] < 0.5
    assert content["source_view"]["kind"] == content["target_view"]["kind"] == "assumed"
    assert "NOT convincing, confidence 0." in err
    assert "say where the sensor of source and target stood" in err


def test_a_number_that_is_none_is_null_in_json(command, pair, monkeypatch):
    from dataclasses import replace

    register = hmrf_icp.register
    nowhere = np.full(3, np.nan)
    monkeypatch.setattr(
        hmrf_icp, "register", lambda *a, **k: replace(register(*a, **k), centre=nowhere)
    )
    _, out, _ = command("register", *pair, *INTRINSICS, "--json")
    assert json.loads(out)["centre"] == [None] * 3


def test_a_mix_up_of_units_is_one_line_of_warning(command, clouds, tmp_path):
    cloud = read_cloud(clouds[1])
    write_cloud(tmp_path / "mm.ply", PointCloud(1000 * cloud.points))
    with warnings.catch_warnings():
        _, _, err = command("register", clouds[0], tmp_path / "mm.ply", "--json")
    lines = [line for line in err.splitlines() if "millimetres" in line]
    assert len(lines) == 1
    assert lines[0].startswith("Warning: ")
    assert ".py" not in err


def test_options_that_have_no_effect_are_mentioned(command, clouds):
    _, out, err = command("register", *clouds, "--depth-scale", 1000, "--json")
    assert "Note: neither file is a depth map" in err
    json.loads(out)


# ---- Where the sensor stood ------------------------------------------------------------------


@pytest.fixture
def asked(monkeypatch):
    """The source and the target that the library was asked to register."""
    register = hmrf_icp.register
    clouds = []

    def watched(source, target, *arguments, **options):
        clouds.extend((source, target))
        return register(source, target, *arguments, **options)

    monkeypatch.setattr(hmrf_icp, "register", watched)
    return clouds


@pytest.mark.parametrize("given", ["-0.5,0.25,1e-1", "0,0,0", " 1, 2, 3"])
def test_both_clouds_are_seen_from_the_viewpoint(command, clouds, asked, given):
    status, _, err = command("register", *clouds, "--viewpoint", given, "--json")
    assert status == 0
    assert "has no effect" not in err
    for cloud, file in zip(asked, clouds, strict=True):
        np.testing.assert_array_equal(cloud.viewpoint, [float(word) for word in given.split(",")])
        np.testing.assert_array_equal(cloud.points, read_cloud(file).points)


def test_without_it_clouds_have_the_viewpoint_of_their_file(command, clouds, asked, tmp_path):
    target = read_cloud(clouds[1])
    write_cloud(tmp_path / "t.npz", PointCloud(target.points, viewpoint=[1.0, 2.0, 3.0]))
    command("register", clouds[0], tmp_path / "t.npz")
    assert asked[0].viewpoint is None
    np.testing.assert_array_equal(asked[1].viewpoint, [1, 2, 3])
    command("register", clouds[0], tmp_path / "t.npz", "--viewpoint", "0,0,1.8")
    np.testing.assert_array_equal(asked[3].viewpoint, [0, 0, 1.8])


def test_the_viewpoint_of_the_source_moves_with_it(command, clouds, tmp_path):
    aligned = tmp_path / "aligned.npz"
    options = ("--viewpoint", "0.5,0,0", "--output", aligned, "--json")
    _, out, _ = command("register", *clouds, *options)
    motion = np.array(json.loads(out)["transformation"])
    expected = se3.transform(motion, np.array([0.5, 0.0, 0.0]))
    np.testing.assert_allclose(read_cloud(aligned).viewpoint, expected, atol=1e-12)


def test_a_depth_map_keeps_its_camera_beside_a_cloud_with_a_viewpoint(command, pair, clouds, asked):
    options = (*INTRINSICS, "--viewpoint", "1,2,3", "--json")
    _, _, err = command("register", pair[0], clouds[1], *options)
    assert asked[0].camera is not None
    np.testing.assert_array_equal(asked[0].viewpoint, [0, 0, 0])
    np.testing.assert_array_equal(asked[1].viewpoint, [1, 2, 3])
    assert "has no effect" not in err
    _, _, err = command("register", *pair, *options)
    assert "Note: both files come with a camera: --viewpoint has no effect" in err


# ---- What goes wrong --------------------------------------------------------------------------


def refused(command, tmp_path, *arguments):
    """Run a command that has to fail, with an output that has to stay; return the message."""
    old = tmp_path / "old.ply"
    old.write_text("an earlier result")
    before = sorted(tmp_path.iterdir())
    status, out, err = command("register", *arguments, "--output", old)
    assert status == 2
    assert out == ""
    assert "Traceback" not in err
    assert len(err.splitlines()) == 1, "one paragraph"
    assert err.startswith("Error: ")
    assert old.read_text() == "an earlier result"
    assert sorted(tmp_path.iterdir()) == before, "nothing is left behind"
    return err


def damage(path, kind):
    """Make ``path`` the file that people really have; return what the message has to say."""
    if kind == "missing":
        path.unlink()
        return "no such file"
    if kind == "empty":
        path.write_bytes(b"")
        return "empty"
    if kind == "directory":
        path.unlink()
        path.mkdir()
        return "is a directory"
    if kind == "truncated":
        path.write_bytes(path.read_bytes()[:-40])
        return "cut short"
    if kind == "8-bit":
        Image.new("L", (48, 36)).save(path)
        return "8-bit"
    if kind == "colour":
        Image.new("RGB", (48, 36)).save(path)
        return "3 channels"
    if kind == "blank":
        Image.fromarray(np.zeros((36, 48), np.uint16)).save(path)
        return "0 observed points"
    raise AssertionError(kind)


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize(
    "kind", ["missing", "empty", "directory", "truncated", "8-bit", "colour", "blank"]
)
def test_a_bad_depth_map(command, pair, tmp_path, kind, which):
    says = damage(pair[which], kind)
    err = refused(command, tmp_path, *pair, *INTRINSICS)
    assert pair[which].name in err
    assert says in err


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize("kind", ["missing", "empty", "directory", "truncated"])
def test_a_bad_cloud(command, clouds, tmp_path, kind, which):
    says = damage(clouds[which], kind)
    err = refused(command, tmp_path, *clouds)
    assert clouds[which].name in err
    assert says in err


def test_a_ply_that_promises_more_points_than_it_holds(command, clouds, tmp_path):
    content = clouds[1].read_bytes()
    clouds[1].write_bytes(content.replace(b"element vertex 1728", b"element vertex 2000"))
    err = refused(command, tmp_path, *clouds)
    assert "target.ply" in err
    assert "promises 2000 of element 'vertex', the file holds 1728" in err


@pytest.mark.parametrize(
    ("points", "says"),
    [
        (np.zeros((9, 3)), "9 observed points of 9, expected at least 10"),
        (np.full((30, 3), np.nan), "0 observed points"),
        (np.ones((30, 3)), "the same"),
        (np.outer(np.arange(30.0), [1, 2, 3]), "one line"),
    ],
)
def test_a_cloud_that_no_motion_can_be_found_from(command, clouds, tmp_path, points, says):
    np.save(tmp_path / "few.npy", points)
    err = refused(command, tmp_path, clouds[0], tmp_path / "few.npy")
    assert "target" in err
    assert "few.npy" in err
    assert says in err


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ((), "needs the intrinsics"),
        (("--intrinsics", "50,50"), "--intrinsics: expected four numbers"),
        (("--intrinsics", "50,50,320,240"), "another image size"),
        (("--camera", "none.txt"), "none.txt: no such file"),
        ((*INTRINSICS, "--camera", "k.txt"), "not both"),
        ((*INTRINSICS, "--depth-scale", "0"), "--depth-scale: expected a positive number"),
        ((*INTRINSICS, "--depth-scale", "-1000"), "--depth-scale: expected a positive number"),
        ((*INTRINSICS, "--depth-scale", "nan"), "--depth-scale: expected a positive number"),
        ((*INTRINSICS, "--max-depth", "0"), "--max-depth: expected a positive number"),
        ((*INTRINSICS, "--max-depth", "0.5"), "0 observed points"),
        ((*INTRINSICS, "--viewpoint", "0,0"), "--viewpoint: expected three numbers X,Y,Z"),
        ((*INTRINSICS, "--viewpoint", "0,0,nan"), "--viewpoint: expected three numbers X,Y,Z"),
        (
            (*INTRINSICS, "--viewpoint", "here"),
            "in metres, such as 0,0,1.8, auto or none; got 'here'",
        ),
        ((*INTRINSICS, "--init", "none.txt"), "none.txt: no such file"),
        ((*INTRINSICS, "--preset", "best"), f"expected one of {', '.join(presets.names())}"),
        (
            (*INTRINSICS, "--rejector", "none"),
            f"expected one of {', '.join(presets.rejector_names())}",
        ),
        ((*INTRINSICS, "--figure", "picture.docx"), "picture.docx"),
        ((*INTRINSICS, "--figure", "none/picture.png"), "does not exist"),
    ],
)
def test_options_that_cannot_be_met(command, pair, tmp_path, options, says):
    assert says in refused(command, tmp_path, *pair, *options)


def test_intrinsics_for_another_image_size(command, pair, tmp_path):
    matrix = [50.0, 0, 0, 0, 50, 0, 23.5, 17.5, 1]
    content = {"width": 640, "height": 480, "intrinsic_matrix": matrix}
    (tmp_path / "k.json").write_text(json.dumps(content))
    err = refused(command, tmp_path, *pair, "--camera", tmp_path / "k.json")
    assert "k.json" in err
    assert "640 x 480" in err
    assert "48 x 36" in err


def test_depths_that_the_phone_is_not_sure_of_are_left_out(command, pair, tmp_path):
    sure = np.ones((36, 48), np.uint8)
    sure[:, :12] = 0
    Image.fromarray(sure).save(tmp_path / "sure.png")
    masks = ("--source-confidence", tmp_path / "sure.png")
    status, out, err = command(
        "register", *pair, *INTRINSICS, *masks, "--output", tmp_path / "a.npy"
    )
    assert status == 0, out + err
    assert np.isnan(np.load(tmp_path / "a.npy")[:, :12]).all()
    none = ("--target-confidence", tmp_path / "sure.png", "--min-confidence", "2")
    assert "0 observed points" in refused(command, tmp_path, *pair, *INTRINSICS, *none)


def test_a_drawing_is_sampled_as_asked(command, tmp_path):
    """A crooked roof: two squares of two triangles, and a third."""
    corners = np.array([[0, 0, 0], [1, 0, 0.2], [0, 1, 0.3], [1, 1, 0.1], [0.4, 0.3, 1.0]])
    faces = ["3 0 1 4", "3 1 3 4", "3 3 2 4", "3 2 0 4"]
    header = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\n"
    header += "property float z\nelement face 4\nproperty list uchar int vertex_indices\nend_header"
    rows = [" ".join(map(str, corner)) for corner in corners]
    (tmp_path / "roof.ply").write_text("\n".join([header, *rows, *faces, ""]))
    write_cloud(tmp_path / "scan.ply", read_cloud(tmp_path / "roof.ply", samples=1500))
    asked = ("--samples", "1200", "--output", tmp_path / "a.npy")
    command("register", tmp_path / "roof.ply", tmp_path / "scan.ply", "--search", "near", *asked)
    assert np.load(tmp_path / "a.npy").shape == (1200, 3)


def test_a_start_that_is_not_rigid(command, pair, tmp_path):
    np.savetxt(tmp_path / "scaled.txt", np.diag([2.0, 2, 2, 1]))
    err = refused(command, tmp_path, *pair, *INTRINSICS, "--init", tmp_path / "scaled.txt")
    assert "scaled.txt" in err
    assert "not a rotation" in err


def test_unknown_kind_of_input_lists_the_known(command, pair, tmp_path):
    (tmp_path / "scan.dxf").write_text("LASF")
    err = refused(command, tmp_path, pair[0], tmp_path / "scan.dxf", *INTRINSICS)
    assert "scan.dxf" in err
    assert ".ply, .pcd" in err


def test_a_source_without_a_grid_where_the_method_needs_one(command, clouds, tmp_path):
    err = refused(command, tmp_path, clouds[1], clouds[1], "--preset", "paper")
    assert "target.ply" in err
    assert "organised" in err


@pytest.mark.parametrize("name", ["aligned.dxf", "none/aligned.ply", "source.png"])
def test_an_output_that_cannot_be_is_refused_before_the_work(
    command, pair, tmp_path, name, monkeypatch
):
    monkeypatch.setattr(hmrf_icp, "register", lambda *a, **k: pytest.fail("worked in vain"))
    before = pair[0].read_bytes()
    status, out, err = command("register", *pair, *INTRINSICS, "--output", tmp_path / name)
    assert status == 2
    assert name in err
    assert out == ""
    assert pair[0].read_bytes() == before


def test_an_output_never_replaces_an_input(command, clouds):
    before = clouds[0].read_bytes()
    status, _, err = command("register", *clouds, "--output", clouds[0])
    assert status == 2
    assert "is an input of this run" in err
    assert clouds[0].read_bytes() == before


def test_when_writing_fails_the_result_is_printed_and_no_output_replaced(
    command, clouds, tmp_path, monkeypatch
):
    def disk_full(path, cloud):
        path.write_bytes(b"half")
        raise OSError(28, "No space left on device", str(path))

    monkeypatch.setattr("hmrf_icp.io.write_cloud", disk_full)
    old = tmp_path / "old.ply"
    old.write_text("an earlier result")
    before = sorted(tmp_path.iterdir())
    status, out, err = command("register", *clouds, "--json", "--output", old)
    assert status == 2
    assert "No space left on device" in err
    assert "written" not in err
    assert np.shape(json.loads(out)["transformation"]) == (4, 4)
    assert old.read_text() == "an earlier result"
    assert sorted(tmp_path.iterdir()) == before


@pytest.fixture
def drawing(monkeypatch):
    """Stand in for the figure, whose look is not the matter here."""

    def set_up(draw):
        monkeypatch.setitem(
            sys.modules, "hmrf_icp.figures.registration", SimpleNamespace(registration_figure=draw)
        )

    return set_up


def test_figure_is_drawn_of_both_clouds_and_the_result(command, clouds, tmp_path, drawing):
    drawing(
        lambda source, target, result, path, init, names, method: path.write_text(
            f"{path.suffix} {source.shape} {target.shape} {result.converged} {init} {method} "
            f"{' '.join(names)}"
        )
    )
    status, _, err = command("register", *clouds, "--json", "--figure", tmp_path / "f.png")
    assert status == 0
    said = ".png (36, 48) (1728,) True None robust"
    names = " ".join(cloud.name for cloud in clouds)
    assert (tmp_path / "f.png").read_text() == f"{said} {names}"
    assert "f.png" in err


def test_a_figure_that_fails_keeps_the_other_output_from_being_replaced(
    command, clouds, tmp_path, drawing
):
    def fail(source, target, result, path, init, names, method):
        raise hmrf_icp.InputError("figure: cannot be drawn")

    drawing(fail)
    for name in ("old.ply", "old.png"):
        (tmp_path / name).write_text("an earlier result")
    outputs = ("--output", tmp_path / "old.ply", "--figure", tmp_path / "old.png")
    status, _, err = command("register", *clouds, *outputs)
    assert status == 2
    assert "cannot be drawn" in err
    for name in ("old.ply", "old.png"):
        assert (tmp_path / name).read_text() == "an earlier result"


# ---- All that the source had -----------------------------------------------------------------


@pytest.fixture
def coloured(clouds, tmp_path):
    """The source with a colour, a normal and a number a point, and the target as it is."""
    source = read_cloud(clouds[0])
    values = np.arange(source.points[..., 0].size).reshape(source.shape)
    write_cloud(
        tmp_path / "coloured.ply",
        PointCloud(
            source.points,
            normals=source.points,
            attributes={"red": (values % 256).astype(np.uint8), "intensity": values / 7},
        ),
    )
    return tmp_path / "coloured.ply", clouds[1]


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".csv", ".npz"])
def test_the_output_has_all_that_the_source_had(command, coloured, tmp_path, suffix):
    aligned, pose = tmp_path / f"aligned{suffix}", tmp_path / "pose.txt"
    status, out, err = command("register", *coloured, "--output", aligned, "--pose", pose)
    assert status == 0
    assert "has no place" not in err
    assert f"written: {pose}" in out
    source, moved, motion = read_cloud(coloured[0]), read_cloud(aligned), read_pose(pose)
    np.testing.assert_allclose(moved.points, se3.transform(motion, source.points), atol=1e-6)
    turned = source.normals @ motion[:3, :3].T
    np.testing.assert_allclose(moved.normals, turned, atol=1e-6)
    for name in ("red", "intensity"):
        np.testing.assert_array_equal(moved.attributes[name], source.attributes[name])


def test_what_the_format_has_no_place_for_is_said(command, coloured, tmp_path):
    _, _, err = command("register", *coloured, "--output", tmp_path / "aligned.xyz")
    assert "Note: .xyz has no place for the source's normals, red, intensity" in err


def test_the_pose_is_the_result_s_and_starts_the_next_run(command, clouds, tmp_path):
    pose = tmp_path / "pose.txt"
    _, out, _ = command("register", *clouds, "--pose", pose, "--json")
    np.testing.assert_allclose(read_pose(pose), json.loads(out)["transformation"], atol=1e-14)
    status, _, _ = command("register", *clouds, "--init", pose)
    assert status == 0


def test_two_outputs_of_one_name_are_refused(command, clouds, tmp_path):
    same = tmp_path / "out.txt"
    status, _, err = command("register", *clouds, "--output", same, "--pose", same)
    assert status == 2
    assert "is what --output writes" in err


def test_a_name_that_is_no_text_is_shown_all_the_same(clouds, tmp_path):
    odd = tmp_path / os.fsdecode(b"scan_\xff.pcd")
    try:
        odd.write_bytes(clouds[0].read_bytes())
    except OSError:
        pytest.skip("this file system takes no such name")
    run = subprocess.run(
        [sys.executable, "-m", "hmrf_icp", "register", odd, clouds[1], "--rejector", "all"],
        capture_output=True,
        env={**os.environ, "PYTHONUTF8": "1"},
    )
    assert run.returncode == 0
    assert b"scan_\\udcff.pcd to target.ply" in run.stdout


def test_colour_is_taken_as_evidence_and_missed_where_there_is_none(command, tmp_path):
    rng = np.random.default_rng(0)
    slide = np.array([0.03, 0.0, 0.0])
    files = []
    for name, motion in (("source", slide), ("target", np.zeros(3))):
        x, y = rng.uniform(-0.5, 0.5, (2, 2000))
        points = np.stack([x, y, rng.normal(0.0, 0.002, 2000)], axis=1) - motion
        bright = 0.5 + 0.2 * np.sin(9.0 * x + 2.0 * y) + 0.2 * np.cos(11.0 * y - 3.0 * x)
        value = np.rint(255.0 * bright).astype(np.uint8)
        colours = dict.fromkeys(("red", "green", "blue"), value)
        files.append(tmp_path / f"{name}.ply")
        write_cloud(files[-1], PointCloud(points, attributes=colours))
    options = ("--preset", "paper", "--rejector", "all", "--json")
    status, out, _ = command(
        "register", *files, *options, "--aligner", "point-to-plane", "--colour"
    )
    found = json.loads(out)
    assert found["colour"] is True
    assert found["transformation"][0][3] == pytest.approx(0.03, abs=0.004)
    assert found["degenerate"] == []
    bare = tmp_path / "bare.xyz"
    write_cloud(bare, PointCloud(points))
    status, _, error = command("register", bare, files[1], *options, "--colour")
    assert status == 2
    assert "no colours" in error
    assert "bare.xyz" in error
    status, _, error = command(
        "register", *files, *options, "--aligner", "point-to-point", "--colour"
    )
    assert status == 2
    assert "looks at surfaces" in error
