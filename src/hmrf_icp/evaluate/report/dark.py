"""Figures of a report on a dark page: an SVG that takes other colours where the reader asks so."""

from __future__ import annotations

from hmrf_icp.drawing import palette

GROUND = "#14171b"
"""Ground of the page in the dark, as in its style sheet."""

DARK = {
    "#ffffff": GROUND,
    "#000000": palette.LIGHT_INK,
    "#e3e3e3": "#39414b",
    "#555555": "#a3adb8",
    "#767676": "#98a2ad",
    "#0072b2": "#4aa3df",
    "#4b0092": "#b48cf2",
    "#7a4a00": "#bd8b4b",
    "#005f4b": "#45c8ab",
    "#a1123f": "#f0688f",
    "#0000ff": "#7d97ff",
    "#8b4513": "#c98a5a",
    "#6a0dad": "#b483e0",
}
"""Colours that a dark ground swallows, and those that stand for them there. Others stay."""


def follows_the_page(svg: str) -> str:
    """Add to a figure of matplotlib's how it looks in the dark.

    Browsers and code hosts ask a picture's own style sheet, so that the file alone does it.
    """
    rules = "".join(
        f'[style*="{part}: {light}"]{{{part}:{dark}!important}}'
        for light, dark in DARK.items()
        if light in svg
        for part in ("fill", "stroke")
    )
    # Letters are black by not saying anything.
    style = f"<style>@media (prefers-color-scheme:dark){{svg{{fill:{DARK['#000000']}}}{rules}}}"
    begin = svg.index(">", svg.index("<svg")) + 1
    return f"{svg[:begin]}\n {style}</style>{svg[begin:]}"
