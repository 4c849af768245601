"""A colour means one thing, and is told from its neighbours by the colour-blind and in grey."""

from __future__ import annotations

import re
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import plot
from hmrf_icp.drawing import palette

TOGETHER = (("source", "target"), ("inlier", "outlier"), ("inlier", "target"))
"""What lies on each other in one picture."""

# Machado, Oliveira and Fernandes 2009, severity 1, on linear RGB.
BLINDNESS = {
    "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
               [-0.003882, -0.048116, 1.051998]],
    "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
               [-0.011820, 0.042940, 0.968881]],
    "tritan": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
               [0.004733, 0.691367, 0.303900]],
}  # fmt: skip


def lab(colour, seen):
    value = palette.rgb(colour)
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    linear = np.clip(np.asarray(seen) @ linear, 0.0, 1.0)
    to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    x, y, z = np.cbrt(np.maximum(np.array(to_xyz) @ linear / [0.9505, 1.0, 1.089], 0.008856))
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("kind", BLINDNESS)
def test_no_two_meanings_look_alike_to_the_colour_blind(kind):
    for one, other in combinations(palette.MEANINGS, 2):
        gap = lab(palette.MEANINGS[one], BLINDNESS[kind]) - lab(
            palette.MEANINGS[other], BLINDNESS[kind]
        )
        assert np.linalg.norm(gap) > 10.0, f"{one} and {other} to a {kind} eye"


@pytest.mark.parametrize("pair", TOGETHER)
def test_what_lies_on_each_other_differs_in_grey(pair):
    light = [palette.lightness(palette.MEANINGS[name]) for name in pair]
    assert abs(light[0] - light[1]) > 20.0


def test_lightness_is_that_of_black_white_and_middle_grey():
    assert palette.lightness("#000000") == pytest.approx(0.0, abs=1e-6)
    assert palette.lightness("#ffffff") == pytest.approx(100.0, abs=0.01)
    assert palette.lightness("#777777") == pytest.approx(50.0, abs=0.5)


def test_labels_go_from_the_outliers_colour_to_the_inliers():
    ends = palette.between([0.0, 1.0])
    np.testing.assert_allclose(ends[0], palette.rgb(palette.OUTLIER))
    np.testing.assert_allclose(ends[1], palette.rgb(palette.INLIER))


def test_figures_have_no_colours_of_their_own():
    room = Path(hmrf_icp.__file__).parent / "figures"
    for path in room.glob("*.py"):
        assert not re.findall(r"#[0-9a-fA-F]{6}", path.read_text(encoding="utf-8")), path.name


def test_the_source_and_the_target_are_of_one_colour_wherever_they_are_named(result, filmed, ax):
    from matplotlib.colors import to_hex

    plot.before_after(result, *filmed[:2], ax, init=filmed[2])
    legend = ax.get_legend()
    named = {
        text.get_text(): to_hex(handle.get_markerfacecolor())
        for text, handle in zip(legend.get_texts(), legend.legend_handles, strict=True)
    }
    assert named["source"] == plot.MEANINGS["source"]
    assert named["target"] == plot.MEANINGS["target"]
    dots = {
        to_hex(line.get_markerfacecolor())
        for panel in ax.child_axes
        for line in panel.lines
        if "slice" in panel.get_title(loc="left") and line.get_marker() in "os"
    }
    assert dots in (set(), {plot.MEANINGS["source"], plot.MEANINGS["target"]})
