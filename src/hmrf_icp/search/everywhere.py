"""Hypotheses where no start is given: one kind after the other, until one convinces."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.prepared import PreparedCloud

Array = NDArray[np.float64]

MOST = 200
"""Hypotheses of one kind."""


def everywhere(source: PreparedCloud, target: PreparedCloud) -> Iterator[Array]:
    """Yield poses (K, 4, 4), source to target, that may be right, wherever the clouds stand.

    How surfaces face, and where they fit, comes first: it needs no corner that both clouds
    saw. Local features find what has no large surfaces in common. Where the side from which
    surfaces were seen is a guess, features without it come last.
    """
    from hmrf_icp.search.hypotheses import hypotheses
    from hmrf_icp.search.plane_hypotheses import plane_hypotheses, sampled

    mine, theirs = source.surface, target.surface
    if not (mine.normals.any() and theirs.normals.any()):
        return
    first, second = (
        sampled(one.points, one.normals, one.patch, one.oriented, cloud.cloud.viewpoint)
        for cloud, one in ((source, mine), (target, theirs))
    )
    if not any(np.ptp(one.points, axis=0).any() for one in (first, second)):
        return  # a place with a normal fits onto another in any way
    for poses, _ in plane_hypotheses(first, second, MOST):
        yield poses
    sides = mine.points, mine.normals, theirs.points, theirs.normals
    yield hypotheses(*sides, True, MOST).poses
    if not (mine.oriented and theirs.oriented):
        yield hypotheses(*sides, False, MOST).poses
