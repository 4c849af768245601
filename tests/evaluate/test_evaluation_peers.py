from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from evaluation_fakes import asked, rows

from hmrf_icp import se3
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.errors import InputError
from hmrf_icp.evaluate import evaluate, methods, peer_calls, peers
from hmrf_icp.evaluate.peer_calls import NoAnswerError
from hmrf_icp.evaluate.peers import FAMILIES, THRESHOLDS
from hmrf_icp.evaluate.prepared import Prepared
from hmrf_icp.synthetic.render import render
from hmrf_icp.synthetic.scenes import CAMERA, SCENES, trajectory

STEP = 6


@pytest.fixture(scope="module")
def desk() -> tuple[Prepared, Prepared, np.ndarray]:
    """Two views of the desk that share nearly all of it, and the true pose."""
    poses = trajectory("desk", 60)[30:32]
    target, source = (
        Prepared(painted(PointCloud.from_depth(render(SCENES["desk"](), CAMERA, p), CAMERA), p))
        for p in poses
    )
    return source, target, se3.inverse(poses[0]) @ poses[1]


def painted(cloud: PointCloud, pose: np.ndarray) -> PointCloud:
    """Every few pixels of a view, with an intensity that goes with the place in the world."""
    x, y, z = np.moveaxis(se3.transform(pose, cloud.points.reshape(-1, 3)), -1, 0)
    value = 0.5 + 0.2 * np.sin(7.0 * x + 3.0 * z) + 0.2 * np.cos(8.0 * y - 2.0 * x)
    attributes = {"intensity": value.reshape(cloud.shape)}
    return PointCloud(cloud.points, cloud.camera, attributes=attributes).subsample(STEP)


def needing(family: peers.Family) -> None:
    if family.missing:
        pytest.skip(f"needs {' and '.join(family.missing)}")


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.name)
def test_a_peer_comes_nearer_to_the_true_pose_of_views_that_share_nearly_everything(
    desk: tuple[Prepared, Prepared, np.ndarray], family: peers.Family
):
    needing(family)
    source, target, truth = desk
    centre = se3.transform(truth, source.centroid)
    init = se3.rotation_about((0.0, 1.0, 0.0), 0.05, centre) @ truth
    begun = se3.error(init, truth)[1]
    method = next(m for m in family.methods() if "@" not in m.name or m.name.endswith("@0.1"))
    outcome = method.register(source, target, init)
    # Features alone look at no start, and are as good as their voxels of 0.05 m at 2 m.
    near = 0.05 if family.name in ("fpfh", "fgr") else 0.5 * begun
    assert se3.error(se3.as_rigid(outcome.transformation), truth)[1] < near
    assert outcome.fitness is not None
    assert 0.5 < outcome.fitness <= 1.0


def test_peers_say_the_same_whatever_the_number_of_workers(recording: Path, tmp_path: Path):
    pytest.importorskip("joblib")
    # Coherent Point Drift is no different, and takes longer than all others together.
    present = [f for f in FAMILIES if f.usual and not f.missing and f.name != "cpd"]
    if not present:
        pytest.skip("no peer is installed")
    chosen = tuple(f"{f.name}@0.1" if f.thresholds else f.name for f in present)
    configuration = asked(recording, methods=(), peers=chosen, axes=1, minimum_overlap=0.5)
    for count in (1, 2):
        evaluate(configuration, tmp_path / str(count), workers=count)
    found = rows(tmp_path / "1")
    assert {row["method"] for row in found} == set(chosen)
    assert found == rows(tmp_path / "2")


def test_a_peer_that_wants_a_threshold_is_run_at_five():
    pytest.importorskip("small_gicp")
    names = [method.name for method in peers.choose(["gicp"]).methods]
    assert names == [f"gicp@{metres:g}" for metres in THRESHOLDS]
    assert [m.name for m in peers.choose(["gicp@0.2"]).methods] == ["gicp@0.2"]


def test_a_larger_threshold_believes_in_more_matches(
    desk: tuple[Prepared, Prepared, np.ndarray],
):
    pytest.importorskip("small_gicp")
    source, target, truth = desk
    fitness = [
        peer_calls.gicp(source, target, truth, (reach,)).fitness for reach in (0.01, 0.05, 0.8)
    ]
    assert fitness == sorted(fitness)
    assert fitness[0] < fitness[-1]


def test_a_peer_that_is_not_installed_is_left_out_with_a_sentence(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(peers, "find_spec", lambda name: None)
    choice = peers.choose(None)
    assert choice.methods == ()
    assert len(choice.skipped) == len([family for family in FAMILIES if family.usual])
    assert all("skipped" in line and "hmrf-icp[peers]" in line for line in choice.skipped)


def test_a_peer_that_came_with_a_later_version_is_left_out_with_that_version(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(peers, "find_spec", lambda name: object())
    monkeypatch.setattr(peers, "version", lambda name: "0.19.0")
    (line,) = peers.choose(["ndt"]).skipped
    assert "open3d 0.20 or newer not installed" in line
    monkeypatch.setattr(peers, "version", lambda name: "1.0")
    assert peers.choose(["ndt@0.1"]).skipped == ()


def test_what_needs_colours_is_compared_where_it_is_asked_for_and_says_what_is_missing(
    desk: tuple[Prepared, Prepared, np.ndarray],
):
    asked_for = {m.family for m in peers.choose(["o3d-colour", "cpd"]).methods}
    usual = {m.family for m in peers.choose(None).methods}
    assert "o3d-colour" not in usual
    assert "colour" not in {m.name for m in methods.choose(None)}
    assert "colour" not in methods.usual(listed=False, points_alone=False)
    assert [m.name for m in methods.choose(["colour"])] == ["colour"]
    bare = [Prepared(PointCloud(cloud.cloud.points, cloud.cloud.camera)) for cloud in desk[:2]]
    with pytest.raises(InputError, match="no colours"):
        methods.choose(["colour"])[0].register(*bare, desk[2])
    if "o3d-colour" in asked_for:
        with pytest.raises(InputError, match="no colours"):
            peers.catalogue()["o3d-colour@0.1"].register(*bare, desk[2])


def test_the_default_with_colour_is_as_near_as_its_peer(
    desk: tuple[Prepared, Prepared, np.ndarray],
):
    source, target, truth = desk
    init = se3.rotation_about((0.0, 1.0, 0.0), 0.05, se3.transform(truth, source.centroid)) @ truth
    found = methods.choose(["colour"])[0].register(source, target, init)
    metres, turn = se3.error(found.transformation, truth)
    assert metres < 0.01
    assert turn < 0.01
    assert found.confidence > 0.5


def test_an_unknown_peer_is_refused_with_the_known_ones():
    with pytest.raises(InputError, match=r"gicp@0\.3.*known are o3d-point"):
        peers.choose(["gicp@0.3"])


def test_descriptors_are_matched_once_a_pair_and_their_failure_is_one_from_every_start(
    desk: tuple[Prepared, Prepared, np.ndarray], monkeypatch: pytest.MonkeyPatch
):
    asked = []

    class Matcher:
        def __init__(self, config: object) -> None:
            asked.append(config)

        def estimate(self, source: object, target: object) -> SimpleNamespace:
            return SimpleNamespace(valid=False)

    fake = SimpleNamespace(KISSMatcher=Matcher, KISSMatcherConfig=lambda voxel_size: voxel_size)
    monkeypatch.setitem(sys.modules, "kiss_matcher", fake)
    source, target = (Prepared(cloud.cloud) for cloud in desk[:2])
    method = peers.catalogue()["kiss-gicp@0.1"]
    for angle in range(3):
        start = se3.rotation_about((0, 0, 1), angle, np.zeros(3))
        with pytest.raises(NoAnswerError):
            method.register(source, target, start)
    assert asked == [0.05]
