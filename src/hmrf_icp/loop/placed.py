"""The source where it is now."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Placed:
    """The source's observed points in the target's frame, and what brought them there.

    Attributes
    ----------
    points
        (M, 3) metres, in the target's frame.
    transformation
        (4, 4) source to target.
    """

    points: Array
    transformation: Array

    @classmethod
    def at(cls, transformation: Array, points: Array) -> Placed:
        """Place points (M, 3) of the source's own frame."""
        return cls(se3.transform(transformation, points), transformation)

    def moved(self, motion: Array) -> Placed:
        """Move on by ``motion`` (4, 4), within the target's frame."""
        return Placed(se3.transform(motion, self.points), motion @ self.transformation)
