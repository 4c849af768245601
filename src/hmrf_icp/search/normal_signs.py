"""Signs for normals that have none: those of neighbours agree, and most face the middle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.tree import Tree

Array = NDArray[np.float64]

NEIGHBOURS, REACH = 8, 2.5
"""Neighbours that a sign is handed on to, and how far at most, in edges of the thinning."""


def agreeing(points: Array, normals: Array, edge: float) -> Array:
    """Give normals (M, 3) signs that agree from each point (M, 3) to the next.

    Signs are handed on along a tree that prefers nearly parallel neighbours (Hoppe et al.,
    "Surface reconstruction from unorganized points", 1992). Each connected part then faces
    the middle of the cloud by majority, as what was seen from within or in front does.

    Parameters
    ----------
    points
        One point a cell of ``edge`` metres.

    Returns
    -------
    (M, 3)
    """
    from hmrf_icp.kernels.orientation import propagate

    if len(points) < 2:
        return np.array(normals)
    distance, index = Tree(points).query(points, k=min(NEIGHBOURS + 1, len(points)))
    index = np.where(distance > REACH * edge, -1, index)
    inward = points.mean(axis=0) - points
    facing = (inward * normals).sum(axis=1)
    signed = np.where(facing < 0.0, -1.0, 1.0)[:, None] * normals
    # The surest first: what faces the middle, far from it, is the root of its part.
    part = propagate(signed, index, np.argsort(-np.abs(facing), kind="stable"))
    majority = np.bincount(part, weights=(inward * signed).sum(axis=1))
    return np.asarray(np.where(majority[part] < 0.0, -1.0, 1.0)[:, None] * signed)
