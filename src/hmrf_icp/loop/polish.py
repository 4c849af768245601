"""The last steps: only matches that agree within the noise, across the surface from each other.

The loop has to find the pose, and is content with much that keeps it a little off. The closest of
a few noisy points is the one whose noise leads towards the source. Normals fitted
across an edge are wrong in both clouds, and differently so in views from elsewhere; such
matches are few and far off in units of the noise, so they weigh much. Once the pose is
found, all that can be told apart: a match counts less the farther off it is (Beaton and
Tukey's biweight, 1974), not at all where the normals differ by more than noise makes
them, and of the closest points the one straight across is taken.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.loop.icp import Iteration, LoopResult, rms
from hmrf_icp.loop.match import Matches
from hmrf_icp.loop.placed import Placed
from hmrf_icp.loop.reject import Labels
from hmrf_icp.loop.surface_metrics import LEAST_NOISE, SurfaceMetric
from hmrf_icp.stages import stage

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

STEPS = 2
"""The second is a tenth of the first and less, and a third changes nothing."""

NEAR = 5
"""Target points among which the one across is looked for; nine do no better."""

CUT = 4.0
"""Deviations of the noise, or of what is left over if that is more, beyond which a match is
left out."""

BEYOND = 9.0
"""Times its mean that the square of a difference of normals is disagreement and not noise;
as in :mod:`hmrf_icp.kernels.geometry`."""

HARDLY = 0.01
"""Probability of being an inlier below which nobody asks what a point is matched to."""

MEDIAN = 0.6745
"""Median of the absolute value of a standard normal variable."""


@stage("last steps")
def polish(
    loop: LoopResult,
    source: PreparedCloud,
    target: PreparedCloud,
    metric: SurfaceMetric,
    on_iteration: Callable[[Iteration], None] | None = None,
) -> LoopResult:
    """Go on from where the loop converged, with the labels that it ended with.

    Parameters
    ----------
    loop
        Its end, on these clouds.
    source, target
        The clouds.
    metric
        What is minimised.
    on_iteration
        Called after each step, which is numbered as those before.
    """
    if loop.last is None or loop.last.degenerate is None:
        return loop
    align, most = metric.prepare(source, target), len(loop.last.degenerate)
    placed = Placed.at(loop.transformation, source.points)
    chance, history, last = loop.labels.probability, list(loop.history), loop.last
    near = Near.of(placed, target, chance, loop.matches.index)
    for _ in range(STEPS):
        matches, share = agreeing(placed, source, target, chance, near)
        weighed = Labels(2.0 * chance * share - 1.0)
        step = align(placed, matches, weighed)
        # Where less is left, more may seem free: then the loop knew better.
        if step is None or step.degenerate is None or len(step.degenerate) > most:
            break
        last = replace(step, weakest=loop.weakest)
        placed = placed.moved(step.motion)
        history.append(
            Iteration(
                iteration=len(history) + 1,
                em_iterations=0,
                inlier_share=float(np.mean(weighed.inlier)),
                step_translation=se3.translation_norm(step.motion),
                step_rotation=se3.rotation_angle(step.motion),
                inlier_rmse=rms(matches.distance[weighed.inlier]),
                parameters=loop.labels.parameters,
                transformation=placed.transformation,
            )
        )
        if on_iteration is not None:
            on_iteration(history[-1])
    return replace(loop, transformation=placed.transformation, last=last, history=tuple(history))


class Near(NamedTuple):
    """The source points that are asked about, and the rows of the target points near them.

    They are looked for once: the steps are far shorter than the target's spacing. In an image
    they are the pixels round the match.
    """

    some: Rows
    rows: Rows

    @classmethod
    def of(cls, placed: Placed, target: PreparedCloud, chance: Array, row: Rows) -> Near:
        """Look round the matches ``row`` of the points that are not certain to be outliers."""
        some = np.flatnonzero(chance > HARDLY)
        if target.cloud.organised:
            return cls(some, around(target.cloud.observed, row[some]))
        points = np.ascontiguousarray(placed.points[some])
        most = min(NEAR, len(target))
        _, rows = target.tree.query(points, k=most)
        return cls(some, rows.reshape(len(some), most))


def around(observed: NDArray[np.bool_], row: Rows) -> Rows:
    """Rows (K, 5) of a pixel and of the four beside it, of itself where one is not observed."""
    height, width = observed.shape
    places = np.full((height + 2, width + 2), -1, dtype=np.intp)
    pixels = np.flatnonzero(observed)
    places[1:-1, 1:-1].flat[pixels] = np.arange(len(pixels))
    line, column = np.divmod(pixels[row], width)
    wide = places.shape[1]
    steps = np.array([0, -wide, wide, -1, 1])
    found = places.ravel()[((line + 1) * wide + column + 1)[:, None] + steps]
    return np.where(found < 0, row[:, None], found)


def agreeing(
    placed: Placed, source: PreparedCloud, target: PreparedCloud, chance: Array, near: Near
) -> tuple[Matches, Array]:
    """Match every source point with the target point across, and tell how far they agree.

    Returns
    -------
    The matches, and (M,) in [0, 1] what each counts for, its label aside.
    """
    from hmrf_icp.kernels.polish import across

    surface, onto = source.surface, target.surface
    some = near.some
    row, share = np.zeros(len(chance), dtype=np.intp), np.zeros(len(chance))
    row[some], off = across(
        np.ascontiguousarray(placed.points[some]),
        surface.normals[some],
        surface.noise[some],
        surface.tilt[some],
        onto.points,
        onto.normals,
        onto.noise,
        onto.tilt,
        near.rows,
        placed.transformation[:3, :3],
        surface.oriented and onto.oriented,
        (LEAST_NOISE * surface.size) ** 2,
        BEYOND,
    )
    told = off[np.isfinite(off) & (chance[some] > 0.5)]
    scale = max(1.0, float(np.median(told)) / MEDIAN) if told.size else 1.0
    share[some] = (1.0 - np.minimum(off / (CUT * scale), 1.0) ** 2) ** 2
    gap = placed.points - onto.points[row]
    return Matches(row, np.sqrt(np.einsum("ij,ij->i", gap, gap))), share
