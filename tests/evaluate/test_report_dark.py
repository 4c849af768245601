"""A report's figures follow the page into the dark, and stay well-formed."""

from __future__ import annotations

import re
from xml.etree import ElementTree as ET

import pytest

from hmrf_icp.drawing.palette import lightness
from hmrf_icp.evaluate.report.dark import DARK, GROUND, follows_the_page
from hmrf_icp.evaluate.report.style import (
    PAPER_LOOKS,
    PEER_LOOKS,
    PRESET_LOOKS,
    Drawing,
    drawing_style,
    sheet,
)


@pytest.fixture(scope="module")
def svg():
    with drawing_style():
        figure, ((axes,),) = sheet(1, 1, 3.0, 2.0)
        for number, look in enumerate((*PAPER_LOOKS.values(), *PRESET_LOOKS)):
            axes.plot([0, 1], [number, number + 1], label="a line", **look.arguments())
        axes.legend()
        return Drawing.of(figure, "lines", "", "").svg.decode()


def test_the_style_sheet_is_inside_and_names_what_is_drawn(svg):
    ET.fromstring(svg)
    (rules,) = re.findall(r"@media \(prefers-color-scheme:dark\)\{(.*)\}</style>", svg)
    for light, dark in re.findall(r'\[style\*="fill: (#\w+)"\]\{fill:(#\w+)!important\}', rules):
        assert DARK[light] == dark
        assert f"fill: {light}" in svg or f"stroke: {light}" in svg
    assert f"fill:{GROUND}" in rules, "the ground is that of the page"


def test_every_line_of_a_report_is_seen_on_either_ground():
    looks = (*PAPER_LOOKS.values(), *PRESET_LOOKS, *PEER_LOOKS)
    for colour in {look.colour for look in looks}:
        assert 100.0 - lightness(colour) > 25.0, f"{colour} on white"
        shown = DARK.get(colour, colour)
        assert lightness(shown) - lightness(GROUND) > 25.0, f"{shown} in the dark"


def test_what_is_no_colour_of_ours_stays():
    plain = '<?xml version="1.0"?><svg width="1"><path style="fill: #123456"/></svg>'
    assert "#123456!" not in follows_the_page(plain)
    assert plain.split("<path")[1] in follows_the_page(plain)
