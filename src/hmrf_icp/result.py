"""What a registration returns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmrf_icp import se3
from hmrf_icp.clouds.sensor_view import SensorView
from hmrf_icp.frozen import same
from hmrf_icp.loop.correspondences import Correspondences
from hmrf_icp.loop.degeneracy import FreeMotion
from hmrf_icp.loop.icp import Iteration, rms
from hmrf_icp.search.visibility import Visibility
from hmrf_icp.stages import Stage

if TYPE_CHECKING:
    from hmrf_icp.view import Recording, Viewer

BELIEVED = 0.5
"""Confidence from which a pose is believed: more likely right than not."""


@dataclass(frozen=True, eq=False)
class RegistrationResult:
    """The motion that was found and the evidence for it.

    Look at :attr:`believed` first. What there is one of for each point
    (:attr:`distance`, :attr:`inlier_probability`, :attr:`correspondence_set`), and what is
    worked out from it (:attr:`overlap`, :attr:`fitness`, :attr:`inlier_rmse`), is of all
    points given and of the pose returned. It is worked out when it is first asked for,
    and both clouds are kept until then; a copy or a pickle holds the numbers alone.

    Attributes
    ----------
    transformation
        (4, 4) float64, source to target, the start included.
    converged
        Whether the last step was below the criteria. That says that the steps became
        small and not that the pose is right: see :attr:`believed`.
    iterations, em_iterations
        ICP iterations that led to the pose, and EM steps in all of them together. Of a search,
        those of the candidate that won.
    seconds
        Wall-clock time of the registration, without that of compiling anything.
    history
        One :class:`hmrf_icp.Iteration` for each of ``iterations``, numbered from 1.
    information
        (6, 6) float64, the inverse covariance of the error of ``transformation`` as a
        twist about ``centre``, rotation (rad) first, then translation (m), along the
        target's axes: the true motion is ``se3.about(twist, centre) @ transformation``.
        Zero along what is free. None where the metric does not know the noise
        (point-to-point) or nothing was moved.
    centre
        (3,) the centroid of the source's points under ``transformation``, in the target's frame.
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
    source_view, target_view
        How it is known where each was seen from: given, recovered from its points, assumed, or
        not at all; printed, it says so with the numbers.
    correspondences
        What the properties below are read from.
    profile
        Time and calls of each :class:`hmrf_icp.Stage`, the longest first, where
        :func:`hmrf_icp.register` was asked for a profile; None otherwise.

    Examples
    --------
    >>> import numpy as np
    >>> import hmrf_icp
    >>> points = np.random.default_rng(0).uniform(-1.0, 1.0, size=(3000, 3))
    >>> points[:, 2] = 0.2 * np.sin(4.0 * points[:, 0]) + 0.3 * np.cos(3.0 * points[:, 1])
    >>> result = hmrf_icp.register(points - [0.02, 0.0, 0.01], points)
    >>> result.believed, round(result.overlap, 2), round(result.fitness, 2)
    (True, 1.0, 1.0)
    >>> result.correspondence_set.shape
    (3000, 2)
    """

    transformation: NDArray[np.float64]
    converged: bool
    iterations: int
    em_iterations: int
    seconds: float = field(compare=False)
    history: tuple[Iteration, ...]
    information: NDArray[np.float64] | None
    centre: NDArray[np.float64]
    degenerate: tuple[FreeMotion, ...]
    confidence: float | None
    visibility: Visibility | None
    source_view: SensorView
    target_view: SensorView
    correspondences: Correspondences = field(repr=False)
    profile: tuple[Stage, ...] | None = field(default=None, repr=False, compare=False)

    @property
    def believed(self) -> bool:
        """Whether the pose is to be believed: ``confidence`` is 0.5 or more.

        Where a method gives no confidence, whether it converged, which is less: it may
        have converged to a wrong pose. A search that ran out of iterations at a pose
        that convinces is believed; it is the pose that is right or wrong.
        """
        return self.converged if self.confidence is None else self.confidence >= BELIEVED

    @property
    def verdict(self) -> str:
        """Whether the pose is to be believed, in a few words with the number."""
        if self.confidence is None:
            state = "converged" if self.converged else "did not converge"
            return f"{state} (this method gives no confidence)"
        words = "to be believed" if self.believed else "NOT convincing"
        return f"{words}, confidence {self.confidence:.2f}"

    @property
    def advice(self) -> str | None:
        """What to try where the pose is not believed; None where it is."""
        if self.believed:
            return None
        if self.confidence is None:
            return "try a start nearer to the true pose, more iterations or another preset"
        unit = "check that both are in the same unit; " if self.confidence == 0.0 else ""
        unknown = [
            name
            for name, view in (("source", self.source_view), ("target", self.target_view))
            if not view.known
        ]
        if unknown:
            return (
                f"{unit}say where the sensor of {' and '.join(unknown)} stood (a camera, or a "
                "viewpoint), or try a start nearer to the true pose"
            )
        return f"{unit}try a start nearer to the true pose, or views that share more"

    @property
    def inlier_probability(self) -> NDArray[np.float64]:
        """(H, W) or (N,), P(Z = +1) of each source point, NaN where unobserved.

        Of a search, the field decides once more, for all points under the pose returned.
        Of any other method it is the decision that the last motion was found with.
        """
        return self.correspondences.on_grid(self.correspondences.matched.probability)

    @property
    def distance(self) -> NDArray[np.float64]:
        """(H, W) or (N,), metres from each moved source point to the closest target point.

        NaN where unobserved.
        """
        return self.correspondences.on_grid(self.correspondences.matched.distance)

    @property
    def overlap(self) -> float:
        """Share of the source's surface (area) that has a counterpart in the target's.

        A counterpart is as near as the noise and the spacing of both clouds allow, and
        faces the same way: geometry alone, whatever the labels say.
        """
        return self.correspondences.overlap

    @property
    def fitness(self) -> float:
        """Share of the observed source points that are inliers, P(Z = +1) > 1/2."""
        return float(np.mean(self.correspondences.matched.probability > 0.5))

    @property
    def inlier_rmse(self) -> float:
        """Root mean square distance of the inliers, metres; 0 where there are none."""
        matched = self.correspondences.matched
        return rms(matched.distance[matched.probability > 0.5])

    @property
    def correspondence_set(self) -> NDArray[np.intp]:
        """(K, 2) rows of the inliers and of their matches, source then target.

        Rows of ``points.reshape(-1, 3)`` of either cloud as it was given.
        """
        matched = self.correspondences.matched
        inlier = matched.probability > 0.5
        return np.column_stack([matched.row[inlier], matched.onto[inlier]])

    def show(
        self,
        init: ArrayLike | None = None,
        recording: Recording | None = None,
        truth: ArrayLike | None = None,
        port: int = 0,
        block: bool | None = None,
        on_ready: Callable[[str], object] | None = None,
    ) -> Viewer:
        """Look at the registration in the browser.

        Parameters
        ----------
        init
            (4, 4) the start that was given to ``register``; None for the identity.
        recording
            What was tried, a :class:`hmrf_icp.view.Recording` that ``register`` was given as
            ``on_iteration``; without, the timeline has what led to the result alone.
        truth
            (4, 4) the true pose, source to target, where it is known.
        port, block, on_ready
            See :func:`hmrf_icp.view.show`.

        Raises
        ------
        InputError
            The result is a copy, which has no clouds to show, or the port is taken.
        """
        from hmrf_icp import view

        story = view.story(self, init, recording, truth)
        return view.show(story, port, block, on_ready)

    def __eq__(self, other: object) -> bool:
        """Compare numbers, but for the time that it took."""
        return same(self, other) if isinstance(other, RegistrationResult) else NotImplemented

    def __hash__(self) -> int:
        return hash(tuple(self.transformation.ravel().tolist()))

    def __repr__(self) -> str:
        free = f"; free: {'; '.join(map(str, self.degenerate))}" if self.degenerate else ""
        return f"RegistrationResult({self.verdict}; {self._numbers()}{free})"

    def __str__(self) -> str:
        motion = self.transformation
        lines = [
            f"Registration: {self.verdict}",
            *([] if self.advice is None else [f"  {self.advice}"]),
            f"  {self._numbers()}",
            f"  motion {se3.translation_norm(motion):.4g} m, {_degrees(motion):.4g} deg",
            *(f"  free: {free}" for free in self.degenerate),
        ]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """Summary for a notebook, with a small picture where the clouds are still there."""
        from hmrf_icp.drawing.card import card, picture

        held, clouds, motion = (
            self.correspondences,
            self.correspondences.clouds,
            self.transformation,
        )
        image = None
        if clouds is not None and held.pose is not None:
            source, target = (one.cloud for one in clouds)
            image = picture(source, target, held.pose, held.matched.probability)
        state = "converged" if self.converged else "did not converge"
        rows = [
            ("overlap", f"{self.overlap:.1%} of the source's surface"),
            ("inliers", f"{self.fitness:.1%} of the points, RMSE {self.inlier_rmse:.4g} m"),
            ("motion", f"{se3.translation_norm(motion):.4g} m, {_degrees(motion):.4g} deg"),
            ("iterations", f"{self.iterations}, {state}, {self.seconds:.2f} s"),
            *(("free", str(free)) for free in self.degenerate),
        ]
        return card(f"Registration: {self.verdict}", self.believed, self.advice, rows, image)

    def _numbers(self) -> str:
        state = "converged" if self.converged else "did not converge"
        return (
            f"overlap {self.overlap:.3f}, inlier_rmse {self.inlier_rmse:.4g} m, "
            f"{state} after {count(self.iterations, 'iteration')}"
        )


def count(number: int, noun: str) -> str:
    """Say a number of things, one or many."""
    return f"{number} {noun}" + ("s" if number != 1 else "")


def _degrees(pose: NDArray[np.float64]) -> float:
    return float(np.degrees(se3.rotation_angle(pose)))
