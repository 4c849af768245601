"""Values that mean "nothing measured", told from points by what no surface does.

Recorders write (0, 0, 0), (-1, -1, -1), their own maximum or another constant where there was
no return. What is certain is left out and said; what may be a wall is left in, and said too.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SAMPLE = 10_000
"""Points that are enough to see whether a hundredth of them is at one place."""

FEWEST = 10
"""Points at one place that may be chance, or a place that was measured so often."""

SHARE = 0.01
"""Share of the points that a constant has at least, to be looked for."""

TIMES_USUAL = 10
"""Times the usual number of points a place that a constant has: clouds may hold each point twice.
"""

GAP = 3.0
"""Times farther than all else that a constant depth is no wall behind an empty room."""

SHELL = 1e-6
"""Share of the range within which returns from a sensor's maximum have it; stored singly."""


def nothing(
    points: Array, viewpoint: Array | None = None, depth: bool = False
) -> tuple[Mask | None, tuple[str, ...]]:
    """Tell which points (..., 3) stand for nothing, and say so.

    Parameters
    ----------
    points
        NaN where nothing is known to have been seen.
    viewpoint
        (3,) where the sensor stood, None where that is not known.
    depth
        Whether z is the depth of a camera.

    Returns
    -------
    mask, notes
        (...) where there is such a constant, None for nowhere; and a sentence for each.
    """
    doubts: tuple[str, ...] = ()
    found: list[tuple[Mask, str]] = []
    for place in _places(points):
        here = at_place(points, place)
        found.append((here, f"at exactly ({', '.join(f'{x:g}' for x in place)})"))
    left = points
    if found:
        left = points.copy()
        left[np.logical_or.reduce([mask for mask, _ in found])] = np.nan
    if depth:
        mask, certain = _farthest(left[..., 2])
        far = 0.0 if mask is None else float(left[..., 2][mask][0])
        if mask is not None and certain:
            found.append((mask, f"at a depth of exactly {far:g} m, far beyond all others"))
        elif mask is not None:
            doubts = (
                f"{np.count_nonzero(mask)} points have the largest depth, exactly {far:g} m each: "
                "if that is the sensor's maximum and no wall, leave them out (max_depth)",
            )
    elif viewpoint is not None:
        reach, mask = _shell(left, viewpoint)
        if mask is not None:
            found.append((mask, f"at a range of exactly {reach:g} m, the sensor's maximum"))
    if not found:
        return None, doubts
    total = int(np.count_nonzero(~np.isnan(points[..., 0])))
    notes = tuple(
        f"{np.count_nonzero(mask)} of {total} points are {where}: taken for nothing measured"
        for mask, where in found
    )
    return np.logical_or.reduce([mask for mask, _ in found]), notes + doubts


def _farthest(depth: Array) -> tuple[Mask | None, bool]:
    """Find where the largest depth is, if far more pixels have it than any other.

    And whether that is certain to stand for "too far".
    """
    if depth.size < 2 * FEWEST:
        return None, False
    far = np.fmax.reduce(depth, axis=None)
    # Not many have it in most images: that is seen without gathering those that are known.
    many = int(np.count_nonzero(depth == far))
    if many < FEWEST:
        return None, False
    seen = depth[~np.isnan(depth)]
    others = seen[seen != far]
    if many < SHARE * len(seen) or len(others) < FEWEST:
        return None, False
    some = others[:: max(1, len(others) // SAMPLE)]
    _, times = np.unique(some, return_counts=True)
    if many < TIMES_USUAL * times.max() * len(others) / len(some) and many < len(seen) / 2:
        return None, False
    return depth == far, bool(far > GAP * max(others.max(), 0.0))


def _places(points: Array) -> list[Array]:
    """Places that too many points are at."""
    flat = points.reshape(-1, 3)
    found = []
    zeros = int(np.count_nonzero(at_place(flat, np.zeros(3))))
    some = flat[:: max(1, len(flat) // SAMPLE)]
    some = some[~np.isnan(some[:, 0])]
    if len(some) < FEWEST:
        return []
    # One number stands for a place: sorting rows takes ten times as long.
    _, first, times = np.unique(some @ MIXED, return_index=True, return_counts=True)
    usual = float(np.median(times))
    if zeros >= max(FEWEST, TIMES_USUAL * usual) and zeros < len(flat):
        found.append(np.zeros(3))
    for k in np.flatnonzero(times >= max(SHARE * len(some), TIMES_USUAL * usual)):
        place = some[first[k]]
        if place.any() and np.count_nonzero(at_place(flat, place)) >= FEWEST:
            found.append(place)
    return found


MIXED = np.array([1.0, np.sqrt(2.0), np.sqrt(3.0)]) / 8.0
"""What a place is multiplied by to be one number, which no place is too far away for."""


def at_place(points: Array, place: Array) -> Mask:
    """Tell which points (..., 3) are exactly at a place (3,)."""
    here = np.asarray(points[..., 0] == place[0])
    for axis in (1, 2):
        if here.any():
            here &= points[..., axis] == place[axis]
    return here


def _shell(points: Array, viewpoint: Array) -> tuple[float, Mask | None]:
    """Find the range that stands for "too far": a sphere about the sensor, and nothing near it."""
    with np.errstate(over="ignore"):
        reach = np.linalg.norm(points - viewpoint, axis=-1)
    observed = ~np.isnan(reach)
    count = int(np.count_nonzero(observed))
    if count < 2 * FEWEST:
        return 0.0, None
    far = float(reach[observed].max())
    if far == np.inf:
        return 0.0, None
    here = reach >= far * (1.0 - SHELL)
    many = int(np.count_nonzero(here))
    beside = int(np.count_nonzero(reach >= far * (1.0 - 1000.0 * SHELL))) - many
    certain = many >= max(FEWEST, SHARE * count) and TIMES_USUAL * beside <= many
    return far, here if certain and count - many >= FEWEST else None
