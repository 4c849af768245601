"""Match, with what the target's sensor saw as evidence on every label."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.clouds.range_image import BAND
from hmrf_icp.loop.match import Match, Matcher, Matches, NearestNeighbour
from hmrf_icp.loop.placed import Placed
from hmrf_icp.search.rim import within_rim


@dataclass(frozen=True)
class VisibleMatch:
    """Matches, with what the target's sensor says of each point as evidence on its label.

    A point in space that the sensor looked through, hidden behind what it saw,
    or where it did not look, has no counterpart whatever its distance to the
    closest point (Masuda and Yokoya 1995 name these classes). Without a
    viewpoint only the rim of what was seen tells (:mod:`hmrf_icp.search.rim`).

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
    """

    match: Matcher = field(default_factory=NearestNeighbour)
    log_odds: tuple[float, float, float, float, float] = (0.0, -8.0, -6.0, -6.0, -4.0)
    band: float = 8.0

    def prepare(self, source: PreparedCloud, target: PreparedCloud) -> Match:
        """Look up what the target's sensor saw."""
        match = self.match.prepare(source, target)
        view = target.range_image
        if view is None:
            return within_rim(match, target)
        view = view.wider((self.band - BAND) * target.surface.noise)
        surface = source.surface
        log_odds = np.array(self.log_odds)

        def match_visible(source: Placed) -> Matches:
            seen = view.ask(surface.points, surface.normals, source.transformation)
            return replace(match(source), label_log_odds=log_odds[seen])

        return match_visible
