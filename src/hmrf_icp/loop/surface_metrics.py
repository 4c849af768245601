"""Align by what the surfaces look like round the points: three metrics.

All of them are least squares over matches x, y with weights P(Z = +1) over the
noise variance of both points, so that near measurements count for more than far
ones. They differ in what they measure between x and y. Each is solved by Gauss and
Newton's method on SE(3), in a frame about the centre of the matched points, and
moves nothing along directions that the matches leave free
(:mod:`hmrf_icp.loop.degeneracy`).

A match is left out where either point has no normal, and where the normals say
that one side was seen and then the other (both clouds know where they were
seen from): no surface is seen from behind.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.clouds.surface import Surface
from hmrf_icp.errors import InputError
from hmrf_icp.loop.align import Align, Step, least_squares
from hmrf_icp.loop.degeneracy import about_origin, split, unit_twists
from hmrf_icp.loop.match import Matches, checked_rows
from hmrf_icp.loop.placed import Placed
from hmrf_icp.loop.reject import Labels

Array = NDArray[np.float64]

UNKNOWNS = 6
_UPPER = np.triu_indices(UNKNOWNS)

INNER_STEPS = 10
"""Most Gauss-Newton steps a match; two or three are usual."""

SMALL = 1e-5
"""A Gauss-Newton step (rad, and share of the size of the scene) after which the next is not worth
it: convergence is quadratic."""

LEAST_NOISE = 1e-9
"""Noise of a point at the least, as a share of the size of the scene: an exact cloud has none."""


class Matched(NamedTuple):
    """Matches as the passes want them; (M, 3) and (M,), rows of source points.

    Attributes
    ----------
    points, normals
        Of the source, moved to where it is now.
    onto, onto_normals
        All of the target's, in which
    row
        says which is matched.
    weight
        Chance over variance, what a residual along the normal counts for.
    variance, onto_variance
        Noise variance of the source point, and of the matched target point as
        often as it is matched, square metres.
    chance
        P(Z = +1) of the match, or 0 or 1 for hard weights; 0 where it is left out.
    normal_noise
        Mean square of half the difference that noise makes between its normals.
    trust
        How much its normals count as knowledge of the surface, 0 to 1.
    """

    points: Array
    normals: Array
    onto: Array
    onto_normals: Array
    row: NDArray[np.intp]
    weight: Array
    variance: Array
    onto_variance: Array
    chance: Array
    normal_noise: Array
    trust: Array


class Frame(NamedTuple):
    """Where the equations are measured from, and in what: about equally far for both halves.

    Attributes
    ----------
    centre
        (3,) weighted mean of the matched points.
    length
        Their root mean square distance from it, metres: a turn of a radian moves them so far.
    units
        (6,) what a twist in these units is multiplied by to be one in radians and metres.
    """

    centre: Array
    length: float
    units: Array

    def scaled(self, sums: Array) -> Array:
        """Return the (6, 6) matrix of a pass in these units."""
        return np.asarray(matrix(sums) * np.outer(self.units, self.units))


class Told(NamedTuple):
    """What matches tell of the pose, in the units of a :class:`Frame`.

    Attributes
    ----------
    information
        (6, 6) inverse covariance of a twist.
    follow
        (6, k) directions along which the equations are followed.
    by_normals
        (6, l) those of them that the normals determine.
    sure
        (6, j) those that are told as known.
    free
        (6, 6 - j) those that are told as free.
    weakest
        As in :class:`~hmrf_icp.loop.align.Step`.
    excess
        How many times the expected squares the residuals along the normals have.
    """

    information: Array
    follow: Array
    by_normals: Array
    sure: Array
    free: Array
    weakest: float
    excess: float


@dataclass(frozen=True)
class SurfaceMetric:
    """What the metrics share.

    Parameters
    ----------
    weights
        ``"soft"``, matches count by P(Z = +1); ``"hard"``, those with z > 0
        count fully and no others.

    Raises
    ------
    InputError
        Weights of another kind.
    """

    weights: Literal["soft", "hard"] = "soft"

    def __post_init__(self) -> None:
        """Refuse what is not a kind of weights."""
        if self.weights not in ("soft", "hard"):
            raise InputError(f'weights: expected "soft" or "hard", got {self.weights!r}')

    def prepare(self, source: PreparedCloud, target: PreparedCloud) -> Align:
        """Estimate the surfaces of both clouds."""
        return self.between(source.surface, target.surface)

    def between(self, source: Surface, target: Surface) -> Align:
        """Align surfaces that are known already."""
        pairing = Pairing(source, target)

        def align(source: Placed, matches: Matches, labels: Labels) -> Step | None:
            chance = labels.probability if self.weights == "soft" else labels.inlier.astype(float)
            return self._step(pairing.matched(source, matches.index, chance))

        return align

    def sums(self, m: Matched, pose: Array, centre: Array) -> Array:
        """Sum the normal equations at ``pose``, laid out as in the kernels."""
        raise NotImplementedError

    def told(self, m: Matched, frame: Frame) -> Told:
        """Tell what the normals know, and along which directions they are followed."""
        from hmrf_icp.kernels.geometry import geometry
        from hmrf_icp.kernels.normal_equations import COST

        truth, noise, trusted, trusted_noise = geometry(
            *m[:6], m.normal_noise, m.trust, frame.centre
        )
        information = frame.scaled(truth)
        bound = split(information, frame.scaled(noise)).bound
        judged = split(frame.scaled(trusted), frame.scaled(trusted_noise))
        if judged.bound.shape[1] == bound.shape[1]:
            bound = judged.bound
        more = excess(truth[COST], m.chance)
        return Told(
            information=information / more,
            follow=bound,
            by_normals=bound,
            sure=judged.bound,
            free=judged.free,
            weakest=judged.weakest,
            excess=more,
        )

    def equations(self, m: Matched, motion: Array, frame: Frame, told: Told) -> tuple[Array, Array]:
        """Return matrix (6, 6) and gradient (6,) of a Gauss-Newton step at ``motion``."""
        from hmrf_icp.kernels.normal_equations import COST, GRADIENT

        found = self.sums(m, motion, frame.centre)
        return frame.scaled(found), found[GRADIENT:COST] * frame.units

    def _step(self, m: Matched) -> Step | None:
        if np.count_nonzero(m.weight) < UNKNOWNS:
            return None
        centre, length = extent(m.points, m.weight)
        if not length > 0.0:
            return None
        units = np.array([1 / length] * 3 + [1.0] * 3)
        frame = Frame(centre, length, units)
        told = self.told(m, frame)
        bound = told.follow
        if bound.shape[1] == 0:
            return None

        motion = np.eye(4)
        for _ in range(INNER_STEPS):
            hessian, gradient = self.equations(m, motion, frame, told)
            least = least_squares(bound.T @ hessian @ bound, bound.T @ gradient)
            if least is None:
                return None
            step = bound @ least
            # Two motions of a subspace may lead out of it together: what they share is kept.
            whole = se3.log(se3.exp(step * units) @ motion) / units
            motion = se3.exp(bound @ (bound.T @ whole) * units)
            if np.linalg.norm(step) < SMALL * length:
                break

        # What edges and bends alone speak for is followed, and not told as known.
        sure = told.sure
        known = sure @ (sure.T @ told.information @ sure) @ sure.T / np.outer(units, units)
        return Step(
            se3.rigid(np.eye(3), centre) @ motion @ se3.rigid(np.eye(3), -centre),
            about_origin(known, centre),
            unit_twists(told.free, length, centre),
            told.weakest,
        )


@dataclass(frozen=True)
class PointToPlane(SurfaceMetric):
    """Distance along the target's normal (Chen and Medioni 1992).

    Examples
    --------
    >>> import hmrf_icp
    >>> hmrf_icp.presets.aligner("point-to-plane")
    PointToPlane(weights='soft')
    """

    def sums(self, m: Matched, pose: Array, centre: Array) -> Array:
        """Sum over n . (x - y)."""
        from hmrf_icp.kernels import surface_metrics as kernels

        found: Array = kernels.point_to_plane(*m[:6], pose, centre)
        return found


@dataclass(frozen=True)
class Symmetric(SurfaceMetric):
    """Distance along the mean of both normals (Rusinkiewicz 2019).

    It vanishes on any surface of constant curvature, where point-to-plane does on planes.

    Examples
    --------
    >>> import hmrf_icp
    >>> hmrf_icp.presets.aligner("symmetric")
    Symmetric(weights='soft')
    """

    def sums(self, m: Matched, pose: Array, centre: Array) -> Array:
        """Sum over m . (x - y), m the mean of both normals."""
        from hmrf_icp.kernels import surface_metrics as kernels

        found: Array = kernels.symmetric(*m[:6], pose, centre)
        return found


@dataclass(frozen=True)
class PlaneToPlane(SurfaceMetric):
    """Distance between two little planes, generalised ICP (Segal, Haehnel and Thrun 2009).

    C = R C_s R' + C_t, each covariance the noise of the point along its normal,
    and much wider across it. Matches whose normals disagree count for little.

    Parameters
    ----------
    flatness
        Variance along the normal over that across it; theirs is 1e-3.

    Examples
    --------
    >>> import hmrf_icp
    >>> hmrf_icp.presets.aligner("plane-to-plane")
    PlaneToPlane(weights='soft', flatness=0.001)
    """

    flatness: float = 1e-3

    def __post_init__(self) -> None:
        """Refuse a flatness that is none."""
        super().__post_init__()
        if not 0.0 < self.flatness <= 1.0:
            raise InputError(f"flatness: expected a number in (0, 1], got {self.flatness}")

    def sums(self, m: Matched, pose: Array, centre: Array) -> Array:
        """Sum over (x - y)' C^-1 (x - y)."""
        from hmrf_icp.kernels import surface_metrics as kernels

        found: Array = kernels.plane_to_plane(
            *m[:5], m.chance, pose, centre, m.variance, m.onto_variance, self.flatness
        )
        return found


class Pairing:
    """Matches between two surfaces, weighed anew whenever the source has moved.

    A target point that k source points are matched to is one measurement and not
    k: its variance counts k times in each of them, so that together they weigh
    what they should. A target sampled more coarsely than the source needs this,
    and so does a border that all points beyond it are matched to.
    """

    def __init__(self, source: Surface, target: Surface) -> None:
        self._source, self._target = source, target
        self._oriented = source.oriented and target.oriented
        self._tilts = source.tilt, target.tilt
        self._least = (LEAST_NOISE * source.size) ** 2

    def matched(self, placed: Placed, row: NDArray[np.intp], chance: Array) -> Matched:
        """Weigh the matches of the source where it is now with rows of the target.

        ``chance`` (M,) is what each counts for, apart from its noise.

        Raises
        ------
        InputError
            A row that the target does not have, or not one row and chance a source point.
        """
        from hmrf_icp.kernels import surface_metrics as kernels
        from hmrf_icp.kernels.compiled import read_only

        source, target = self._source, self._target
        row = checked_rows(row, len(source.points), len(target.points))
        if chance.shape != row.shape or placed.points.shape != source.points.shape:
            raise InputError(
                f"labels: expected one for each of the {len(row)} observed source points, "
                f"got shape {chance.shape}"
            )
        normals, weight, variance, onto_variance, used, apart = kernels.weigh(
            source.normals,
            source.noise,
            self._tilts[0],
            target.normals,
            target.noise,
            self._tilts[1],
            row,
            chance,
            placed.transformation[:3, :3],
            self._oriented,
            self._least,
        )
        trust = source.trust * target.trust[row]
        return Matched(
            placed.points,
            normals,
            read_only(target.points),
            target.normals,
            row,
            weight,
            variance,
            onto_variance,
            used,
            apart,
            trust,
        )


def extent(points: Array, weight: Array) -> tuple[Array, float]:
    """Weighted mean of points (M, 3), and their root mean square distance from it, metres."""
    total = weight.sum()
    # BLAS would start threads for it, which keep a core busy long after.
    centre = np.einsum("i,ij->j", weight, points) / total
    offset = points - centre
    square = np.einsum("i,ij,ij->", weight, offset, offset) / total
    return np.asarray(centre), float(np.sqrt(square))


def matrix(sums: Array) -> Array:
    """Unpack the (6, 6) matrix of a pass."""
    full = np.zeros((UNKNOWNS, UNKNOWNS))
    full[_UPPER] = sums[: len(_UPPER[0])]
    return np.asarray(full + np.triu(full, 1).T)


def excess(cost: float, chance: Array) -> float:
    """How many times the expected squares the residuals have; 1 at the least.

    Noise is estimated from each cloud alone. Where both together fit worse than
    it says (bent lenses, what moved, wrong matches), that is the noise of the pose.
    """
    return max(1.0, cost / max(float(chance.sum()) - UNKNOWNS, 1.0))
