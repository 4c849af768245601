"""When a pose counts as the true one, for pairs that bring their own criterion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hmrf_icp import se3
from hmrf_icp.se3 import Array

LARGEST_RMSE = 0.2
"""Metres: what the benchmarks of Choi et al. and 3DMatch allow."""


class Criterion(Protocol):
    """Tells right poses from wrong ones.

    Pairs are sent to other processes: a criterion is plain data.
    """

    def right(self, estimate: Array, truth: Array, centroid: Array) -> bool:
        """Tell whether a pose is right.

        Parameters
        ----------
        estimate, truth
            (4, 4) source to target.
        centroid
            (3,) mean of the source's points in its own frame.
        """


@dataclass(frozen=True, eq=False)
class MatchedRmse:
    """The criterion of Choi, Zhou and Koltun (CVPR 2015), which 3DMatch and 3DLoMatch use.

    A pose is right when the root mean square error over the pair's true matches, which the
    information matrix approximates, is at most ``rmse``: ``e' I e / I[0, 0] <= rmse**2``, where e
    is the translation and the vector part of the quaternion of ``inverse(truth) @ estimate``.

    Parameters
    ----------
    information
        (6, 6) the pair's block of ``gt.info``; its first element counts the matches.
    rmse
        Metres.
    """

    information: Array
    rmse: float = LARGEST_RMSE

    def error(self, estimate: Array, truth: Array) -> float:
        """Return the root mean square error over the true matches, metres."""
        from scipy.spatial.transform import Rotation

        off = se3.inverse(truth) @ estimate
        quaternion = Rotation.from_matrix(off[:3, :3]).as_quat(canonical=True)
        e = np.concatenate([off[:3, 3], quaternion[:3]])
        return float(np.sqrt(e @ self.information @ e / self.information[0, 0]))

    def right(self, estimate: Array, truth: Array, centroid: Array) -> bool:  # noqa: ARG002
        """Tell whether that error is small enough."""
        return self.error(estimate, truth) <= self.rmse


@dataclass(frozen=True)
class Tolerance:
    """Two bounds: on how far the source's centroid ends from where it belongs, and on the turn.

    Unlike the difference of two translations the former does not depend on where the
    frames have their origins.

    Parameters
    ----------
    distance
        In the unit of the clouds.
    radians
        Of the rotation between the two poses.
    """

    distance: float
    radians: float

    def errors(self, estimate: Array, truth: Array, centroid: Array) -> tuple[float, float]:
        """Return how far the centroid ends from where it belongs, and the turn in radians."""
        ends = [se3.transform(pose, centroid[None])[0] for pose in (estimate, truth)]
        return float(np.linalg.norm(ends[0] - ends[1])), se3.error(estimate, truth)[1]

    def right(self, estimate: Array, truth: Array, centroid: Array) -> bool:
        """Tell whether both are kept."""
        distance, radians = self.errors(estimate, truth, centroid)
        return distance <= self.distance and radians <= self.radians
