"""Poses from nowhere, by how surfaces face and where they fit: no start and no features.

Features need corners that both clouds saw. A table seen in an orbit, walls, a tenth of
overlap have few; but that surfaces face alike leaves few rotations
(:mod:`hmrf_icp.search.orientations`), and for each a correlation of all shifts
(:mod:`hmrf_icp.search.correlation`) tells where surfaces agree without standing in space
that was seen to be empty.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.search.correlation import Correlator, Sampled
from hmrf_icp.search.orientations import Orientations, likely_rotations
from hmrf_icp.stages import stage

Array = NDArray[np.float64]

POINTS = 3000
"""Points of each cloud that take part, each for the same area."""

RAYS = 10_000
"""Rays of each that tell what is empty."""

ROTATIONS, FINE = 150, 40
"""Rotations that are found at the most, and those of them that are correlated on fine grids.

Half of these are the likeliest as they are, half the best of the others on coarse grids: where
much overlaps the first are right, and where little does the second.
"""

FIRST = 12
"""Rotations whose poses come before the others are looked at: where much overlaps, enough."""

COARSE_CELLS, CELLS = 32, 48
"""Cells along each edge of the grids."""

SHIFTS = 8
"""Shifts that are kept of each rotation."""


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
    every = np.flatnonzero((normals != 0.0).any(axis=1))
    rows, rays = (every[evenly(area[every], n)] for n in (count, RAYS))
    return Sampled(points[rows], normals[rows], signed, points[rays], viewpoint)


def evenly(area: Array, count: int) -> NDArray[np.intp]:
    """Rows of about ``count`` points that each stand for the same share of the area (M,)."""
    if len(area) <= count:
        return np.arange(len(area))
    # A few points that stand for far more than their share would be taken once only.
    share = np.minimum(area, 20.0 * np.median(area))
    passed = np.floor(np.cumsum(share) * (count / share.sum()) + 0.5)
    return np.flatnonzero(np.diff(passed, prepend=0.0) > 0)


def plane_hypotheses(
    source: Sampled, target: Sampled, most: int, rotations: int = ROTATIONS, fine: int = FINE
) -> Iterator[tuple[Array, Array]]:
    """Find poses under which surfaces face alike, agree, and leave empty space empty.

    Parameters
    ----------
    source, target
        The clouds; see :func:`sampled`.
    most
        Poses to yield at a time at the most.
    rotations
        Rotations that are tried at the most.
    fine
        Those of them that are looked at closely.

    Yields
    ------
    (K, 4, 4) poses, source to target, the likeliest first, and their scores (K,): the
    logarithm of agreement to violation. Good to about half a cell and four degrees. Those of the
    :data:`FIRST` rotations come first, and then all others.
    """
    turns = _likely(source, target, rotations)
    correlator = stage("planes")(Correlator)(source, target, CELLS)
    yield _best(correlator, turns[:FIRST], most)
    if len(turns) > fine:
        turns = _promising(source, target, turns, fine)
    if len(turns) > FIRST:
        yield _best(correlator, turns[FIRST:], most)


@stage("planes")
def _likely(source: Sampled, target: Sampled, rotations: int) -> Array:
    """Rotations (K, 3, 3) under which surfaces face alike, the likeliest first."""
    signed = source.signed and target.signed
    turns, _ = likely_rotations(
        Orientations.of(source.normals, signed), Orientations.of(target.normals, signed), rotations
    )
    return turns


@stage("planes")
def _promising(source: Sampled, target: Sampled, turns: Array, fine: int) -> Array:
    """Choose ``fine`` of the rotations: half are the first, half do best on coarse grids."""
    sure = fine // 2
    peaks = Correlator(source, target, COARSE_CELLS).peaks_of_each(turns[sure:], 1)
    promise = [max(score, default=-np.inf) for _, score in peaks]
    others = np.argsort(-np.array(promise), kind="stable")[: fine - sure]
    return np.concatenate([turns[:sure], turns[sure + np.sort(others)]])


@stage("planes")
def _best(correlator: Correlator, turns: Array, most: int) -> tuple[Array, Array]:
    """Poses of these rotations and of the shifts that go with them, the likeliest first."""
    poses, scores = [], []
    for rotation, (shifts, score) in zip(
        turns, correlator.peaks_of_each(turns, SHIFTS), strict=True
    ):
        pose = np.zeros((len(shifts), 4, 4))
        pose[:, :3, :3], pose[:, :3, 3], pose[:, 3, 3] = rotation, shifts, 1.0
        poses.append(pose)
        scores.append(score)
    every = np.concatenate(scores)
    best = np.argsort(-every, kind="stable")[:most]
    return np.concatenate(poses)[best], every[best]
