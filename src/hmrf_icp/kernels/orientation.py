"""Signs of normals that agree from each point to the next."""

from __future__ import annotations

import heapq
from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import njit


@njit(error_model="numpy")
def propagate(normals: Any, index: Any, order: Any) -> Any:
    """Flip normals (M, 3) in place so that neighbours agree; return the component (M,) of each.

    ``index`` (M, K) lists neighbours. A tree grows from the first point of ``order`` (M,) that no
    tree has, always along the edge whose normals are most nearly parallel.
    """
    n, k = index.shape
    part = np.full(n, -1, np.int64)
    count = 0
    for start in order:
        if part[start] >= 0:
            continue
        heap = [(0.0, start, start)]
        while len(heap) > 0:
            _, i, parent = heapq.heappop(heap)
            if part[i] >= 0:
                continue
            part[i] = count
            cosine = 0.0
            for axis in range(3):
                cosine += normals[i, axis] * normals[parent, axis]
            if cosine < 0.0:
                for axis in range(3):
                    normals[i, axis] = -normals[i, axis]
            for m in range(k):
                j = index[i, m]
                if j < 0 or part[j] >= 0:
                    continue
                cosine = 0.0
                for axis in range(3):
                    cosine += normals[i, axis] * normals[j, axis]
                heapq.heappush(heap, (1.0 - abs(cosine), j, i))
        count += 1
    return part
