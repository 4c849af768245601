"""What a registration returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.loop.degeneracy import FreeMotion
from hmrf_icp.loop.icp import Iteration
from hmrf_icp.search.visibility import Visibility


@dataclass(frozen=True, eq=False)
class RegistrationResult:
    """The motion that was found and the evidence for it.

    Attributes
    ----------
    transformation
        (4, 4) float64, source to target, the start included.
    inlier_probability
        (H, W) or (N,), P(Z = +1) of each source point, NaN where unobserved.
    distance
        (H, W) or (N,), distance of each moved source point to the closest
        target point, metres, NaN where unobserved.
    converged
        Whether the last step was below the criteria.
    iterations, em_iterations
        ICP iterations, and EM steps in all of them together.
    overlap
        Share of the observed source points with P(Z = +1) > 1/2.
    inlier_rmse
        Root mean square distance over those points, metres; 0 where there are none.
    seconds
        Wall-clock time of the registration.
    history
        One :class:`hmrf_icp.Iteration` an iteration.
    information
        (6, 6) float64, the inverse covariance of the error of ``transformation``
        as a twist, rotation (rad) first, then translation (m): the true motion is
        ``se3.exp(twist) @ transformation``, the twist in the target's frame and
        about its origin. Zero along what is free. None where the metric does not
        know the noise (point-to-point) or nothing was moved.
    degenerate
        One :class:`hmrf_icp.FreeMotion` for each direction in which the matched surfaces
        slide on each other, such as the three of a bare wall: the motion along
        it is that of ``init``. Empty where there is none, and where the metric
        does not look (point-to-point).
    confidence
        Probability in [0, 1] that the registration is right, from what both
        sensors saw of it; None for a method that does not ask (``"paper"``).
    visibility
        What they saw, a :class:`hmrf_icp.Visibility`; None likewise.
    """

    transformation: NDArray[np.float64]
    inlier_probability: NDArray[np.float64]
    distance: NDArray[np.float64]
    converged: bool
    iterations: int
    em_iterations: int
    overlap: float
    inlier_rmse: float
    seconds: float
    history: tuple[Iteration, ...]
    information: NDArray[np.float64] | None = None
    degenerate: tuple[FreeMotion, ...] = ()
    confidence: float | None = None
    visibility: Visibility | None = None

    def __repr__(self) -> str:
        state = "converged" if self.converged else "did not converge"
        free = f", free: {'; '.join(map(str, self.degenerate))}" if self.degenerate else ""
        return (
            f"RegistrationResult({state} after {self.iterations} iterations, "
            f"overlap {self.overlap:.3f}, inlier_rmse {self.inlier_rmse:.4g} m{free})"
        )
