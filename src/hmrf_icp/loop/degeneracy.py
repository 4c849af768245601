"""Degenerate directions: motions that slide the matched surfaces along themselves.

A bare wall may be shifted along itself and turned about its normal, and every
point still lies on it. Registration there must leave the pose as it was and say
so, instead of following the noise (Zhang, Kaess and Singh 2016 call this solution
remapping).

How large an eigenvalue of the information must be before it is believed is
usually a number tuned to a sensor. Here the data decide. Both clouds measured
the normal of each match; call m half the sum of the two measurements and d half
their difference. What is true of the surface is in m alone; noise is in both, and
equally much. So what the sum that gives the information from m gives from d is
the part of it that is noise. A direction is determined where the first is several
times the second. That has no unit: neither the scale of the scene nor the number
of points enters.

Matches that are wrong, or turned as the source still is, have larger differences
than the noise of a normal can make. Such a match disagrees, which says nothing about
its normals: it counts with the difference that noise alone is expected to make.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3
from hmrf_icp.frozen import same
from hmrf_icp.lazy import cached_property

Array = NDArray[np.float64]

SIGNAL = 3.0
"""Times the information of noise alone that a direction must have: twice as much again is true.

Bare walls, cylinders and spheres with a depth camera's noise have 1 to 1.8; a corridor whose
walls are seen at a grazing angle has more, 3 to 13, and there it is :data:`FLAT` that finds it
(both views are wrong alike). Views of a room that share a twentieth of what they see have 2 to 10
along their weakest direction, and more of that is to be followed than is noise; others 20 and more.
"""

NOISE_ALONE = 1.0 / SIGNAL
"""Times what a direction must have that noise makes where the surfaces leave it free.

Bare walls, floors, corridors and columns have up to 0.37. What is above and still below 1 is not
followed, but a search that compares poses may have found it.
"""

FLAT = 1e-3
"""Share of the largest information below which a direction is free though nothing is noisy.

The square of an angle, 0.03 rad: what normals fitted to small windows get wrong alike in both
clouds, so that no difference shows it. Measured: exact views of bare walls, corridors, cylinders
and spheres have up to 3e-4 along what they leave free; the weakest direction of rooms and
tabletops, exact or with a depth camera's noise, has 1e-2 and more, 4e-3 where little overlaps.
"""

TRANSLATION = 0.2
"""A twist whose rotation is a smaller share of it than this is called a translation.

Its axis, if it has one, is five sizes of the scene away.
"""


class Split(NamedTuple):
    """Motions (6, k) that the matches leave free, and those (6, 6 - k) that they determine.

    Together the columns are an orthonormal basis. ``weakest`` is the
    smallest eigenvalue of the information relative to the least that is followed; below 1
    that direction is free.
    """

    free: Array
    bound: Array
    weakest: float


def split(information: Array, noise: Array) -> Split:
    """Tell apart the motions that are determined from those that only noise speaks for.

    Parameters
    ----------
    information
        (6, 6) gathered from the sums of normals, in coordinates in which a unit
        of rotation and one of translation move the points about equally far; or (n, n),
        of a subspace of motions.
    noise
        As large, gathered in the same way from what noise makes of their differences.
    """
    finite = bool(np.isfinite(information).all() and np.isfinite(noise).all())
    largest = float(np.linalg.eigvalsh(information)[-1]) if finite and information.size else 0.0
    unknowns = len(information)
    if not largest > 0.0:
        return Split(np.eye(unknowns), np.zeros((unknowns, 0)), 0.0)
    # Directions v with v'Av < v'Bv, A v = lambda B v: through B = LL', a symmetric problem.
    root = np.linalg.cholesky(SIGNAL * noise + FLAT * largest * np.eye(unknowns))
    half = np.linalg.solve(root, information)
    ratio, directions = np.linalg.eigh(np.linalg.solve(root, half.T))
    count, weakest = int(np.count_nonzero(ratio < 1.0)), max(float(ratio[0]), 0.0)
    if count == 0:
        return Split(np.zeros((unknowns, 0)), np.eye(unknowns), weakest)
    free = np.linalg.solve(root.T, directions[:, :count])
    basis, _ = np.linalg.qr(np.hstack([free, np.eye(unknowns)]))
    return Split(basis[:, :count], basis[:, count:], weakest)


def unit_twists(free: Array, length: float, centre: Array) -> Array:
    """Twists (k, 6) about the origin that span the free motions, rotations first.

    Parameters
    ----------
    free
        (6, k) orthonormal, rotation times ``length`` first, about ``centre``.
    length
        Metres a radian, by which rotation was made comparable to translation.
    centre
        (3,) in the frame that the twists are wanted in, metres.
    """
    # Turned within their span so that as many as can be are free of rotation.
    _, _, vt = np.linalg.svd(free[:3])
    twists: Array = (free @ vt.T).T
    for twist in twists:
        turns = np.linalg.norm(twist[:3]) >= TRANSLATION
        twist[:3] /= length
        twist /= np.linalg.norm(twist[:3] if turns else twist[3:])
    return np.array([about_another(twist, centre) for twist in twists]).reshape(-1, 6)


def about_another(twist: Array, origin: Array) -> Array:
    """Express a twist (6,) about a point ``origin`` (3,) as one about the origin itself."""
    return np.concatenate([twist[:3], twist[3:] - np.cross(twist[:3], origin)])


@dataclass(frozen=True, eq=False)
class FreeMotion:
    """A motion that a registration could not determine and has left alone.

    Parameters
    ----------
    twist
        (6,) in the target's frame about its origin, rotation (rad) then
        translation (m): ``se3.exp(x * twist) @ transformation`` fits as well
        for any small x. The rotation has length 1, or the translation has.

    Examples
    --------
    >>> import numpy as np
    >>> from hmrf_icp import FreeMotion
    >>> print(FreeMotion(np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0])))
    translation along (1.00, 0.00, 0.00)
    """

    twist: Array

    def __eq__(self, other: object) -> bool:
        return same(self, other) if isinstance(other, FreeMotion) else NotImplemented

    def __hash__(self) -> int:
        return hash(tuple(self.twist.tolist()))

    @property
    def rotation(self) -> bool:
        """Whether it turns; a screw turns too."""
        # By the length that unit_twists gave it: a translation may turn by a trace.
        return bool(abs(np.linalg.norm(self.twist[:3]) - 1.0) < 1e-9)

    @cached_property
    def direction(self) -> Array:
        """(3,) unit vector of the axis it turns about, or of the way it goes."""
        vector = self.twist[:3] if self.rotation else self.twist[3:]
        return np.asarray(vector / np.linalg.norm(vector))

    @property
    def point(self) -> Array | None:
        """(3,) the point of its axis nearest to the target's origin, metres; None of a shift."""
        return np.cross(self.direction, self.twist[3:]) if self.rotation else None

    def __str__(self) -> str:
        if self.point is None:
            return f"translation along {_vector(self.direction)}"
        text = f"rotation about {_vector(self.direction)} through {_vector(self.point)} m"
        pitch = float(self.direction @ self.twist[3:])
        away = float(np.linalg.norm(self.twist[3:]))
        return text if abs(pitch) < 0.05 * away else f"{text}, rising {pitch:.2g} m a radian"


def _vector(v: Array) -> str:
    return "(" + ", ".join(f"{x:.2f}" for x in v + 0.0) + ")"


def about_origin(information: Array, centre: Array) -> Array:
    """Express information (6, 6) on twists about ``centre`` as that on twists about the origin."""
    change = np.eye(6)
    change[3:, :3] = -se3.skew(centre)
    return np.asarray(change.T @ information @ change)
