"""The picture of a registration shows what happened, and its file is whole or not there."""

import copy
import sys
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import hmrf_icp
from hmrf_icp import plot, se3
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.drawing import palette
from hmrf_icp.drawing.oblique import Patches, bounds, viewing_frame
from hmrf_icp.errors import InputError
from hmrf_icp.figures.registration import InlierField, field_before_first_step, registration_figure
from hmrf_icp.figures.style import own_figure
from hmrf_icp.synthetic.render import render, sensor_noise
from hmrf_icp.synthetic.scenes import CAMERA, desk, trajectory

SOURCE, TARGET, INLIER, OUTLIER = (
    tuple(round(255 * value) for value in palette.rgb(palette.MEANINGS[name]))
    for name in ("source", "target", "inlier", "outlier")
)


@pytest.fixture(scope="module")
def pair():
    """Two frames of the desk, every tenth pixel, and the pose between them."""
    poses, rng = [trajectory("desk", 10)[k] for k in (3, 5)], np.random.default_rng(0)
    source, target = (
        PointCloud.from_depth(sensor_noise(render(desk(), CAMERA, pose), CAMERA, rng), CAMERA)
        for pose in poses
    )
    return source.subsample(10), target.subsample(10), se3.inverse(poses[1]) @ poses[0]


@pytest.fixture(scope="module")
def registered(pair):
    source, target, truth = pair
    init = se3.rotation_about((0.0, 1.0, 0.0), 0.05, (0.0, 0.0, 1.5)) @ truth
    return source, target, hmrf_icp.register(source, target, init, preset="paper"), init


def picture(path):
    """Pixels (H, W, 3) of a picture without a ground, on white."""
    with Image.open(path) as image:
        ground = Image.new("RGBA", image.size, "white")
        ground.alpha_composite(image.convert("RGBA"))
        return np.asarray(ground.convert("RGB")).astype(int)


def share(pixels, colour):
    """Share of the pixels near the hue of a colour, whatever the lighting."""
    pixels = pixels.reshape(-1, 3)
    direction = pixels / np.maximum(np.linalg.norm(pixels, axis=1, keepdims=True), 1)
    return np.mean(direction @ (np.array(colour) / np.linalg.norm(colour)) > 0.998)


def panels(path):
    """The panels before and after of a figure of a result that is believed."""
    upper = picture(path)[:650]
    return upper[160:640, 45:570], upper[160:640, 650:1180]


def test_the_picture_has_its_size_and_shows_both_clouds_in_their_colours(registered, tmp_path):
    source, target, result, init = registered
    field = field_before_first_step(source, target, init, "paper")
    registration_figure(source, target, result, tmp_path / "a.png", init, field)
    pixels = picture(tmp_path / "a.png")
    assert pixels.shape == (1200, 1650, 3)
    for panel in panels(tmp_path / "a.png"):
        assert min(share(panel, SOURCE), share(panel, TARGET)) > 0.02
    # The field below, in the colours of labels.
    assert min(share(pixels[740:], INLIER), share(pixels[740:], OUTLIER)) > 0.02
    assert list(tmp_path.iterdir()) == [tmp_path / "a.png"]


def labelled(result, probability):
    """The result with one label for every point."""
    found = copy.deepcopy(result.correspondences)
    same = np.full_like(found.matched.probability, probability)
    found.__dict__["matched"] = found.matched._replace(probability=same)
    return replace(result, correspondences=found)


def test_before_and_after_differ_by_the_motion_alone(registered):
    source, target, result, init = registered

    def painted(start):
        axes = own_figure(9.0, 4.0).add_subplot()
        plot.before_after(result, source, target, axes, init=start)
        panels = {one.get_title(loc="left"): one for one in axes.child_axes}
        before, after = panels["Before"], panels["After"]
        assert before.get_xlim() == after.get_xlim()
        assert before.get_ylim() == after.get_ylim()
        return [panel.images[0].get_array().astype(int) for panel in (before, after)]

    before, after = painted(result.transformation)
    assert np.abs(before - after).mean() < 2.0, "nothing moved, yet the panels differ"
    before, after = painted(init)
    assert np.abs(before - after).mean() > 5.0


@pytest.mark.parametrize("suffix", [".pdf", ".svg"])
def test_vector_formats_are_written_too(registered, tmp_path, suffix):
    source, target, result, init = registered
    registration_figure(source, target, result, tmp_path / f"a{suffix}", init)
    head = (tmp_path / f"a{suffix}").read_bytes()[:200]
    assert b"%PDF" in head or b"<?xml" in head


def test_an_unorganised_source_is_drawn_as_points(registered, tmp_path):
    source, target, _, init = registered
    loose = PointCloud(source.observed_points)
    result = hmrf_icp.register(loose, target, init, preset="paper", rejector="x84")
    registration_figure(loose, target, result, tmp_path / "a.png", init)
    assert share(picture(tmp_path / "a.png")[760:1080, :540], INLIER) > 0.01


def test_a_lidar_is_seen_from_above_and_a_depth_map_from_between_the_sensors(pair):
    source, target, truth = pair
    scan = PointCloud(np.random.default_rng(0).uniform((-9, -3, 0), (9, 3, 2), (500, 3)))
    frame = viewing_frame(scan, scan, np.eye(4))
    assert np.linalg.det(frame) == pytest.approx(1.0)
    assert frame[2, 2] > 0.5, "who looks is above"
    assert abs(frame[0, 0]) > 0.9, "the long side runs across the picture"
    frame = viewing_frame(source, target, truth)
    assert np.linalg.det(frame) == pytest.approx(1.0)
    assert frame[2, 2] < -0.7, "who looks stands where the sensors are"
    assert frame[1, 1] < -0.7, "the image's down is the picture's down"
    assert frame[0, 0] > 0.7


def test_the_limits_hold_almost_all_points():
    points = np.random.default_rng(1).normal(size=(4000, 3))
    limits = bounds([points], np.eye(3))
    inside = (points[:, :2] > limits[:, 0]) & (points[:, :2] < limits[:, 1])
    assert inside.mean() > 0.999


def test_patches_know_their_point_their_spacing_and_their_normal():
    points = CAMERA.subsampled(4).unproject(np.full((120, 160), 2.0))
    points[3, 5] = np.nan
    patches, index = Patches.of(PointCloud(points), most=5000)
    np.testing.assert_array_equal(patches.points, points.reshape(-1, 3)[index])
    assert 3000 < len(index) <= 5000
    np.testing.assert_allclose(patches.spacing, 2.0 * 8 / 585.0, rtol=0.01)
    np.testing.assert_allclose(np.abs(patches.normals[:, 2]), 1.0, atol=1e-9)


def test_the_field_is_that_of_em_at_the_start(registered):
    source, target, result, init = registered
    field = field_before_first_step(source, target, init, "paper")
    assert isinstance(field, InlierField)
    moved = se3.transform(init, source.observed_points)
    nearest = np.linalg.norm(moved[:, None] - target.observed_points[None], axis=2).min(axis=1)
    np.testing.assert_allclose(field.distance[source.observed], nearest, rtol=1e-6)
    for values in (field.distance, field.first, field.last):
        np.testing.assert_array_equal(np.isnan(values), ~source.observed)
    # z^(0) calls nine points in ten inliers; one E-step moves few of them, all of them many.
    start = np.where(nearest > np.percentile(nearest, 90), -1, 1)
    first, last = (np.sign(z[source.observed]) for z in (field.first, field.last))
    assert 0 < np.mean(first != start) < 0.2
    assert np.mean(last != start) > np.mean(first != start)
    assert 1 < field.steps <= 600
    assert result.history[0].em_iterations >= field.steps


def test_a_rule_without_em_decides_once(registered):
    source, target, _, init = registered
    method = hmrf_icp.presets.preset("paper").with_parts(hmrf_icp.presets.rejector("percent"))
    field = field_before_first_step(source, target, init, method)
    np.testing.assert_array_equal(field.first, field.last)
    assert field.steps == 0
    assert np.mean(field.last[source.observed] > 0) == pytest.approx(0.9, abs=0.01)


@pytest.mark.parametrize("preset", hmrf_icp.presets.names())
def test_every_preset_has_a_field_to_show(registered, preset):
    source, target, _, init = registered
    field = field_before_first_step(source, target, init, preset)
    assert np.nanmin(field.last) >= -1
    assert np.nanmax(field.last) <= 1


def test_a_failure_leaves_the_old_picture_and_nothing_else(registered, tmp_path, monkeypatch):
    from matplotlib.figure import Figure

    source, target, result, init = registered
    path = tmp_path / "a.png"
    path.write_text("old")

    def full_disk(self, where, **_):
        with open(where, "wb") as stream:  # noqa: PTH123
            stream.write(b"half a picture")
        raise OSError("No space left on device")

    monkeypatch.setattr(Figure, "savefig", full_disk)
    with pytest.raises(OSError, match="No space"):
        registration_figure(source, target, result, path, init)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_drawing_touches_no_global_state_of_matplotlib(registered, tmp_path, monkeypatch):
    import matplotlib

    before = dict(matplotlib.rcParams)
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)  # importing it would fail
    source, target, result, init = registered
    registration_figure(source, target, result, tmp_path / "a.png", init)
    assert dict(matplotlib.rcParams) == before


def test_arguments_that_do_not_belong_together_are_refused(registered, tmp_path):
    source, target, result, init = registered
    with pytest.raises(InputError, match=r"result: .*\(48, 64\).*\(24, 32\)"):
        registration_figure(source.subsample(2), target, result, tmp_path / "a.png")
    field = field_before_first_step(source.subsample(2), target, init, "paper")
    with pytest.raises(InputError, match=r"field: .*\(48, 64\), got \(24, 32\)"):
        registration_figure(source, target, result, tmp_path / "a.png", init, field)
    with pytest.raises(InputError, match="init"):
        registration_figure(source, target, result, tmp_path / "a.png", 2 * np.eye(4))
    with pytest.raises(InputError, match="does not exist"):
        registration_figure(source, target, result, tmp_path / "nowhere" / "a.png", init)
    assert list(tmp_path.iterdir()) == []
