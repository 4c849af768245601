"""Many poses of a few points: which lie on the other surface, and which are alike."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import njit
from hmrf_icp.kernels.table import look_up


@njit(error_model="numpy")
def agreement(
    points: Any,
    normals: Any,
    onto: Any,
    onto_normals: Any,
    table: Any,
    corner: Any,
    edge: float,
    near: float,
    signed: bool,
    poses: Any,
) -> Any:
    """Tell for every pose (K, 4, 4) how the points (M, 3) lie on ``onto`` (N, 3).

    Returns (K, 2): how many lie on a surface that faces their way, and how many on one that
    faces the opposite way, each by exp(-2 d^2 / near^2) and the square of the cosine.
    """
    out = np.zeros((len(poses), 2))
    for candidate in range(len(poses)):
        pose = poses[candidate]
        for k in range(points.shape[0]):
            px, py, pz = points[k, 0], points[k, 1], points[k, 2]
            x = pose[0, 0] * px + pose[0, 1] * py + pose[0, 2] * pz + pose[0, 3]
            y = pose[1, 0] * px + pose[1, 1] * py + pose[1, 2] * pz + pose[1, 3]
            z = pose[2, 0] * px + pose[2, 1] * py + pose[2, 2] * pz + pose[2, 3]
            m = look_up(onto, table, corner, edge, x, y, z)
            if m < 0:
                continue
            square = (x - onto[m, 0]) ** 2 + (y - onto[m, 1]) ** 2 + (z - onto[m, 2]) ** 2
            if square > near * near:
                continue
            px, py, pz = normals[k, 0], normals[k, 1], normals[k, 2]
            x = pose[0, 0] * px + pose[0, 1] * py + pose[0, 2] * pz
            y = pose[1, 0] * px + pose[1, 1] * py + pose[1, 2] * pz
            z = pose[2, 0] * px + pose[2, 1] * py + pose[2, 2] * pz
            cosine = x * onto_normals[m, 0] + y * onto_normals[m, 1] + z * onto_normals[m, 2]
            weight = math.exp(-2.0 * square / (near * near)) * cosine * cosine
            if cosine >= 0.0 or not signed:
                out[candidate, 0] += weight
            else:
                out[candidate, 1] += weight
    return out


@njit(error_model="numpy")
def distinct(places: Any, order: Any, apart: float, most: int) -> Any:
    """Rows of ``places`` (K, D) in ``order``, each farther than ``apart`` from those before."""
    kept = np.empty(most, np.int64)
    count = 0
    for i in order:
        if count == most:
            break
        alike = False
        for m in range(count):
            square = 0.0
            for d in range(places.shape[1]):
                square += (places[i, d] - places[kept[m], d]) ** 2
            if square < apart * apart:
                alike = True
                break
        if not alike:
            kept[count] = i
            count += 1
    return kept[:count]
