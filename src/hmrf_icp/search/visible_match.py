"""Match, with what the target's sensor saw as evidence on every label."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.clouds.range_image import BAND
from hmrf_icp.loop.match import Match, Matcher, Matches, NearestNeighbour
from hmrf_icp.loop.placed import Placed
from hmrf_icp.search.visibility import NearSurface

Array = NDArray[np.float64]


@dataclass(frozen=True)
class VisibleMatch:
    """Matches, with what the target's sensor says of each point as evidence on its label.

    A point in space that the sensor looked through, hidden behind what it saw,
    or where it did not look, has no counterpart whatever its distance to the
    closest point (Masuda and Yokoya 1995 name these classes). Without a
    viewpoint a point has one where it is on the target's surface, within the noise and the
    spacing, and faces its way.

    Parameters
    ----------
    match
        Who is closest.
    log_odds
        Evidence for a counterpart of a point that agrees with the view, is in
        front of it, behind it, outside of it, or on a surface that faces
        another way (natural logarithm of odds).
    band
        Deviations of the noise by which a point may be off what was seen; the view
        itself has 4. A real sensor bends a whole map by more than its noise; points
        lost to that on one side pull the pose to the other.

    Examples
    --------
    >>> from hmrf_icp import NearestNeighbour, VisibleMatch
    >>> VisibleMatch(NearestNeighbour(tolerance=0.1)).match.tolerance
    0.1
    """

    match: Matcher = field(default_factory=NearestNeighbour)
    log_odds: tuple[float, float, float, float, float] = (0.0, -8.0, -6.0, -6.0, -4.0)
    band: float = 8.0

    def prepare(self, source: PreparedCloud, target: PreparedCloud) -> Match:
        """Look up what the target's sensor saw."""
        match = self.match.prepare(source, target)
        evidence = self.evidence(source, target)

        def match_visible(source: Placed) -> Matches:
            matches = match(source)
            return replace(matches, label_log_odds=evidence(source, matches))

        return match_visible

    def evidence(
        self, source: PreparedCloud, target: PreparedCloud
    ) -> Callable[[Placed, Matches], Array]:
        """Return what tells the log-odds (M,) of every label."""
        surface, log_odds = source.surface, np.array(self.log_odds)
        view = target.range_image
        if view is None or source.range_image is None:
            sides = surface.oriented and target.surface.oriented
            near = NearSurface(target, self.band, sides)

            def on_the_surface(source: Placed, matches: Matches) -> Array:
                normals = surface.normals @ source.transformation[:3, :3].T
                return np.asarray(log_odds[near.tell(matches.distance, matches.index, normals)])

            return on_the_surface
        view = view.wider((self.band - BAND) * target.surface.noise)

        def seen(source: Placed, matches: Matches) -> Array:  # noqa: ARG001
            codes = view.ask(surface.points, surface.normals, source.transformation)
            return np.asarray(log_odds[codes])

        return seen
