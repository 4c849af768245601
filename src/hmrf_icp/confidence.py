"""How far a registration can be believed: the evidence for its pose as a probability."""

from __future__ import annotations

from hmrf_icp.evidence import Verdict

INTERCEPT, AGREEMENT, VIOLATION, DISAGREEMENT = 0.0, 1.0, -1.0, 0.0


def confidence(verdict: Verdict) -> float:
    """Probability in [0, 1] that a pose with this verdict is right."""
    return verdict.score
