"""The few statistics that a report needs: shares with intervals, deciles, ROC, reliability."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]

Z_95 = 1.959963984540054
"""Two-sided 95 % point of the standard normal distribution."""

DECILES = 10


@dataclass(frozen=True)
class Share:
    """A number of successes out of a number of runs."""

    solved: int
    runs: int

    @classmethod
    def of(cls, solved: NDArray[np.bool_]) -> Share:
        """Count a mask of successes."""
        return cls(int(np.count_nonzero(solved)), int(solved.size))

    @property
    def value(self) -> float | None:
        """The share in [0, 1]; None where nothing was run."""
        return self.solved / self.runs if self.runs else None

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the share; everything, (0, 1), where nothing was run."""
        return wilson(self.solved, self.runs)


def wilson(solved: int, runs: int, z: float = Z_95) -> tuple[float, float]:
    """Interval of a share after Wilson (1927).

    Unlike the textbook interval it stays inside [0, 1] and has a width where
    all or none of the runs succeeded, which recalls often do.

    Parameters
    ----------
    solved, runs
        Counts, ``0 <= solved <= runs``.
    z
        Quantile of the normal distribution; the default gives 95 %.

    Returns
    -------
    Lower and upper end, in [0, 1]; (0, 1) for no runs.
    """
    if runs == 0:
        return 0.0, 1.0
    share = solved / runs
    scale = 1.0 / (1.0 + z**2 / runs)
    centre = scale * (share + z**2 / (2 * runs))
    half = scale * z * float(np.sqrt(share * (1 - share) / runs + z**2 / (4 * runs**2)))
    low = 0.0 if solved == 0 else max(0.0, centre - half)
    high = 1.0 if solved == runs else min(1.0, centre + half)
    return low, high


def decile(overlap: ArrayLike) -> NDArray[np.intp]:
    """Decile 0 to 9 of an overlap in [0, 1]; an overlap of exactly 1 is in the last."""
    tenths = np.floor(np.asarray(overlap, dtype=np.float64) * DECILES).astype(np.intp)
    return np.asarray(np.clip(tenths, 0, DECILES - 1))


def decile_label(number: int) -> str:
    """Write a decile as its bounds: 3 is ``0.3-0.4`` (with an en dash)."""
    return f"{number / DECILES:.1f}–{(number + 1) / DECILES:.1f}"


def median(values: NDArray[Any]) -> float | None:
    """Median of what is finite; None where nothing is."""
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else None


def roc_curve(score: ArrayLike, success: ArrayLike) -> tuple[Array, Array]:
    """Points of the ROC curve of a score that should be high for successes.

    Equal scores make one step, so the curve does not depend on their order.

    Returns
    -------
    Share of failures and share of successes with a score at or above a
    threshold, for thresholds from above the highest score to below the lowest.
    """
    score = np.asarray(score, dtype=np.float64)
    success = np.asarray(success, dtype=np.bool_)
    order = np.argsort(-score, kind="stable")
    score, success = score[order], success[order]
    last_of_equal = np.append(np.flatnonzero(np.diff(score)), score.size - 1)
    hits = np.cumsum(success)[last_of_equal]
    alarms = np.cumsum(~success)[last_of_equal]
    false = np.concatenate(([0.0], alarms / max(1, int(alarms[-1]))))
    true = np.concatenate(([0.0], hits / max(1, int(hits[-1]))))
    return false, true


def area_under_roc(score: ArrayLike, success: ArrayLike) -> float | None:
    """Chance that a success scores higher than a failure, ties counted half.

    None where there are only successes, or only failures: nothing can be told
    apart then.
    """
    score = np.asarray(score, dtype=np.float64)
    success = np.asarray(success, dtype=np.bool_)
    positives = int(np.count_nonzero(success))
    negatives = success.size - positives
    if positives == 0 or negatives == 0:
        return None
    _, place, count = np.unique(score, return_inverse=True, return_counts=True)
    mid_rank = np.cumsum(count) - (count - 1) / 2.0
    ranks = mid_rank[place]
    above = float(ranks[success].sum()) - positives * (positives + 1) / 2.0
    return above / (positives * negatives)


@dataclass(frozen=True, eq=False)
class Reliability:
    """How often runs succeed that were given a confidence, by bins of confidence.

    Attributes
    ----------
    confidence
        (B,) mean confidence of the runs in each bin that has any.
    shares
        Successes and runs of each of those bins.
    calibration_error
        Mean distance between confidence and share of successes, weighted by
        runs (the expected calibration error).
    brier
        Mean squared difference between confidence and outcome; a constant 0.5
        has 0.25.
    """

    confidence: Array
    shares: tuple[Share, ...]
    calibration_error: float
    brier: float


def reliability(confidence: Array, success: NDArray[np.bool_], bins: int = 10) -> Reliability:
    """Bin runs by their confidence in [0, 1], at least one run given."""
    place = np.clip((confidence * bins).astype(np.intp), 0, bins - 1)
    used = np.unique(place)
    means = np.array([float(confidence[place == b].mean()) for b in used])
    shares = tuple(Share.of(success[place == b]) for b in used)
    distance = sum(
        abs(mean - share.solved / share.runs) * share.runs
        for mean, share in zip(means, shares, strict=True)
    )
    return Reliability(
        confidence=means,
        shares=shares,
        calibration_error=float(distance / confidence.size),
        brier=float(np.mean((confidence - success) ** 2)),
    )
