"""How much of one surface another cloud holds too, told from the geometry of both."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.clouds.range_image import BAND
from hmrf_icp.clouds.surface import evenly

Array = NDArray[np.float64]

DETAIL = 20_000
"""Points of each cloud that stand for its surface at the most."""

ASKED = 4000
"""Points of the source that are asked: one in a hundred is told with a tenth of that."""

REACH = 2.0
"""Spacings of the target within which a point has a counterpart: those of a surface that
is sampled at random are seldom farther apart."""

NEIGHBOURS = 4
"""Target points that may be the counterpart: along an edge the closest faces either way."""

FACING = 0.3
"""Least cosine between the normals of a point and of its counterpart, where
both clouds are about as dense."""

AS_DENSE = 3.0
"""Ratio of spacings up to which normals are compared: those of a coarse cloud pass over
what a fine one shows."""


def overlap(source: PreparedCloud, target: PreparedCloud, pose: Array) -> float:
    """Tell which share of the source's surface has a counterpart in the target's.

    A point has one where a target point is as near as the noise and the spacing
    of both clouds allow, and faces the same way. What the target did not
    see, hidden or outside of its view, is no overlap.

    Parameters
    ----------
    source, target
        The clouds.
    pose
        (4, 4) source to target.

    Returns
    -------
    In [0, 1]: a share of area, not of points.
    """
    seen = source.viewed, target.viewed
    # At edges, normals from windows of an image and normals from lists are not alike; and a
    # viewpoint that is not believed does not turn them either.
    if all(one.cloud.organised for one in seen) or source.doubt or target.doubt:
        source, target = seen
    source, target = source.downsampled(DETAIL), target.downsampled(DETAIL)
    surface, onto = source.surface, target.surface
    rows = evenly(surface, ASKED)
    if not len(rows):
        rows = np.arange(len(source))
    points = se3.transform(pose, surface.points[rows])
    normals = surface.normals[rows] @ pose[:3, :3].T
    distance, near = target.tree.query(np.ascontiguousarray(points), k=min(NEIGHBOURS, len(target)))
    distance, near = distance.reshape(len(rows), -1), near.reshape(len(rows), -1)
    noise = np.hypot(surface.noise[rows, None], onto.noise[near])
    found = distance < REACH * np.sqrt(onto.area[near]) + BAND * noise
    if 1.0 / AS_DENSE < surface.spacing / max(onto.spacing, 1e-300) < AS_DENSE:
        cosine = np.einsum("ij,ikj->ik", normals, onto.normals[near])
        if not (surface.oriented and onto.oriented):
            cosine = np.abs(cosine)
        # Exactly 0 where one of them has no normal.
        found &= (cosine > FACING) | (cosine == 0.0)
    # They were chosen by patches, and count by area.
    return float(np.average(found.any(axis=1), weights=surface.area[rows] / surface.patch[rows]))
