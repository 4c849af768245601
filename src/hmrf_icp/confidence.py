"""How far a registration can be believed: the evidence for its pose as a probability.

A logistic regression on what both sensors saw and on how many directions the
surfaces leave free, fitted to poses, right and wrong ones, of rendered depth maps
(kitchen, tabletop) and of a real structured-light camera; what it is worth on others
is in ``docs/confidence.md``.
"""

from __future__ import annotations

import math

from hmrf_icp.evidence import Verdict

CONSTANT, VIOLATIONS, AGREEMENT = -4.244, -1.703, 0.688
"""Log-odds: alone, for each e-fold of free space violated to agreement, and of agreement."""

FREE = 1.2
"""What each direction takes off the log-odds along which the matched surfaces slide.

A plane laid on a plane agrees wherever it lies.
"""

PSEUDO = 0.001
"""Share of the points asked that is added to every count, so that none is zero."""


def confidence(verdict: Verdict, free: int = 0) -> float:
    """Probability in [0, 1] that a pose with this verdict is right.

    Parameters
    ----------
    verdict
        Where no viewpoint is known (``verdict.seen`` is False) nothing can be
        contradicted, and the answer is only the share of points that agree,
        less for free directions: it ranks poses of one pair, and is not calibrated.
    free
        Directions that the matched surfaces leave free.
    """
    odds = math.exp(min(log_odds(verdict, free), 700.0))
    return odds / (1.0 + odds)


def log_odds(verdict: Verdict, free: int = 0) -> float:
    """Logarithm of the odds; see :func:`confidence`."""
    if not verdict.seen:
        share = min(max(verdict.score, PSEUDO), 1.0 - PSEUDO)
        return math.log(share / (1.0 - share)) - FREE * free
    asked = max(verdict.asked, 1)
    agree = verdict.agree / asked + PSEUDO
    front = verdict.front / asked + PSEUDO
    odds = CONSTANT + VIOLATIONS * math.log(front / agree) + AGREEMENT * math.log(agree)
    return odds - FREE * free
