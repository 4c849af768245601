"""Which matches of points can both be right, and the groups of them that all can."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hmrf_icp.kernels.compiled import ANY_ORDER, njit

ASKED = 256
"""Neighbours of a match that are asked what they have in common with it.

Between bare planes everything fits everything, and the work would grow with the cube.
"""


@njit(error_model="numpy")
def ones(word: Any) -> Any:
    """Count the bits of a word of 64 that are set; the compiler knows this as one instruction."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + (
        (word >> np.uint64(2)) & np.uint64(0x3333333333333333)
    )
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@njit(error_model="numpy", fastmath=ANY_ORDER)
def as_far(source: Any, target: Any, i: int, tolerance: float, apart: float, fits: Any) -> None:
    """Mark the matches before the i-th that are as far from it in both clouds.

    Coordinates (3, N) in single precision, in a loop without branches: the processor
    takes several matches at a time.
    """
    ax, ay, az = source[0, i], source[1, i], source[2, i]
    bx, by, bz = target[0, i], target[1, i], target[2, i]
    square, least = np.float32(tolerance * tolerance), np.float32(apart * apart)
    for j in range(i):
        px, py, pz = source[0, j] - ax, source[1, j] - ay, source[2, j] - az
        qx, qy, qz = target[0, j] - bx, target[1, j] - by, target[2, j] - bz
        p = px * px + py * py + pz * pz
        q = qx * qx + qy * qy + qz * qz
        # |sqrt p - sqrt q| <= t, without a root: p + q - t^2 <= 2 sqrt(p q).
        left = max(p + q - square, np.float32(0.0))
        fits[j] = (left * left <= np.float32(4.0) * p * q) & (p >= least) & (q >= least)


@njit(error_model="numpy", inline="always")
def line(points: Any, i: int, j: int) -> Any:
    """Give the unit vector from point i to point j of (N, 3)."""
    x, y, z = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
    scale = 1.0 / math.sqrt(x * x + y * y + z * z)
    return x * scale, y * scale, z * scale


@njit(error_model="numpy", inline="always")
def along(normals: Any, i: int, x: float, y: float, z: float) -> float:
    """Cosine between normal i of (N, 3) and a unit vector."""
    return normals[i, 0] * x + normals[i, 1] * y + normals[i, 2] * z


@njit(error_model="numpy")
def compatible(
    source: Any,
    source_normals: Any,
    target: Any,
    target_normals: Any,
    tolerance: float,
    apart: float,
    turn: float,
) -> Any:
    """Bits (N, W) of the pairs of matches that one rigid motion can explain.

    Two source points are as far apart as the two target points, to ``tolerance``, and farther
    than ``apart``; the cosines between their normals, and between normals and the line that
    joins them, differ by less than ``turn``.
    """
    n = len(source)
    bits = np.zeros((n, (n + 63) // 64), np.uint64)
    mine, theirs = np.empty((3, n), np.float32), np.empty((3, n), np.float32)
    for axis in range(3):
        # From the middle: single precision does not hold the coordinates of a map.
        mine[axis] = source[:, axis] - source[:, axis].mean()
        theirs[axis] = target[:, axis] - target[:, axis].mean()
    fits = np.zeros(n, np.bool_)
    for i in range(n):
        as_far(mine, theirs, i, tolerance, apart, fits)
        for j in range(i):
            if not fits[j]:
                continue
            nx, ny, nz = source_normals[j, 0], source_normals[j, 1], source_normals[j, 2]
            mx, my, mz = target_normals[j, 0], target_normals[j, 1], target_normals[j, 2]
            one, two = along(source_normals, i, nx, ny, nz), along(target_normals, i, mx, my, mz)
            if abs(one - two) > turn:
                continue
            px, py, pz = line(source, i, j)
            qx, qy, qz = line(target, i, j)
            one, two = along(source_normals, i, px, py, pz), along(target_normals, i, qx, qy, qz)
            if abs(one - two) > turn:
                continue
            one, two = along(source_normals, j, px, py, pz), along(target_normals, j, qx, qy, qz)
            if abs(one - two) > turn:
                continue
            bits[i, j >> 6] |= np.uint64(1) << np.uint64(j & 63)
            bits[j, i >> 6] |= np.uint64(1) << np.uint64(i & 63)
    return bits


@njit(error_model="numpy")
def listed(bits: Any, found: Any) -> int:
    """List the numbers of the bits (W,) that are set; return how many."""
    count = 0
    for word in range(len(bits)):
        left = bits[word]
        while left != 0:
            lowest = left & (~left + np.uint64(1))
            found[count] = 64 * word + ones(lowest - np.uint64(1))
            count += 1
            left ^= lowest
    return count


@njit(error_model="numpy")
def support(bits: Any) -> Any:
    """Second-order support (N,): for each match the triangles it is a corner of, twice.

    Of more than ``ASKED`` neighbours only as many are asked, evenly.
    """
    n, words = bits.shape
    out = np.zeros(n)
    found = np.empty(64 * words, np.int64)
    for i in range(n):
        count = listed(bits[i], found)
        step = 1 + count // ASKED
        for m in range(0, count, step):
            j = found[m]
            for w in range(words):
                out[i] += step * ones(bits[i, w] & bits[j, w])
    return out


@njit(error_model="numpy")
def groups(bits: Any, seeds: Any, limit: int, often: int, most: int) -> Any:
    """Grow up to ``limit`` cliques from ``seeds``: members (S, most), -1 where there are no more.

    The next member is the one with most neighbours among those that all members so far have
    in common. A match that is in ``often`` cliques already is no seed: so they spread.
    """
    words = bits.shape[1]
    out = np.full((limit, most), -1, np.int64)
    found = np.empty(64 * words, np.int64)
    common = np.empty(words, np.uint64)
    member = np.zeros(bits.shape[0], np.int64)
    s = 0
    for seed in seeds:
        if s == limit:
            break
        if member[seed] >= often:
            continue
        out[s, 0] = seed
        member[seed] += 1
        common[:] = bits[seed]
        for size in range(1, most):
            count = listed(common, found)
            if count == 0:
                break
            best, chosen = -1, -1
            for m in range(0, count, 1 + count // ASKED):
                j = found[m]
                shared = 0
                for w in range(words):
                    shared += ones(common[w] & bits[j, w])
                if shared > best:
                    best, chosen = shared, j
            out[s, size] = chosen
            member[chosen] += 1
            for w in range(words):
                common[w] &= bits[chosen, w]
        s += 1
    return out[:s]


@njit(error_model="numpy")
def motion(source: Any, target: Any, weight: Any, rows: Any, count: int, pose: Any) -> None:
    """Rigid motion (4, 4) that lays rows of the source on the target, by least squares."""
    total = 0.0
    a, b = np.zeros(3), np.zeros(3)
    for m in range(count):
        w = weight[m]
        total += w
        for k in range(3):
            a[k] += w * source[rows[m], k]
            b[k] += w * target[rows[m], k]
    a /= total
    b /= total
    h = np.zeros((3, 3))
    for m in range(count):
        for k in range(3):
            for n in range(3):
                h[k, n] += weight[m] * (target[rows[m], k] - b[k]) * (source[rows[m], n] - a[n])
    u, _, vt = np.linalg.svd(h)
    r = u @ vt
    if np.linalg.det(r) < 0.0:
        u[:, 2] = -u[:, 2]
        r = u @ vt
    pose[:] = 0.0
    pose[3, 3] = 1.0
    pose[:3, :3] = r
    pose[:3, 3] = b - r @ a


@njit(error_model="numpy")
def inliers(
    pose: Any,
    source: Any,
    source_normals: Any,
    target: Any,
    target_normals: Any,
    tolerance: float,
    rows: Any,
    weight: Any,
) -> int:
    """List the matches that a motion (4, 4) explains, with weights; return how many."""
    count = 0
    for i in range(len(source)):
        off = 0.0
        cosine = 0.0
        for k in range(3):
            x = (
                pose[k, 0] * source[i, 0]
                + pose[k, 1] * source[i, 1]
                + pose[k, 2] * source[i, 2]
                + pose[k, 3]
            )
            off += (x - target[i, k]) ** 2
        if off > tolerance * tolerance:
            continue
        for k in range(3):
            y = (
                pose[k, 0] * source_normals[i, 0]
                + pose[k, 1] * source_normals[i, 1]
                + pose[k, 2] * source_normals[i, 2]
            )
            cosine += y * target_normals[i, k]
        if cosine < 0.7:
            continue
        rows[count] = i
        weight[count] = 1.0 - off / (tolerance * tolerance) + 1e-3
        count += 1
    return count


@njit(error_model="numpy")
def motions(
    members: Any,
    source: Any,
    source_normals: Any,
    target: Any,
    target_normals: Any,
    tolerance: float,
) -> Any:
    """Motion (S, 4, 4) of each group, refined twice with all matches that it explains; count."""
    poses = np.zeros((len(members), 4, 4))
    worth = np.zeros(len(members))
    rows = np.empty(len(source), np.int64)
    weight = np.ones(len(source))
    for s in range(len(members)):
        count = 0
        while count < members.shape[1] and members[s, count] >= 0:
            rows[count] = members[s, count]
            weight[count] = 1.0
            count += 1
        if count < 3:
            poses[s] = np.eye(4)
            continue
        motion(source, target, weight, rows, count, poses[s])
        for _ in range(2):
            count = inliers(
                poses[s], source, source_normals, target, target_normals, tolerance, rows, weight
            )
            if count < 3:
                break
            motion(source, target, weight, rows, count, poses[s])
        worth[s] = count
    return poses, worth


@njit(error_model="numpy")
def explained(
    poses: Any,
    source: Any,
    source_normals: Any,
    target: Any,
    target_normals: Any,
    tolerance: float,
) -> Any:
    """How many matches each pose (K, 4, 4) explains, (K,)."""
    out = np.zeros(len(poses))
    rows, weight = np.empty(len(source), np.int64), np.empty(len(source))
    for k in range(len(poses)):
        out[k] = inliers(
            poses[k], source, source_normals, target, target_normals, tolerance, rows, weight
        )
    return out
