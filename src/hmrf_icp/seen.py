"""Match, with what the target's sensor saw as evidence on every label."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from hmrf_icp.cloud import PointCloud
from hmrf_icp.evidence import Near
from hmrf_icp.match import Match, Matcher, Matches, NearestNeighbour
from hmrf_icp.placed import Placed
from hmrf_icp.surface import surface_of
from hmrf_icp.view import BAND, view_of


@dataclass(frozen=True)
class Seen:
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
    """

    match: Matcher = field(default_factory=NearestNeighbour)
    log_odds: tuple[float, float, float, float, float] = (0.0, -8.0, -6.0, -6.0, -4.0)
    band: float = 8.0

    def prepare(self, source: PointCloud, target: PointCloud) -> Match:
        """Look up what the target's sensor saw."""
        match = self.match.prepare(source, target)
        view = view_of(target)
        surface = surface_of(source)
        log_odds = np.array(self.log_odds)
        if view is None:
            near = Near(target, self.band)

            def on(source: Placed) -> Matches:
                found = match(source)
                normals = surface.normals @ source.transformation[:3, :3].T
                verdict = near.tell(found.distance, found.index, normals)
                return replace(found, evidence=log_odds[verdict])

            return on
        view = view.wider((self.band - BAND) * surface_of(target).noise)

        def seen(source: Placed) -> Matches:
            verdict = view.ask(surface.points, surface.normals, source.transformation)
            return replace(match(source), evidence=log_odds[verdict])

        return seen
