"""Which side of a surface was seen, by the normals that came with its points.

A file's normals say two things: a direction, which the points show too, and a sign, which they do
not. The sign is worth having where no viewpoint gives one, but most files' means nothing: normals
that were estimated and not oriented have that of an eigenvector, and others were turned into one
half space. Signs that mean a side go on round bends; the others change there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.surface import Surface
from hmrf_icp.clouds.tree import Tree

Array = NDArray[np.float64]

POINTS = 4000
"""Points of a cloud that are enough to tell whether its normals mean anything."""

ALONG = 0.6
"""Cosine to the fitted normal from which a given one is that of the same surface.

Along a sharp edge the fit is in the middle between two faces, and the cosine 0.71.
"""

FITTING = 0.7
"""Share of the points whose given normals are along the fitted ones, at the least.

Normals with noise of 10 degrees have 0.8 to 1; of random ones 0.4 have it by chance, and
of those of another frame, or of a constant, what planes happen to be along them.
"""

BESIDE = 8
"""Neighbours of each point that its sign is held against."""

ALIKE, BENT = 0.9, 0.4
"""Cosines between the normals of neighbours: on one sheet above the first, and about a bend
between both; below the second nobody can tell which signs agree."""

COHERENT, ROUND_BENDS = 0.97, 0.9
"""Share of neighbours on one sheet, and about a bend, whose signs agree, at the least. Measured in
docs/research.md: true sides have 0.97 and 0.88 to 1; signs of eigenvectors 0.66 to 0.90 and 0.56 to
0.79. A half space has as much as true sides only where nearly all of the surface lies in one.
"""

WHOLE = 0.85
"""Share of the points that no seam cuts off, at the least.

A seam across a smooth sheet is short: half a bunny was the wrong way round with 0.98 and 0.92 of
the neighbours in agreement.
"""

BENDS = 50
"""Pairs of neighbours about a bend that must be there: without any a sign means nothing."""


@dataclass(frozen=True)
class Sides:
    """Whether given normals tell which side of a surface was seen.

    Attributes
    ----------
    known
        Whether they do.
    text
        Why not, in words.
    """

    known: bool
    text: str = ""


def sides(surface: Surface, given: Array) -> Sides:
    """Judge the normals (M, 3) that came with the points of a surface; any length, any values."""
    fitted = (surface.normals != 0.0).any(axis=1)
    sign = _signs(surface, given)
    if np.count_nonzero(sign) < FITTING * max(int(np.count_nonzero(fitted)), 1):
        return Sides(False, "they are not those of its surface")
    rows = np.flatnonzero(sign)
    points, normals = surface.points[rows], surface.normals[rows]
    facing = sign[rows, None] * normals
    _, index = Tree(points).query(points, k=min(BESIDE + 1, len(points)))
    index = index.reshape(len(points), -1)[:, 1:].astype(np.intp)
    cosine = np.einsum("ij,ikj->ik", normals, normals[index])
    agree = np.einsum("ij,ikj->ik", facing, facing[index]) > 0.0
    alike = np.abs(cosine) > ALIKE
    bent = (np.abs(cosine) > BENT) & ~alike
    if np.count_nonzero(bent) < BENDS:
        return Sides(False, "nothing bends, so that any sign would do")
    if agree[alike].mean() < COHERENT or agree[bent].mean() < ROUND_BENDS:
        return Sides(False, "neighbours face opposite ways")
    if _together(index, alike, agree) < WHOLE:
        return Sides(False, "a seam divides its surface")
    return Sides(True)


def _together(index: NDArray[np.intp], alike: NDArray[np.bool_], agree: NDArray[np.bool_]) -> float:
    """Tell which share of the points no seam of changing signs cuts off from a larger piece.

    ``index`` (M, K) lists neighbours, ``alike`` those on the same sheet, ``agree`` of the same
    sign. A seam about a piece of n points has about three times as many links as the root of n
    at the least; fewer than that root are where two faces happen to touch.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    row, column = np.nonzero(alike & agree)
    links = coo_array((np.ones(len(row)), (row, index[row, column])), shape=(len(index),) * 2)
    _, piece = connected_components(links, directed=False)
    size = np.bincount(piece)
    row, column = np.nonzero(alike & ~agree)
    ends = np.sort(np.stack([piece[row], piece[index[row, column]]]), axis=0)
    pairs, count = np.unique(ends[:, ends[0] != ends[1]], axis=1, return_counts=True)
    seam = count > np.sqrt(size[pairs].min(axis=0))
    one, other = pairs[:, seam]
    lost = np.unique(np.where(size[one] < size[other], one, other))
    return float(1.0 - size[lost].sum() / len(index))


def facing(surface: Surface, given: Array) -> Surface:
    """Turn the normals of a surface to the side that given ones (M, 3) are on.

    The direction stays as the points have it. Where the given one is none, or across the
    surface, the nearest point with a better one decides.
    """
    sign = _signs(surface, given)
    sure, lost = np.flatnonzero(sign), np.flatnonzero(sign == 0.0)
    if sure.size and lost.size:
        _, near = Tree(surface.points[sure]).query(surface.points[lost])
        near = sure[near.astype(np.intp)]
        along = (surface.normals[lost] * surface.normals[near]).sum(axis=1) * sign[near]
        sign[lost] = np.where(along < 0.0, -1.0, 1.0)
    return replace(surface, normals=sign[:, None] * surface.normals, oriented=True)


def _signs(surface: Surface, given: Array) -> Array:
    """Sign (M,) that turns each fitted normal to the side of the given one, 0 where none does."""
    with np.errstate(invalid="ignore", over="ignore"):
        largest = np.abs(given).max(axis=1)
        usable = np.isfinite(largest) & (largest > 0.0)
        unit = given / np.where(usable, largest, 1.0)[:, None]  # no square of these overflows
        unit = np.where(usable[:, None], unit, 0.0)
        cosine = (unit * surface.normals).sum(axis=1)
        long = np.sqrt((unit**2).sum(axis=1))
    return np.asarray(np.where(np.abs(cosine) > ALONG * long, np.sign(cosine), 0.0))
