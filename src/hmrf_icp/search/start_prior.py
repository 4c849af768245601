"""What the start says before anything is seen: the farther a pose is from it, the less likely.

Two walls agree wherever they slide on each other, and little overlap tells little;
what is left to choose by is that somebody gave this start and not another.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3

Array = NDArray[np.float64]

NEAR = 0.15
"""Radians, or shares of the size, within which one pose is about as likely as another."""

FALL = 3.0
"""Power of the distance with which the odds fall beyond that.

How good a start is, nobody says: a power has no scale of its own, and still lets
evidence win at any distance.
"""

FALL_ANYWHERE = 0.3
"""The same where no start was given: that frames coincide is likelier than any one other pose."""

NEAREST_STEPS = 5
"""Of Gauss and Newton, to the likeliest pose along free motions: enough for a turn of 1 rad."""


@dataclass(frozen=True, eq=False)
class StartPrior:
    """Log-odds of poses for one start.

    Parameters
    ----------
    start
        (4, 4).
    centre
        (3,) centre of the source where the start puts it, metres.
    size
        Size of the target, metres: a shift by as much counts like a turn by a radian.
    fall
        Power of the distance.
    """

    start: Array
    centre: Array
    size: float
    fall: float = FALL

    def __call__(self, pose: Array) -> float:
        """Log-odds of a pose (4, 4), 0 for the start itself."""
        motion = pose @ se3.inverse(self.start)
        shift = float(np.linalg.norm(se3.transform(motion, self.centre) - self.centre))
        far = math.hypot(se3.rotation_angle(motion), shift / self.size)
        return -0.5 * self.fall * math.log1p((far / NEAR) ** 2)

    def nearest(self, pose: Array, free: Array) -> Array:
        """Move a pose (4, 4) along free motions, unit twists (k, 6), to where it is likeliest."""
        for _ in range(NEAREST_STEPS):
            motion = pose @ se3.inverse(self.start)
            centre = se3.transform(motion, self.centre)
            away = np.concatenate([se3.log(motion)[:3], (centre - self.centre) / self.size])
            moves = np.cross(free[:, :3], centre) + free[:, 3:]
            towards = np.hstack([free[:, :3], moves / self.size])
            by, *_ = np.linalg.lstsq(towards.T, -away, rcond=None)
            pose = se3.exp(by @ free) @ pose
        return pose
