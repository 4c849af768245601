"""Groups of matches that one rigid motion explains, and their motions: many, not only the largest.

Matches are nodes of a graph, and an edge means that both can be right. Chance makes edges,
but hardly triangles: a match is worth what its edges have in common (SC2-PCR, Chen et al.,
CVPR 2022), and groups are cliques (MAC, Zhang et al., CVPR 2023). Normals as well as distances
must fit, which leaves one pair of matches in a hundred.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TOLERANCE = 2.0
"""Edges that two distances may differ by, and a match may be off."""

APART = 4.0
"""Edges that two places must be apart: closer ones say little of the rotation."""

TURN = 0.3
"""Largest difference of two cosines between normals and lines that may be the same."""

CLIQUE = 12
"""Members of a group that its motion is first fitted to."""

OFTEN = 1
"""Groups that a match is in before it is no seed of its own."""


@dataclass(frozen=True, eq=False)
class Oriented:
    """Matched points and normals of one cloud, (N, 3) each."""

    points: Array
    normals: Array


def motions(source: Oriented, target: Oriented, edge: float, seeds: int) -> tuple[Array, Array]:
    """Motions of the groups about the ``seeds`` best supported matches.

    Parameters
    ----------
    source, target
        Row by row the two ends of the matches.
    edge
        That the features were thinned to, metres.

    Returns
    -------
    Motions (K, 4, 4), source to target, and how many matches each explains, (K,), 3 or more.
    """
    from hmrf_icp.kernels import consistency

    ends = source.points, source.normals, target.points, target.normals
    tolerance = TOLERANCE * edge
    bits = consistency.compatible(*ends, tolerance, APART * edge, TURN)
    support = consistency.support(bits)
    best = np.argsort(-support, kind="stable")
    members = consistency.groups(bits, best[support[best] > 0.0], seeds, OFTEN, CLIQUE)
    poses, explained = consistency.motions(members, *ends, tolerance)
    good = explained >= 3.0
    return np.asarray(poses[good]), np.asarray(explained[good])


def explained(poses: Array, source: Oriented, target: Oriented, edge: float) -> Array:
    """How many of the matches each pose (K, 4, 4) explains, (K,)."""
    from hmrf_icp.kernels import consistency

    ends = source.points, source.normals, target.points, target.normals
    return np.asarray(consistency.explained(poses, *ends, TOLERANCE * edge))
