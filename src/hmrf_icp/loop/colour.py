"""Align by the surfaces and by their colours: Park, Zhou and Koltun's joint term (2017).

The target's intensity is a function on its tangent planes; where a source point lies, it should
be the intensity that the source measured there. In the paper a number (lambda = 0.968) says
what colour counts beside distance. Here both are in units of their own noise: distances in
that of the points along their normals, intensities in that about their fits, or in that of
what is left over between the clouds, if that is more. Neither the units of the colours
nor the scale of the scene enter.

What slides along itself for the surfaces, such as a wall, is held by its texture, if it has
one in both clouds: half the sum of both slopes of the intensity is what is known of
the surface, half their difference is noise, as it is with normals. Along what the surfaces leave
free they have no say at all.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.clouds.shading import Shading
from hmrf_icp.errors import InputError
from hmrf_icp.loop.align import Align, Step
from hmrf_icp.loop.degeneracy import Split, split
from hmrf_icp.loop.match import Matches
from hmrf_icp.loop.placed import Placed
from hmrf_icp.loop.reject import Labels
from hmrf_icp.loop.surface_metrics import (
    UNKNOWNS,
    Frame,
    Matched,
    Pairing,
    SurfaceMetric,
    Symmetric,
    Told,
)

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Coloured(SurfaceMetric):
    """Distance of surfaces and difference of intensities, each in units of its noise.

    Both clouds need colours or intensities (:mod:`hmrf_icp.clouds.shading`), measured with the
    same exposure.

    Parameters
    ----------
    geometric
        How far surfaces are apart. Its weights count, and not those given here.

    Examples
    --------
    >>> from hmrf_icp import Coloured, PointToPlane
    >>> Coloured(geometric=PointToPlane()).geometric
    PointToPlane(weights='soft')
    """

    geometric: SurfaceMetric = field(default_factory=Symmetric)

    def __post_init__(self) -> None:
        """Refuse what measures no surfaces."""
        super().__post_init__()
        if not isinstance(self.geometric, SurfaceMetric) or isinstance(self.geometric, Coloured):
            raise InputError(
                "geometric: colour needs a metric that looks at surfaces (point-to-plane, "
                f"symmetric or plane-to-plane), got {self.geometric!r}"
            )

    def prepare(self, source: PreparedCloud, target: PreparedCloud) -> Align:
        """Estimate the surfaces of both clouds, and the intensities on them.

        Raises
        ------
        InputError
            One of them has no colours.
        """
        pairing = Pairing(source.surface, target.surface)
        mine, theirs = (_shading(c, n) for c, n in ((source, "source"), (target, "target")))
        soft = self.geometric.weights == "soft"

        def align(source: Placed, matches: Matches, labels: Labels) -> Step | None:
            chance = labels.probability if soft else labels.inlier.astype(float)
            matched = pairing.matched(source, matches.index, chance)
            turn = np.ascontiguousarray(source.transformation[:3, :3])
            return _Joint(
                geometric=self.geometric, photometry=_Photometry(matched, mine, theirs, turn)
            )._step(matched)

        return align


class _Photometry:
    """Matches of one step, and what the intensities say of them."""

    def __init__(self, m: Matched, source: Shading, target: Shading, turn: Array) -> None:
        from hmrf_icp.kernels.shading import weigh_shading

        self._m, self._source, self._target, self._turn = m, source, target, turn
        self._weight = weigh_shading(
            m.points,
            m.onto,
            m.row,
            m.chance,
            source.value,
            source.variance,
            target.level,
            target.slope,
            target.variance,
        )

    def sums(self, pose: Array, centre: Array) -> Array:
        """Sum the normal equations of the differences of intensity at ``pose``."""
        from hmrf_icp.kernels.shading import photometric

        m, theirs = self._m, self._target
        found: Array = photometric(
            m.points,
            m.onto,
            m.row,
            self._weight,
            self._source.value,
            theirs.level,
            theirs.slope,
            pose,
            centre,
        )
        return found

    def known(self, centre: Array) -> tuple[Array, Array, Array]:
        """Sum what the slopes know, what noise is expected to make up of it, and what it does."""
        from hmrf_icp.kernels.shading import shading_known

        mine, theirs = self._source, self._target
        found: tuple[Array, Array, Array] = shading_known(
            self._m.points,
            self._m.row,
            self._weight,
            mine.slope,
            mine.slope_variance,
            self._m.normals,
            theirs.slope,
            theirs.slope_variance,
            self._turn,
            centre,
        )
        return found


@dataclass(frozen=True)
class _Joint(SurfaceMetric):
    """Both terms for the matches of one step."""

    geometric: SurfaceMetric = field(default_factory=Symmetric)
    photometry: _Photometry | None = None

    def told(self, m: Matched, frame: Frame) -> Told:
        """Add what intensities hold to what the surfaces do."""
        assert self.photometry is not None
        surfaces = self.geometric.told(m, frame)
        truth, noise, apart = (frame.scaled(sums) for sums in self.photometry.known(frame.centre))
        # Followed where it is more than noise; told where both clouds agree on it, too.
        follow = _added(surfaces.follow, truth, noise)
        sure = _added(surfaces.sure, truth, noise + 0.5 * apart)
        by_normals = surfaces.sure @ surfaces.sure.T
        return Told(
            information=by_normals @ surfaces.information @ by_normals + truth,
            follow=follow.bound,
            by_normals=surfaces.follow,
            sure=sure.bound,
            free=sure.free,
            weakest=surfaces.weakest if surfaces.free.shape[1] == 0 else sure.weakest,
            excess=surfaces.excess,
        )

    def equations(self, m: Matched, motion: Array, frame: Frame, told: Told) -> tuple[Array, Array]:
        """Add the equations of both, those of the surfaces along what they determine."""
        from hmrf_icp.kernels.normal_equations import COST, GRADIENT

        assert self.photometry is not None
        hessian, gradient = self.geometric.equations(m, motion, frame, told)
        onto = told.by_normals @ told.by_normals.T
        found = self.photometry.sums(motion, frame.centre)
        return (
            onto @ hessian @ onto / told.excess + frame.scaled(found),
            onto @ gradient / told.excess + found[GRADIENT:COST] * frame.units,
        )


def _added(bound: Array, truth: Array, noise: Array) -> Split:
    """Split once more, by intensities, what the surfaces leave free of directions ``bound``."""
    whole, _ = np.linalg.qr(np.hstack([bound, np.eye(UNKNOWNS)]))
    rest = whole[:, bound.shape[1] :]
    found = split(rest.T @ truth @ rest, rest.T @ noise @ rest)
    return Split(rest @ found.free, np.hstack([bound, rest @ found.bound]), found.weakest)


def _shading(cloud: PreparedCloud, name: str) -> Shading:
    try:
        return cloud.shading
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
