"""Poses from nowhere, by how surfaces face and where they fit: no start and no features.

Features need corners that both clouds saw. A table seen in an orbit, walls, a tenth of
overlap have few; but that surfaces face alike leaves few rotations
(:mod:`hmrf_icp.search.orientations`), and for each a correlation of all shifts
(:mod:`hmrf_icp.search.correlation`) tells where surfaces agree without standing in space
that was seen to be empty.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.search.correlation import Correlator, Sampled
from hmrf_icp.search.orientations import Orientations, likely_rotations

Array = NDArray[np.float64]

POINTS = 3000
"""Points of each cloud that take part, each for the same area."""

ROTATIONS, SHIFTS = 100, 8
"""Rotations that are correlated at the most, and shifts that are kept of each."""

CELLS = 48
"""Cells along each edge of the grids."""


def sampled(
    points: Array,
    normals: Array,
    area: Array,
    signed: bool,
    viewpoint: Array | None = None,
    count: int = POINTS,
) -> Sampled:
    """Choose about ``count`` points of a surface, each for the same area.

    Parameters
    ----------
    points, normals
        (M, 3) metres, and unit vectors; zero where a point has no normal.
    area
        (M,) that each point stands for, square metres.
    signed
        Whether the normals point to where the surface was seen from.
    viewpoint
        (3,) that place, metres; None where it is not known.
    """
    rows = np.flatnonzero((normals != 0.0).any(axis=1))
    if len(rows) > count:
        # A few points that stand for far more than their share would be taken once only.
        share = np.minimum(area[rows], 20.0 * np.median(area[rows]))
        passed = np.floor(np.cumsum(share) * (count / share.sum()) + 0.5)
        rows = rows[np.diff(passed, prepend=0.0) > 0]
    return Sampled(points[rows], normals[rows], signed, viewpoint)


def plane_hypotheses(
    source: Sampled, target: Sampled, most: int, rotations: int = ROTATIONS, cells: int = CELLS
) -> tuple[Array, Array]:
    """Find poses under which surfaces face alike, agree, and leave empty space empty.

    Parameters
    ----------
    source, target
        The clouds; see :func:`sampled`.
    most
        Poses to return at the most.
    rotations
        Rotations that are tried at the most.
    cells
        Cells along each edge of the grids.

    Returns
    -------
    (K, 4, 4) poses, source to target, the likeliest first, and their scores (K,): the
    logarithm of agreement to violation. Good to about half a cell and four degrees.
    """
    signed = source.signed and target.signed
    turns, _ = likely_rotations(
        Orientations.of(source.normals, signed), Orientations.of(target.normals, signed), rotations
    )
    correlator = Correlator(source, target, cells)
    poses, scores = [], []
    for rotation in turns:
        shifts, score = correlator.peaks(rotation, SHIFTS)
        pose = np.zeros((len(shifts), 4, 4))
        pose[:, :3, :3], pose[:, :3, 3], pose[:, 3, 3] = rotation, shifts, 1.0
        poses.append(pose)
        scores.append(score)
    every = np.concatenate(scores)
    best = np.argsort(-every, kind="stable")[:most]
    return np.concatenate(poses)[best], every[best]
