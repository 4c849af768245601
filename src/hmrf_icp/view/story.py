"""What is shown of a registration, as plain data: every face of the viewer draws this."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3
from hmrf_icp.drawing.palette import INLIER, VIOLATED
from hmrf_icp.search.visibility import FRONT

Array = NDArray[np.float64]

MOST_RAYS = 250
"""Rays drawn at a moment: more hide what they run through."""

WITH_VIEWS = (
    "agrees with what was seen",
    "in front: free space violated",
    "hidden behind what was seen",
    "outside what the other saw",
    "faces another way",
)
"""What a code of :mod:`hmrf_icp.kernels.range_image` says, in words."""

WITHOUT_VIEWS = (
    "on the other's surface",
    "a little off a surface that goes on",
    "behind",
    "far from it, or at its border",
    "faces another way",
)
"""The same where no viewpoint is known: see :class:`hmrf_icp.search.visibility.NearSurface`."""


AGREEMENT = INLIER, VIOLATED, "#5f7089", "#b2b7bd", "#56b4e9"
"""Colours of the codes, ``#rrggbb``."""


@dataclass(frozen=True, eq=False)
class ShownCloud:
    """A cloud, thinned for display.

    Attributes
    ----------
    name
        Of the file, or of the argument.
    points, normals
        (N, 3) in the cloud's own frame about ``origin``, metres; normals of no plane are zero.
    origin
        (3,) where that stands in the frame as given, metres.
    spacing
        Distance of a point to the next one, metres.
    total
        Observed points of the whole.
    viewpoint
        (3,) where it was seen from, None where that is not known.
    view
        How that is known, in words.
    """

    name: str
    points: NDArray[np.float32]
    normals: NDArray[np.float32]
    origin: Array
    spacing: float
    total: int
    viewpoint: Array | None
    view: str

    @property
    def count(self) -> str:
        """How many points are shown, in words."""
        shown = len(self.points)
        return f"{shown:,} points" if shown == self.total else f"{shown:,} of {self.total:,} points"


@dataclass(frozen=True, eq=False)
class Moment:
    """One pose of the timeline, and what is true of the points there.

    Attributes
    ----------
    title
        What it is.
    run, chosen
        As of a :class:`~hmrf_icp.view.steps.Step`.
    pose
        (4, 4) takes the shown source points into the frame of the shown target's.
    distance
        (N,) metres from each source point to the closest point of the whole target.
    of_source, of_target
        (N,) and (M,) what the other's view says of each point: codes of
        :mod:`hmrf_icp.kernels.range_image`.
    histogram
        Distances by the bins of :attr:`Story.edges`, as shares.
    numbers
        What the iteration reported, by a name with its unit.
    """

    title: str
    run: int
    chosen: bool
    pose: Array
    distance: NDArray[np.float32]
    of_source: NDArray[np.uint8]
    of_target: NDArray[np.uint8]
    histogram: Array
    numbers: Mapping[str, float]


@dataclass(frozen=True)
class Free:
    """A direction in which the surfaces slide, to be drawn as an arrow or a ring.

    Attributes
    ----------
    text
        In words, in the target's frame.
    rotation
        Whether it turns.
    direction, through
        (3,) of the axis or the way, and a point of it in the shown target's frame, metres.
    """

    text: str
    rotation: bool
    direction: tuple[float, ...]
    through: tuple[float, ...]


@dataclass(frozen=True)
class Said:
    """What a registration says of itself.

    Attributes
    ----------
    verdict, advice
        Sentences; advice is empty where there is none.
    believed
        Whether the pose is to be believed; None of a method that does not say.
    facts
        Names with values.
    free
        Directions that the surfaces leave free.
    """

    verdict: str
    believed: bool | None = None
    advice: str = ""
    facts: tuple[tuple[str, str], ...] = ()
    free: tuple[Free, ...] = ()


@dataclass(frozen=True, eq=False)
class Story:
    """All that the viewer shows.

    Attributes
    ----------
    said
        The verdict, and what goes with it.
    source, target
        The clouds.
    probability
        (N,) P(Z = +1) of each source point at the end; None where nobody decided.
    moments
        The timeline: the start first; the result, and after it the true pose where it is known.
    result
        Index of the result in ``moments``.
    edges
        (B + 1,) of the histograms' bins, metres, rising by a factor; they span the colours too.
    image
        (H, W) the source as the image that it was: row of the shown point that stands for
        each pixel, -1 where nothing was observed. None of a source that is no image.
    views
        Whether free space is known: both were seen from a known place.
    frame
        (3, 3) rows right, up and towards the viewer, to look along at first.
    """

    said: Said
    source: ShownCloud
    target: ShownCloud
    probability: NDArray[np.float32] | None
    moments: tuple[Moment, ...]
    result: int
    edges: Array
    image: NDArray[np.int32] | None
    views: bool
    frame: Array

    @property
    def title(self) -> str:
        """What is registered to what."""
        return f"{self.source.name} to {self.target.name}"

    @property
    def agreement(self) -> tuple[str, ...]:
        """What the codes say, in words."""
        return WITH_VIEWS if self.views else WITHOUT_VIEWS

    def rays(self, moment: Moment) -> Array:
        """Lines of sight that a pose puts something into: (K, 2, 3), from the viewpoint.

        Both sensors' in the frame of the shown target; none where no viewpoint is known.
        """
        mine, theirs = self.source.viewpoint, self.target.viewpoint
        if not self.views or mine is None or theirs is None:
            return np.zeros((0, 2, 3))
        ours = self.source.points[blocked(moment.of_source)].astype(np.float64)
        onto = self.target.points[blocked(moment.of_target)].astype(np.float64)
        rays = [
            _rays(theirs, se3.transform(moment.pose, ours)),
            _rays(se3.transform(moment.pose, mine), onto),
        ]
        return np.concatenate(rays)


def blocked(codes: NDArray[np.uint8]) -> NDArray[np.intp]:
    """Rows of the points in free space, evenly some of them where they are many."""
    rows = np.flatnonzero(codes == FRONT)
    return rows[:: max(1, -(-len(rows) // (MOST_RAYS // 2)))]


def _rays(viewpoint: Array, points: Array) -> Array:
    return np.stack([np.broadcast_to(viewpoint, points.shape), points], axis=1)
