"""Align: the rigid motion that brings the inliers to their matches (paper, step 3).

The paper's own, between points, is here; those that look at the surfaces are in
:mod:`hmrf_icp.loop.surface_metrics`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.loop.match import Matches, checked_rows
from hmrf_icp.loop.placed import Placed
from hmrf_icp.loop.reject import Labels

Array = NDArray[np.float64]

SINGULAR = 1e-12
"""Share of the largest eigenvalue of the normal equations below which one is rounding."""

MINIMUM_INLIERS = 3
"""Fewer matches than this do not determine a rigid motion."""

LEAST_TURN = 1e-12
"""Weight of turning little, as a share of the covariance: decides where the points cannot."""


@dataclass(frozen=True, eq=False)
class Step:
    """One motion, and what the matches know about it.

    Twists are rotation (rad) first, then translation (m), in the target's frame and about
    its origin: they move what has been moved already, ``se3.exp(twist) @ pose``.

    Attributes
    ----------
    motion
        (4, 4) T_step, for the source points where they are now.
    information
        (6, 6) inverse covariance of the twist by which ``motion`` is off; zero along
        what the matches leave free. None where the metric has no noise to say it in.
    degenerate
        (k, 6) unit twists that the matches leave free: 1 rad about an axis, or 1 m along one.
        ``motion`` has nothing of them, unless normals that are not to be trusted, at edges
        and bends, alone speak for it. None where nobody looked.
    weakest
        Smallest eigenvalue of the information over what noise alone would give, as a
        multiple of the least that is followed: below 1 that direction is one of
        ``degenerate``. None where nobody looked.
    """

    motion: Array
    information: Array | None = None
    degenerate: Array | None = None
    weakest: float | None = None


class Align(Protocol):
    """Find the :class:`Step` for the source where it is now.

    None where the inliers do not determine a motion.
    """

    def __call__(self, source: Placed, matches: Matches, labels: Labels) -> Step | None:
        """Align."""


class Aligner(Protocol):
    """Prepare an :class:`Align` for one pair of clouds."""

    def prepare(self, source: PreparedCloud, target: PreparedCloud) -> Align:
        """Build what depends on the clouds alone, such as normals."""


@dataclass(frozen=True)
class PointToPoint:
    """Least squares between points, f = ||T B_i - C_I_i||^2 over z > 0, in closed form.

    Examples
    --------
    >>> import numpy as np
    >>> from hmrf_icp import PointToPoint, register
    >>> points = np.random.default_rng(0).uniform(size=(500, 3))
    >>> result = register(points - 0.01, points, rejector="x84", aligner=PointToPoint())
    >>> result.transformation[:3, 3].round(3)
    array([0.01, 0.01, 0.01])
    """

    def prepare(self, source: PreparedCloud, target: PreparedCloud) -> Align:
        """Nothing but the target's points is needed."""
        closest = target.points

        def align(source: Placed, matches: Matches, labels: Labels) -> Step | None:
            inlier = labels.inlier
            if np.count_nonzero(inlier) < MINIMUM_INLIERS:
                return None
            checked_rows(matches.index, len(inlier), len(closest))
            return Step(best_motion(source.points[inlier], closest[matches.index[inlier]]))

        return align


def best_motion(points: Array, onto: Array) -> Array:
    """Rigid motion that takes points (M, 3) closest to ``onto`` (M, 3) in least squares.

    Singular value decomposition of the cross-covariance (Arun, Huang and
    Blostein 1987), with the sign that makes it a rotation and never a
    reflection (Umeyama 1991). Where the points leave a rotation free, such as
    that about the line they stand on, the one that turns least is taken.
    """
    centre, centre_onto = points.mean(axis=0), onto.mean(axis=0)
    covariance = (onto - centre_onto).T @ (points - centre)
    covariance += LEAST_TURN * np.linalg.norm(covariance) * np.eye(3)
    rotation = se3.nearest_rotation(covariance)
    return se3.rigid(rotation, centre_onto - rotation @ centre)


def least_squares(hessian: Array, gradient: Array) -> Array | None:
    """Solve a Gauss-Newton step (k,), with no motion along what the equations say nothing of.

    None where they are not finite. What holds a direction is judged on both clouds' normals
    before; a metric that looks at one of them may know less (all matches on one point).
    """
    if not (np.isfinite(hessian).all() and np.isfinite(gradient).all()):
        return None
    values, directions = np.linalg.eigh(hessian)
    known = values > SINGULAR * values[-1]
    if known.all():
        return np.asarray(np.linalg.solve(hessian, -gradient))
    directions = directions[:, known]
    return np.asarray(-directions @ ((directions.T @ gradient) / values[known]))
