"""A film shows the states that were, says what is put between them, and is whole or not there."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

import hmrf_icp
from hmrf_icp import plot, se3
from hmrf_icp.cli import app
from hmrf_icp.cli.animate import read_size
from hmrf_icp.drawing import palette
from hmrf_icp.errors import InputError, MissingDependencyError
from hmrf_icp.figures.film import RegistrationFilm
from hmrf_icp.figures.pair import Pair
from hmrf_icp.figures.shots import between, shots_of
from hmrf_icp.figures.states import states_of
from hmrf_icp.figures.style import Lengths
from hmrf_icp.presets import PAPER

SMALL = {"size": (320, 180), "fps": 5, "seconds": 0.6}


def frames_of(path):
    with Image.open(path) as film:
        for number in range(film.n_frames):
            film.seek(number)
            yield np.asarray(film.convert("RGB")).astype(int), film.info["duration"]


def test_the_history_says_where_each_iteration_led(filmed):
    *_, init, result, recording = filmed
    assert recording.iterations == list(result.history)
    np.testing.assert_array_equal(result.history[-1].transformation, result.transformation)
    pose = init
    for one in result.history:
        step = one.transformation @ se3.inverse(pose)
        assert se3.rotation_angle(step) == pytest.approx(one.step_rotation, abs=1e-9)
        pose = one.transformation


def test_poses_on_the_way_are_in_the_frames_given(wavy):
    far = np.array([4e5, 5e6, 300.0])
    recording = plot.Recording()
    result = hmrf_icp.register(wavy + far, wavy + far + 0.03, np.eye(4), on_iteration=recording)
    last = result.history[-1].transformation
    there = se3.transform(last, (wavy + far)[:5])
    np.testing.assert_allclose(there, (wavy + far + 0.03)[:5], atol=0.01)
    assert recording.iterations[-1] == result.history[-1]


def test_the_states_of_algorithm_1_are_its_own(filmed):
    """Labels decided again at the poses on the way are those that the loop had there."""
    _, _, init, result, _ = filmed
    pair = Pair.of(result)
    states = states_of(pair, result, pair.between(init), PAPER)
    assert len(states) == len(result.history) + 1
    for state, iteration in zip(states, result.history, strict=False):
        assert np.mean(state.probability > 0.5) == pytest.approx(iteration.inlier_share)
    last = result.correspondences.matched.probability
    np.testing.assert_allclose(states[-2].probability, last, atol=1e-9)


def test_candidates_that_were_not_kept_are_told_from_those_that_were(wavy):
    recording = plot.Recording()
    result = hmrf_icp.register(wavy - [0.3, 0.0, 0.1], wavy, on_iteration=recording)
    tried = recording.tried(result)
    assert all(one not in result.history for one in tried)
    loops = sum(one.iteration == 1 for one in recording.iterations)
    assert len(tried) <= loops


def test_between_two_poses_the_middle_goes_straight():
    one, other = np.eye(4), se3.rotation_about((0.0, 0.0, 1.0), 1.0, (2.0, 0.0, 0.0))
    middle = np.array([1.0, 2.0, 3.0])
    ends = [se3.transform(pose, middle[None])[0] for pose in (one, other)]
    half = between(one, other, 0.5, middle)
    np.testing.assert_allclose(se3.transform(half, middle[None])[0], np.mean(ends, axis=0))
    assert se3.rotation_angle(half) == pytest.approx(0.5)
    np.testing.assert_allclose(between(one, other, 1.0, middle), other, atol=1e-12)


def test_every_iteration_has_its_picture_and_the_rest_is_marked(filmed):
    _, _, init, result, _ = filmed
    pair = Pair.of(result)
    states = states_of(pair, result, pair.between(init), PAPER)
    shots = shots_of(pair, states, (), 10, 4.0)
    were = [shot for shot in shots if shot.kind not in ("between", "candidate")]
    assert [shot.place for shot in were] == list(range(len(result.history) + 1))
    for shot, state in zip(were, states, strict=True):
        np.testing.assert_array_equal(shot.pose, state.pose)
    assert all(shot.place % 1.0 for shot in shots if shot.kind == "between")
    moving = sum(shot.frames for shot in shots if shot.kind in ("between", "iteration"))
    assert moving / 10 == pytest.approx(4.0, abs=0.06 * len(states) + 0.1)
    # However short the time, no iteration is left out.
    assert len(shots_of(pair, states, (), 1, 0.1)) == len(result.history) + 1


def test_a_gif_has_a_frame_for_every_picture_and_lasts_as_long(filmed, tmp_path):
    _, _, init, result, recording = filmed
    path = tmp_path / "a.gif"
    told = []
    made = plot.animate(
        path,
        result,
        init=init,
        preset="paper",
        recording=recording,
        on_progress=lambda done, total: told.append((done, total)),
        **SMALL,
    )
    assert made == path
    frames = list(frames_of(path))
    pair = Pair.of(result)
    states = states_of(pair, result, pair.between(init), PAPER)
    shots = shots_of(pair, states, recording.tried(result), SMALL["fps"], SMALL["seconds"])
    assert len(frames) == len(shots)
    assert told == [(k + 1, len(shots)) for k in range(len(shots))]
    assert all(pixels.shape == (180, 320, 3) for pixels, _ in frames)
    lasting = [duration for _, duration in frames]
    assert sum(lasting) == pytest.approx(1000 * sum(s.frames for s in shots) / SMALL["fps"], abs=20)
    assert np.abs(frames[0][0] - frames[-1][0]).mean() > 1.0, "something moved"
    assert list(tmp_path.iterdir()) == [path]


def drawn(result, init, dark=False):
    pair = Pair.of(result)
    states = states_of(pair, result, pair.between(init), PAPER)
    shots = shots_of(pair, states, (), 5, 0.5)
    film = RegistrationFilm(pair, result, shots, None, (640, 360), dark, None, None, Lengths("m"))
    return film.draw(0), film.draw(len(shots) - 1)


def near(pixels, colour):
    return np.mean(np.abs(pixels / 255.0 - palette.rgb(colour)).max(axis=-1) < 0.03)


def test_the_end_of_a_film_that_is_not_believed_looks_wrong(filmed, wrong, result):
    init = filmed[2]
    first, last = drawn(wrong, init)
    assert near(last, palette.VIOLATED) > 0.005
    assert near(first, palette.VIOLATED) < 0.0005, "nobody knows yet"
    assert near(drawn(result, init)[1], palette.VIOLATED) < 0.0005


def test_a_dark_film_is_dark(filmed):
    first, _ = drawn(filmed[3], filmed[2], dark=True)
    assert np.median(first) < 40


def test_mp4_has_the_frames_that_were_asked_for(filmed, tmp_path):
    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="MP4 needs the extra film")
    _, _, init, result, _ = filmed
    path = tmp_path / "a.mp4"
    plot.animate(path, result, init=init, preset="paper", **SMALL)
    pair = Pair.of(result)
    states = states_of(pair, result, pair.between(init), PAPER)
    expected = sum(s.frames for s in shots_of(pair, states, (), SMALL["fps"], SMALL["seconds"]))
    frames, seconds = ffmpeg.count_frames_and_secs(str(path))
    assert frames == expected
    assert seconds == pytest.approx(expected / SMALL["fps"], abs=0.3)
    assert list(tmp_path.iterdir()) == [path]


def test_without_the_extra_mp4_is_refused_with_its_name(filmed, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(MissingDependencyError, match=r"hmrf-icp\[film\]"):
        plot.animate(tmp_path / "a.mp4", filmed[3], init=filmed[2], preset="paper")
    assert list(tmp_path.iterdir()) == []


def test_a_failure_leaves_the_old_film_and_nothing_else(filmed, tmp_path):
    path = tmp_path / "a.gif"
    path.write_text("old")

    def stop(done, total):
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        plot.animate(path, filmed[3], init=filmed[2], preset="paper", on_progress=stop, **SMALL)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("bad", "complaint"),
    [
        ({"fps": 0}, "fps"),
        ({"fps": 200}, "fps"),
        ({"size": (321, 180)}, "size"),
        ({"size": (32, 18)}, "size"),
        ({"seconds": float("nan")}, "seconds"),
        ({"truth": 2 * np.eye(4)}, "truth"),
    ],
)
def test_numbers_that_no_film_has_are_refused(filmed, tmp_path, bad, complaint):
    with pytest.raises(InputError, match=complaint):
        plot.animate(tmp_path / "a.gif", filmed[3], preset="paper", **(SMALL | bad))
    assert list(tmp_path.iterdir()) == []


def test_the_command_writes_a_film_and_says_the_result(wavy, tmp_path):
    np.save(tmp_path / "a.npy", wavy - [0.02, 0.0, 0.01])
    np.save(tmp_path / "b.npy", wavy)
    film = tmp_path / "film.gif"
    files = [str(tmp_path / "a.npy"), str(tmp_path / "b.npy")]
    options = ["-o", str(film), "--size", "320x180", "--fps", "5", "--seconds", "0.5"]
    done = CliRunner().invoke(app, ["animate", *files, *options])
    assert done.exit_code == 0, done.output
    assert "to be believed" in done.stdout
    assert "film.gif" in done.stdout
    with Image.open(film) as opened:
        assert opened.n_frames > 3


def test_the_command_reads_what_register_reads(tmp_path, monkeypatch):
    """A map of confidence, and a mesh in so many points."""
    pytest.importorskip("trimesh", reason="needs the extra 'mesh'")
    monkeypatch.chdir(tmp_path)
    y, x = np.mgrid[0:60, 0:80]
    depth = 1500.0 + 200.0 * np.sin(x / 9.0) * np.cos(y / 7.0)
    Image.fromarray(depth.astype(np.uint16)).save("a.png")
    Image.fromarray(np.where(x < 60, 2, 0).astype(np.uint8)).save("sure.png")
    (tmp_path / "part.obj").write_text("v 0 0 1\nv 1 0 1\nv 0 1 1.2\nf 1 2 3\n")
    np.savetxt("start.txt", np.eye(4))
    seen = []
    monkeypatch.setattr(plot, "animate", lambda _, result, **__: seen.append(Pair.of(result)))
    command = "animate a.png part.obj -o film.gif --init start.txt --preset paper --samples 777"
    command += " --intrinsics 80,80,40,30 --source-confidence sure.png"
    done = CliRunner().invoke(app, command.split())
    assert done.exit_code in (0, 1), done.output
    assert len(seen[0].source) == 60 * 60
    assert len(seen[0].target) == 777


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["-o", "film.avi"], ".gif or .mp4"),
        (["-o", "nowhere/film.gif"], "nowhere"),
        (["-o", "film.gif", "--size", "wide"], "--size"),
        (["-o", "film.gif", "--fps", "0"], "fps"),
        (["-o", "film.gif", "--preset", "magic"], "magic"),
        (["-o", "film.gif"], "a.npy"),
    ],
)
def test_bad_input_is_refused_in_a_line_before_anything_is_made(
    tmp_path, monkeypatch, options, complaint
):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["animate", "a.npy", "b.npy", *options])
    assert done.exit_code == 2
    assert complaint in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_a_size_is_two_numbers():
    assert read_size("960x540") == (960, 540)
    for text in ("960", "x", "-2x4", "960x540x3"):
        with pytest.raises(InputError, match="--size"):
            read_size(text)


def test_a_film_of_a_result_that_is_a_copy_takes_the_clouds(filmed, tmp_path):
    source, target, init, result, _ = filmed
    import copy

    other = replace(copy.deepcopy(result))
    plot.animate(tmp_path / "a.gif", other, source, target, init=init, preset="paper", **SMALL)
    assert (tmp_path / "a.gif").stat().st_size > 1000
