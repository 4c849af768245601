"""Where a surface ends: a match with the rim of the target is no match.

Points beside the overlap have their closest target point on its rim, wherever the pose is, and
pull it towards them. Where a surface goes on, no point near it is farther from
the closest of its samples than these are from each other, measured along the surface; beyond
its rim, and over a hole, a point is. So the rim need not be looked for: the matches show it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.clouds.range_image import BAND
from hmrf_icp.loop.match import Match, Matches
from hmrf_icp.loop.placed import Placed

REACH = 1.5
"""Roots of the area of a target point, along the surface, within which it can be a counterpart.

Of points scattered at random on a surface one in a thousand is farther from all samples:
exp(-pi 1.5^2). Anything from 1 to 2 does as well.
"""

BEYOND = -6.0
"""Log-odds of a counterpart farther along the surface: what a view says of a point outside of it.

With -3 the poses are the same.
"""


def within_rim(match: Match, target: PreparedCloud) -> Match:
    """Return matches with evidence on each label: whether the target's surface goes on there.

    A match with a target point that has no normal is left as it is.
    """
    surface = target.surface
    points, normals = surface.points, surface.normals
    reach = (REACH * np.sqrt(surface.area) + BAND * surface.noise) ** 2
    known = (normals != 0.0).any(axis=1)

    def match_within(source: Placed) -> Matches:
        matches = match(source)
        row = matches.index
        off = source.points - points[row]
        along = np.einsum("ij,ij->i", off, normals[row])
        across = np.einsum("ij,ij->i", off, off) - along**2
        beyond = known[row] & (across > reach[row])
        return replace(matches, label_log_odds=np.where(beyond, BEYOND, 0.0))

    return match_within
