"""How far a registration can be believed: the evidence for its pose as a probability.

A logistic regression on what both sensors saw and on how well the matched surfaces
hold the pose in the direction in which they hold it least, fitted to poses, right and
wrong ones, of rendered depth maps (a kitchen, a tabletop, rooms furnished at random) and
of a real structured-light camera; its calibration on others is in ``docs/confidence.md``.
"""

from __future__ import annotations

import math

from hmrf_icp.search.visibility import Visibility

CONSTANT, VIEWS, HELD = -2.80, 1.33, 1.16
"""Log-odds: alone, for each e-fold of agreement to free space violated, and for each e-fold of
what is known of the direction known least, up to :data:`ENOUGH`."""

CONSTANT_UNSEEN, SURFACES, HELD_UNSEEN, FACING, EXTENT = 4.16, 3.47, 0.64, 1.94, 1.99
"""The same where no viewpoint is known: alone; for each e-fold of points on a surface to points a
little off it; of what is known of the direction known least; of how many ways what agrees faces,
and how far it extends. Fitted to 1,415 ends of 54 pairs of fused fragments of real rooms and a
rendered one."""

CLEAR, LEAST_CLEAR, CLEARING = 4.0, 3.6, 3.0
"""Where the origins of both frames may be viewpoints, the logarithm of agreement to free space
violated from there tells as :data:`VIEWS` says beyond the first, and log-odds are at most the last
times what it is above the second. Right poses of 3DLoMatch have 4.0 to 5.5, wrong ones that
surfaces do not contradict 1.8 to 3.4."""

CHANCE = 4.0
"""Log-odds at the most, where no viewpoint is known: this for each e-fold of points that agree to
points on a surface that faces another way. Of normals that mean nothing a fifth agree by chance."""

AGREEING, LEAST_AGREEING = 2.0, 0.03
"""Log-odds at the most, where views are known: the first for each e-fold of points that agree,
as a share of those asked, to the second. A corner laid on another corner can agree with nothing
against it. Right poses from a tenth of overlap up have 0.08 and more."""

LEAST = 1e-3
"""Facing and extent below which less tells no more."""

NOTHING, ENOUGH = 1e-3, 20.0
"""Times what a direction must have to be followed, between which it tells how well it is known."""

SLIDES, SLIDING = 1.26, 0.82
"""Log-odds at the most: the first times the second and the logarithm of what is known of that
direction. A plane laid on a plane agrees wherever it lies, and no view makes up for that."""

PSEUDO = 0.001
"""Share of the points asked that is added to every count, so that none is zero."""


def confidence(visibility: Visibility, weakest: float | None = None) -> float:
    """Probability in [0, 1] that a pose with this visibility is right.

    Parameters
    ----------
    visibility
        Where no viewpoint is known (``visibility.views`` is False) surfaces that lie a little
        off each other take the place of free space violated.
    weakest
        How well the direction known least is known (:class:`hmrf_icp.loop.align.Step`);
        None where nobody looked, and it is taken for well known.
    """
    most = SLIDES * (SLIDING + math.log(_known(weakest)))
    if visibility.views:
        agree = visibility.agree / max(visibility.asked, 1)
        most = min(most, AGREEING * math.log(max(agree, PSEUDO) / LEAST_AGREEING))
    else:
        most = min(most, CHANCE * math.log((visibility.agree + 1.0) / (visibility.other + 1.0)))
        if visibility.clear is not None:
            most = min(most, CLEARING * (visibility.clear - LEAST_CLEAR))
    odds = math.exp(min(log_odds(visibility, weakest), most))
    return odds / (1.0 + odds)


def log_odds(visibility: Visibility, weakest: float | None = None) -> float:
    """Evidence for the pose, to choose among several; :func:`confidence` is its probability.

    How far views agree tells two poses apart along which surfaces slide alike.
    """
    held = HELD * math.log(_known(weakest) / ENOUGH)
    asked = max(visibility.asked, 1)
    agree = visibility.agree / asked + PSEUDO
    front = visibility.front / asked + PSEUDO
    if not visibility.views:
        return (
            CONSTANT_UNSEEN
            + SURFACES * math.log(agree / front)
            + HELD_UNSEEN * math.log(_known(weakest) / ENOUGH)
            + FACING * math.log(max(visibility.facing, LEAST))
            + EXTENT * math.log(max(visibility.extent, LEAST))
            + (0.0 if visibility.clear is None else VIEWS * (visibility.clear - CLEAR))
        )
    return CONSTANT + VIEWS * math.log(agree / front) + held


def _known(weakest: float | None) -> float:
    return ENOUGH if weakest is None else min(max(weakest, NOTHING), ENOUGH)
