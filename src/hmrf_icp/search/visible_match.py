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

Array = NDArray[np.float64]


@dataclass(frozen=True)
class VisibleMatch:
    """Matches, with what the target's sensor says of each point as evidence on its label.

    A point in space that the sensor looked through, hidden behind what it saw,
    or where it did not look, has no counterpart whatever its distance to the
    closest point (Masuda and Yokoya 1995 name these classes). Without a
    viewpoint there is no evidence, and nothing but the matches.

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
        evidence = self.evidence(source, target)
        if evidence is None:
            return match

        def match_visible(source: Placed) -> Matches:
            return replace(match(source), label_log_odds=evidence(source))

        return match_visible

    def evidence(
        self, source: PreparedCloud, target: PreparedCloud
    ) -> Callable[[Placed], Array] | None:
        """Return what tells the log-odds (M,) of every label, None where no view is known."""
        view = target.range_image
        if view is None:
            return None
        view = view.wider((self.band - BAND) * target.surface.noise)
        surface = source.surface
        signed = surface.oriented and target.surface.oriented
        log_odds = np.array(self.log_odds)

        def ask(source: Placed) -> Array:
            seen = view.ask(surface.points, surface.normals, source.transformation, signed)
            return np.asarray(log_odds[seen])

        return ask
