"""Each figure is drawn in the axes given, says how far to believe it, and changes nothing else."""

from __future__ import annotations

import copy
import pickle

import matplotlib as mpl
import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import plot
from hmrf_icp.drawing import palette
from hmrf_icp.errors import InputError
from hmrf_icp.figures.pair import Pair
from hmrf_icp.figures.section import find_section
from hmrf_icp.figures.style import BANNER, Lengths, ink, own_figure

FIGURES = {
    "before_after": plot.before_after,
    "labels": plot.labels,
    "field": plot.field,
    "residuals": plot.residuals,
    "convergence": plot.convergence,
    "deviation": plot.deviation,
}


def banners(ax):
    return [one for one in ax.get_children() if one.get_gid() == BANNER]


@pytest.mark.parametrize("name", FIGURES)
def test_the_axes_given_come_back_with_verdict_names_and_method(name, result, ax):
    before = dict(mpl.rcParams)
    assert FIGURES[name](result, ax=ax, names=("a.ply", "b.ply"), method="paper") is ax
    title = " ".join(ax.get_title(loc="left").split())  # a long one takes two lines
    assert result.verdict in title
    assert "a.ply to b.ply" in title
    assert "by paper" in title
    assert banners(ax) == []
    ax.figure.canvas.draw()
    assert dict(mpl.rcParams) == before


@pytest.mark.parametrize("name", FIGURES)
def test_a_result_that_is_not_believed_looks_wrong(name, wrong, ax):
    FIGURES[name](wrong, ax=ax)
    assert "NOT convincing, confidence 0.12" in ax.get_title(loc="left")
    parts = banners(ax)
    assert any("NOT BELIEVED: confidence 0.12" in getattr(p, "_text", "") for p in parts)
    assert any(getattr(p, "get_hatch", lambda: None)() for p in parts), "a hatched banner"
    edges = [mpl.colors.to_hex(p.get_edgecolor()) for p in parts if hasattr(p, "get_hatch")]
    assert set(edges) == {palette.VIOLATED}


@pytest.mark.parametrize("name", FIGURES)
def test_axes_of_others_are_left_as_they_are(name, result):
    figure = own_figure(8.0, 4.0)
    mine, other = figure.subplots(1, 2)
    other.plot([0, 1], [3, 5])
    before = other.get_position().bounds, other.get_xlim(), len(other.get_children())
    FIGURES[name](result, ax=mine)
    assert (other.get_position().bounds, other.get_xlim(), len(other.get_children())) == before


def test_without_axes_a_figure_of_pyplots_is_made(result):
    mpl.use("agg")
    from matplotlib import pyplot

    before = set(pyplot.get_fignums())
    ax = plot.residuals(result)
    try:
        assert set(pyplot.get_fignums()) - before == {ax.figure.number}
    finally:
        pyplot.close(ax.figure)


def test_ink_follows_the_ground():
    for ground, colour in (
        ("white", palette.DARK_INK),
        ("#0d1117", palette.LIGHT_INK),
        ("none", palette.MIDDLE_INK),
    ):
        figure = own_figure(2.0, 2.0)
        figure.set_facecolor(ground)
        ax = figure.add_subplot(facecolor=ground)
        assert ink(ax) == colour
    for ground in ("#ffffff", "#0d1117"):
        light = [palette.lightness(one) for one in (ground, palette.MIDDLE_INK)]
        assert abs(light[0] - light[1]) > 40.0, "read on either ground"


def test_the_field_is_the_labels_pixel_by_pixel(result, ax):
    plot.field(result, ax)
    drawn = ax.images[0].get_array()
    np.testing.assert_allclose(drawn.filled(np.nan), result.inlier_probability)


def test_a_list_of_points_has_no_field_and_is_told_what_has(wavy, ax):
    result = hmrf_icp.register(wavy - [0.02, 0.0, 0.01], wavy)
    with pytest.raises(InputError, match=r"plot\.labels"):
        plot.field(result, ax)
    assert plot.labels(result, ax=ax) is ax


def test_a_copy_holds_no_clouds_and_takes_them(filmed, ax):
    source, target, init, result, _ = filmed
    for other in (copy.deepcopy(result), pickle.loads(pickle.dumps(result))):
        with pytest.raises(InputError, match="give source and target"):
            plot.before_after(other, ax=ax)
        assert plot.before_after(other, source, target, ax, init=init) is ax
    with pytest.raises(InputError, match="both clouds"):
        plot.labels(result, source, ax=ax)
    with pytest.raises(InputError, match="shape"):
        plot.labels(result, target.subsample(2), target, ax)


def test_before_and_after_are_seen_at_one_scale_and_close_up_where_little_moved(filmed, ax):
    source, target, init, result, _ = filmed
    plot.before_after(result, source, target, ax, init=init)
    named = {one.get_title(loc="left"): one for one in ax.child_axes}
    assert named["Before"].get_xlim() == named["After"].get_xlim()
    slices = [panel for name, panel in named.items() if "slice" in name]
    assert len(slices) == 2
    assert slices[0].get_xlim() == slices[1].get_xlim()
    wide = [np.ptp(panel.get_xlim()) for panel in (named["Before"], slices[0])]
    assert wide[1] < wide[0] / 2, "closer up"


def test_a_large_motion_needs_no_close_up(filmed, ax):
    source, target, init, result, _ = filmed
    far = init.copy()
    far[:3, 3] += 1.0
    plot.before_after(result, source, target, ax, init=far)
    assert not [p for p in ax.child_axes if "slice" in p.get_title(loc="left")]


def test_a_slice_holds_both_clouds_and_shows_the_motion(filmed):
    _, _, init, result, _ = filmed
    pair = Pair.of(result)
    before = pair.between(init)
    inlier = result.correspondences.matched.probability > 0.5
    section = find_section(pair, before, inlier, 1.0, 0.4)
    np.testing.assert_allclose(section.axes @ section.axes.T, np.eye(3), atol=1e-12)
    heights = []
    for pose in (before, pair.pose):
        moved = pair.source.points @ pose[:3, :3].T + pose[:3, 3]
        mine, theirs = section.points(moved), section.points(pair.target.points)
        assert min(len(mine), len(theirs)) > 5
        gap = np.abs(mine[:, None] - theirs[None]).sum(axis=2).min(axis=1)
        heights.append(np.median(gap))
    assert heights[1] < heights[0], "apart before, together after"


def test_convergence_shows_what_the_history_holds(result, ax):
    plot.convergence(result, ax)
    lines = {line.get_label(): line.get_ydata() for line in ax.lines}
    sigma = [1000 * one.parameters["sigma_in"] for one in result.history]
    np.testing.assert_allclose(lines["sigma_in"], sigma)
    assert mpl.colors.to_hex(ax.lines[0].get_color()) == palette.INLIER
    with pytest.raises(InputError, match="unit"):
        plot.convergence(result, ax, unit="feet")


def test_lengths_claim_no_unit_that_nobody_knows():
    assert Lengths("m").text(0.0123) == "12.3 mm"
    assert Lengths("m").text(1.5) == "1.5 m"
    assert Lengths(None).text(0.0123) == "0.0123 units"
    assert Lengths(None).short == (1.0, "units")


def test_free_directions_are_drawn_in_their_colour(ax):
    rng = np.random.default_rng(2)
    walls = (
        np.column_stack([rng.uniform(-1, 1, (900, 2)), rng.normal(off, 0.003, 900)])
        for off in (0.0, 0.01)
    )
    method = hmrf_icp.presets.method("paper", "field", "symmetric")
    result = hmrf_icp.register(*walls, np.eye(4), preset=method)
    assert result.degenerate
    plot.before_after(result, ax=ax)
    arrows = [
        text for panel in ax.child_axes for text in panel.texts if hasattr(text, "arrow_patch")
    ]
    assert len(arrows) == len(result.degenerate)
    for arrow in arrows:
        assert mpl.colors.to_hex(arrow.arrow_patch.get_edgecolor()) == palette.FREE


def test_long_names_take_a_second_line_and_stay_inside():
    from hmrf_icp.figures.style import fitting

    words = (
        "Inliers, room-17_scan_0001_registered.ply to room-17_scan_0002_registered.ply, by robust"
    )
    assert fitting(words, 1000.0, 10.0) == (words, 10.0)
    lines, size = fitting(words, 380.0, 10.0)
    assert size < 10.0
    assert lines.replace("\n", " ") == words
    shortened, _ = fitting(5 * words, 380.0, 10.0)
    assert shortened.count("\n") == 1
    assert shortened.endswith("…")
