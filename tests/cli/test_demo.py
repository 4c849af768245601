"""``hmrf-icp demo`` registers what it promises, and says so when it does not."""

import re

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

import hmrf_icp
from hmrf_icp import se3
from hmrf_icp.cli import app
from hmrf_icp.cli.demo import PICTURE, desk_pair
from hmrf_icp.evaluate.protocol import overlap

runner = CliRunner()


@pytest.fixture(scope="module")
def pair():
    return desk_pair()


def test_about_forty_per_cent_of_the_source_was_seen_by_the_target(pair):
    assert 0.35 < pair.overlap < 0.45
    assert abs(overlap(pair.source, pair.target, pair.truth) - pair.overlap) < 0.1
    assert pair.source.shape == pair.target.shape == (120, 160)


def test_the_start_is_turned_about_the_centroid_by_the_papers_angle(pair):
    off = se3.inverse(pair.truth) @ pair.init
    assert se3.rotation_angle(off) == pytest.approx(np.pi / 30)
    centroid = pair.source.observed_points.mean(axis=0)
    np.testing.assert_allclose(se3.transform(off, centroid), centroid, atol=1e-12)


@pytest.mark.parametrize("preset", hmrf_icp.presets.names())
def test_every_preset_finds_the_pose_of_the_demo(pair, preset):
    result = hmrf_icp.register(pair.source, pair.target, pair.init, preset=preset)
    metres, radians = se3.error(result.transformation, pair.truth)
    assert metres < 0.02
    assert radians < 0.02
    assert abs(result.overlap - pair.overlap) < 0.1


def test_the_same_seed_makes_the_same_pair_and_another_another(pair):
    again, other = desk_pair(), desk_pair(seed=1)
    np.testing.assert_array_equal(again.source.points, pair.source.points)
    np.testing.assert_array_equal(again.init, pair.init)
    assert not np.allclose(other.init, pair.init)
    assert (other.source.observed != pair.source.observed).any()


def test_the_demo_prints_a_summary_and_writes_its_picture(tmp_path):
    done = runner.invoke(app, ["demo", "--output", str(tmp_path), "--subsample", "8"])
    assert done.exit_code == 0, done.output
    assert "Registered: the known pose was found" in done.stdout
    numbers = dict(re.findall(r"(overlap, true|iterations|EM iterations) +([\d.]+)", done.stdout))
    assert 35 < float(numbers["overlap, true"]) < 45
    assert float(numbers["iterations"]) > 1
    assert re.search(r"translation error +\d+\.\d mm +\d+\.\d mm", done.stdout)
    assert re.search(r"rotation error +6\.00 deg +\d\.\d\d deg", done.stdout)
    assert f"preset {hmrf_icp.presets.DEFAULT}" in done.stdout
    with Image.open(tmp_path / PICTURE) as image:
        assert image.size == (1650, 1200)
    assert list(tmp_path.iterdir()) == [tmp_path / PICTURE]


def test_a_miss_is_called_one(tmp_path):
    picture = tmp_path / "miss.png"
    arguments = ["demo", "--output", str(picture), "--preset", "paper", "--rejector", "all"]
    done = runner.invoke(app, [*arguments, "--subsample", "16"])
    assert done.exit_code == 1, done.output
    assert "Missed: the known pose was not found" in done.stdout
    assert "Registered" not in done.stdout
    assert picture.is_file()


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--preset", "magic"], "magic"),
        (["--rejector", "none"], "none"),
        (["--output", "nowhere/a.png"], "nowhere"),
        (["--output", "a.gif"], ".gif"),
        (["--angle", "nan"], "--angle"),
        (["--subsample", "0"], "--subsample"),
        (["--seed", "-1"], "--seed"),
    ],
)
def test_bad_input_is_refused_before_anything_is_made(tmp_path, monkeypatch, arguments, complaint):
    monkeypatch.chdir(tmp_path)
    done = runner.invoke(app, ["demo", *arguments])
    assert done.exit_code == 2
    assert complaint in done.stderr
    assert done.stdout == ""
    assert list(tmp_path.iterdir()) == []
