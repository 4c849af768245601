"""When the loop stops."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.errors import InputError


@dataclass(frozen=True)
class Criteria:
    """When the loop stops.

    Parameters
    ----------
    translation
        A step is small whose translation is below this, metres, and
    rotation
        whose angle is below this, radians.
    max_iterations
        Iterations after which it stops without having converged.
    centre
        Point of the target's frame whose motion the translation is, metres. The paper's is
        the origin, wherever that is: about a far one, the smallest turn is a long way.

    Raises
    ------
    InputError
        One of them is negative or NaN.

    Examples
    --------
    >>> import numpy as np
    >>> from hmrf_icp import Criteria
    >>> step = np.eye(4)
    >>> step[0, 3] = 0.004
    >>> Criteria(translation=0.01).met(step), Criteria(translation=0.001).met(step)
    (True, False)
    """

    translation: float = 0.01
    rotation: float = 0.001
    max_iterations: int = 50
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Refuse what no step could meet by mistake; 0 is the way to say never."""
        for name in ("translation", "rotation", "max_iterations"):
            if not getattr(self, name) >= 0:
                raise InputError(
                    f"criteria: expected a {name} of 0 or more, got {getattr(self, name)}"
                )

    def met(self, step: NDArray[np.float64]) -> bool:
        """Whether a step (4, 4) is small enough to stop."""
        centre = np.array(self.centre)
        went = float(np.linalg.norm(se3.transform(step, centre) - centre))
        return went < self.translation and se3.rotation_angle(step) < self.rotation

    def on(self, target: PreparedCloud) -> Criteria:
        """Return these: they are in metres whatever the target."""
        return self


@dataclass(frozen=True)
class RelativeCriteria:
    """Criteria that scale with the scene.

    Parameters
    ----------
    step
        A step is small whose angle is below this, radians, and whose translation
        of the target's centre is below this share of its size (root mean square distance
        of its points from that).
    max_iterations
        As for :class:`Criteria`.

    Examples
    --------
    >>> import numpy as np
    >>> from hmrf_icp import RelativeCriteria, prepare
    >>> points = np.random.default_rng(0).uniform(size=(500, 3))
    >>> metres, millimetres = (
    ...     RelativeCriteria(1e-3).on(prepare(unit * points)).translation for unit in (1.0, 1000.0)
    ... )
    >>> round(millimetres / metres, 6)
    1000.0
    """

    step: float = 1e-4
    max_iterations: int = 30

    def on(self, target: PreparedCloud) -> Criteria:
        """Return what they are for one target, in metres."""
        x, y, z = target.points.mean(axis=0).tolist()
        return Criteria(self.step * target.surface.size, self.step, self.max_iterations, (x, y, z))


class StoppingRule(Protocol):
    """Criteria, or what becomes criteria once the target is known."""

    @property
    def max_iterations(self) -> int:
        """Iterations after which the loop stops without having converged."""

    def on(self, target: PreparedCloud) -> Criteria:
        """Return the criteria for one target."""


def at_most(criteria: Criteria, iterations: int) -> Criteria:
    """Return the same criteria with no more than so many iterations."""
    return replace(criteria, max_iterations=min(iterations, criteria.max_iterations))
