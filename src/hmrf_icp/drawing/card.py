"""A summary for a notebook: a few numbers and a small picture, as HTML that needs nothing else."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from html import escape

import numpy as np

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.drawing import palette
from hmrf_icp.drawing.oblique import Patches, bounds, lit, viewing_frame
from hmrf_icp.drawing.painter import paint
from hmrf_icp.se3 import Array

POINTS = 6000
"""About so many points of each cloud are drawn: the picture is small."""

SIZE = 320, 200
"""Pixels."""


def card(
    verdict: str,
    believed: bool,
    advice: str | None,
    rows: Sequence[tuple[str, str]],
    picture: bytes | None,
) -> str:
    """Lay out a summary in the colours of the page that it stands in.

    Parameters
    ----------
    verdict
        In a few words.
    believed
        Whether the result is to be believed; one that is not is hatched.
    advice
        What to try, or None.
    rows
        Names and values.
    picture
        A PNG, or None.
    """
    edge = palette.INLIER if believed else palette.VIOLATED
    head = "font-weight:bold;padding:2px 6px;"
    if not believed:
        hatch = f"{palette.VIOLATED} 0 6px,#a84a00 6px 12px"
        head += f"color:#fff;background:repeating-linear-gradient(135deg,{hatch});"
    table = "".join(
        '<tr style="background:none"><td style="text-align:left;opacity:.75;padding:1px 12px '
        f'1px 6px">{escape(name)}</td><td style="text-align:left;padding:1px 0">{escape(value)}'
        "</td></tr>"
        for name, value in rows
    )
    note = "" if advice is None else f'<div style="padding:2px 6px">{escape(advice)}</div>'
    image = ""
    if picture is not None:
        data = base64.b64encode(picture).decode("ascii")
        key = " &#8196;".join(
            f'<span style="color:{colour}">&#9679;</span> {name}'
            for name, colour in (
                ("target", palette.TARGET),
                ("inliers", palette.INLIER),
                ("outliers", palette.OUTLIER),
            )
        )
        image = (
            f'<div><img width="{SIZE[0]}" height="{SIZE[1]}" style="max-width:100%;height:auto" '
            'alt="The source on the target" '
            f'src="data:image/png;base64,{data}"/><div style="font-size:85%">{key}</div></div>'
        )
    return (
        f'<div style="border-left:4px solid {edge};padding-left:6px;display:flex;flex-wrap:wrap;'
        f'gap:12px;color:inherit"><div><div style="{head}">{escape(verdict)}</div>{note}'
        f'<table style="border-collapse:collapse;border:none;margin:2px 0;color:inherit">{table}'
        f"</table></div>{image}</div>"
    )


def picture(source: PointCloud, target: PointCloud, pose: Array, probability: Array) -> bytes:
    """Paint the source on the target as a small PNG without a ground.

    Parameters
    ----------
    source, target
        The clouds.
    pose
        (4, 4) source to target.
    probability
        (M,) of being an inlier, one entry an observed source point.
    """
    from PIL import Image

    frame = viewing_frame(source, target, pose)
    staying, _ = Patches.of(target, POINTS)
    moving, flat = Patches.of(source, POINTS)
    moving = moving.moved(pose)
    kept = np.cumsum(source.observed.ravel())[flat] - 1
    limits = bounds([staying.points, moving.points], frame, aspect=SIZE[0] / SIZE[1])
    ground = np.tile(palette.rgb(palette.TARGET), (len(staying.points), 1))
    labels = palette.between(probability[kept])
    layers = [(staying, lit(staying, ground, frame)), (moving, lit(moving, labels, frame))]
    png = io.BytesIO()
    Image.fromarray(paint(layers, frame, limits, SIZE)).save(png, format="PNG")
    return png.getvalue()
