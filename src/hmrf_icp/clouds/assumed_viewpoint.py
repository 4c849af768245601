"""A place to look at a cloud from when nobody says where its sensor stood.

What a sensor saw hides nothing from where it stood. A cloud that was fused from many
places has no such place, but some hide less than others; what lies between such a place and
the surfaces was mostly looked through. Held against the other cloud, that space tells
right poses from wrong ones far better than distances do.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.surface import Surface, evenly

Array = NDArray[np.float64]

POINTS = 4000
"""Points that are held against each place."""

REACHED = 250
"""Points that tell how far a place is from a cloud: that sets no more than a cell of directions."""

FAR, ACROSS = 2.4, 9
"""Half the edge of the cube of places, in sizes of the cloud, and places along the edge."""

ORIGIN_FAVOURED, ORIGIN_AMONG = 0.1, 0.25
"""The origin is taken where at most this share more is hidden from it than from the best place,
and it is among the best so many: most clouds that were fused from a few views stand in the frame
of the first of them."""

CONE, WITHIN = math.radians(55.0), 0.95
"""Angle to the axis z within which so many of the points are, where the frame is a camera's: it
looks along z, or against it (OpenGL). Fragments of 3DMatch, fused from fifty views in the frame
of the first, have 95 in 100 within 28 to 48 degrees; in frames of any kind that is rare.
"""

CAMERA_FAVOURED = 0.25
"""The same as the first of above for the origin of such a frame, however many places hide less:
later views saw what is hidden from the first.
"""

STEPS = 3
"""Rounds of looking closer about the best place, each at half the distance."""


def assumed_viewpoint(surface: Surface, origin: Array) -> tuple[Array, float]:
    """Find the place (3,) from which the least of a surface is hidden, and the share that is.

    The ``origin`` (3,) of the frame that the cloud came in is taken where hardly more is hidden
    from it, and where the frame is a camera's unless much more is.
    """
    rows = evenly(surface, POINTS)
    points = np.ascontiguousarray(surface.points[rows])
    normals = np.ascontiguousarray(surface.normals[rows])
    if len(points) < 10:
        return surface.points.mean(axis=0), 1.0
    spacing = surface.spacing * np.sqrt(max(len(surface.points) / len(points), 1.0))
    centre = points.mean(axis=0)
    size = float(np.sqrt(((points - centre) ** 2).sum(axis=1).mean()))

    def hidden(places: Array) -> Array:
        from hmrf_icp.kernels.hidden_points import hidden_shares

        away = points[:: max(1, len(points) // REACHED)] - places[:, None]
        reach = np.median(np.linalg.norm(away, axis=2), axis=1)
        steps = np.clip(1.5 * spacing / np.maximum(reach, 1e-300), 0.015, 0.3)
        return np.asarray(hidden_shares(points, normals, 3.0 * spacing, places, steps))

    line = np.linspace(-FAR, FAR, ACROSS)
    offsets = np.stack(np.meshgrid(line, line, line), axis=-1).reshape(-1, 3)
    offsets = offsets[np.linalg.norm(offsets, axis=1) <= 1.01 * FAR]
    places = centre + size * offsets
    shares = hidden(places)
    best, least = places[np.argmin(shares)], float(shares.min())
    among = float(np.quantile(shares, ORIGIN_AMONG))
    reach = size * (line[1] - line[0])
    corners = np.stack(np.meshgrid(*[[-0.5, 0.0, 0.5]] * 3), axis=-1).reshape(-1, 3)
    for _ in range(STEPS):
        places = best + reach * corners
        shares = hidden(places)
        if shares.min() < least:
            best, least = places[np.argmin(shares)], float(shares.min())
        reach *= 0.5
    if np.linalg.norm(centre - origin) <= 2.0 * FAR * size:
        (here,) = hidden(origin[None])
        most = min(least + ORIGIN_FAVOURED, among)
        if in_camera_frame(points - origin):
            most = least + CAMERA_FAVOURED
        if here <= most:
            return origin, float(here)
    return best, least


def in_camera_frame(points: Array) -> bool:
    """Tell whether points (N, 3) stand in a cone before a camera at the origin of their frame."""
    cosine = points[:, 2] / np.maximum(np.linalg.norm(points, axis=1), 1e-300)
    edge = math.cos(CONE)
    return bool(max(np.mean(cosine > edge), np.mean(cosine < -edge)) >= WITHIN)
