"""How far a registration can be believed: the evidence for its pose as a probability.

A logistic regression on what both sensors saw, fitted to 446 poses, right and
wrong ones, of rendered depth maps (kitchen, tabletop) and of a real structured-light
camera; what it is worth on others is in ``docs/confidence.md``.
"""

from __future__ import annotations

import math

from hmrf_icp.evidence import Verdict

CONSTANT, VIOLATIONS, AGREEMENT = -4.244, -1.703, 0.688
"""Log-odds: alone, for each e-fold of free space violated to agreement, and of agreement."""

PSEUDO = 0.001
"""Share of the points asked that is added to every count, so that none is zero."""


def confidence(verdict: Verdict) -> float:
    """Probability in [0, 1] that a pose with this verdict is right.

    Where no viewpoint is known (``verdict.seen`` is False) nothing can be
    contradicted, and the answer is only the share of points that agree: it
    ranks poses of one pair, and is not calibrated.
    """
    if not verdict.seen:
        return verdict.score
    asked = max(verdict.asked, 1)
    agree = verdict.agree / asked + PSEUDO
    front = verdict.front / asked + PSEUDO
    log_odds = CONSTANT + VIOLATIONS * math.log(front / agree) + AGREEMENT * math.log(agree)
    return 1.0 / (1.0 + math.exp(-log_odds))
