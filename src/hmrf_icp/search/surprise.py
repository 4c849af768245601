"""Which of many poses explains what others do not.

A plane laid on a plane agrees wherever it slides, and the wrong poses of a list have found
the largest planes to agree on. That a point agrees which hardly ever does tells more: each
counts by the logarithm of how seldom it agreed among all poses, as words count by how few
documents have them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

AGREED = 0.001
"""Added to the agreement of every pose, so that none is zero."""

VIOLATED = 0.003
"""Share of the points added to those that violate: a few do under the right pose, by noise."""


def surprise(agree: NDArray[np.bool_], front: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Rank poses by what agrees under them and under few others, against what violates.

    Parameters
    ----------
    agree
        (K, M) whether each of M points agrees under each of K poses. The poses should
        be distinct: what agrees under ten copies of one is no commonplace.
    front
        (K, M) whether it stands in space that was seen to be empty; all False where
        nothing is known of it.

    Returns
    -------
    (K,) log of the ratio; larger is likelier, among these poses alone.
    """
    seldom = -np.log((agree.sum(axis=0) + 1.0) / (len(agree) + 1.0))
    seldom /= max(float(seldom.mean()), 1e-12)
    agreed = agree @ seldom / agree.shape[1]
    return np.asarray(np.log((agreed + AGREED) / (front.mean(axis=1) + VIOLATED)))
