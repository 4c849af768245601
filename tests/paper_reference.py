"""The paper's formulas, word for word, in plain NumPy: slow, obvious, and apart from the package.

Stechschulte and Heckman (2017), Methodology and Algorithm 1. Where the text
needs reading:

- sigma is a standard deviation: the printed M-step lacks the square root;
- an unobserved pixel adds 0 to its neighbours' sums and nothing to the M-step;
- a component without weight keeps its parameters (at first: those of all
  distances), and a sigma is at least 1e-6 of the largest distance;
- EM stops when every sign is that of one or of two steps before.

The motion is found with quaternions (Horn 1987) where the package takes a
singular value decomposition, and neighbours by comparing every pair.
"""

from __future__ import annotations

import numpy as np

# Distances -------------------------------------------------------------------------------------


def closest(moved, target):
    """I_i and Y_i: the closest target point of every source point, and how far it is."""
    index = np.empty(len(moved), dtype=int)
    distance = np.empty(len(moved))
    for i, b in enumerate(moved):
        all_distances = np.linalg.norm(b - target, axis=1)
        index[i] = np.argmin(all_distances)
        distance[i] = all_distances[index[i]]
    return index, distance


# The field -------------------------------------------------------------------------------------


def neighbour_sum(z):
    """Sum of z over the pixels above, below, left and right, (H, W); NaN counts as nothing."""
    total = np.zeros(z.shape)
    known = np.where(np.isnan(z), 0.0, z)
    total[1:, :] += known[:-1, :]
    total[:-1, :] += known[1:, :]
    total[:, 1:] += known[:, :-1]
    total[:, :-1] += known[:, 1:]
    return total


def initial_field(y, outliers):
    """+1, and -1 for the points with the greatest distances."""
    limit = np.percentile(y[~np.isnan(y)], 100 * (1 - outliers))
    return np.where(np.isnan(y), np.nan, np.where(y > limit, -1.0, 1.0))


def m_step(y, z, before=None):
    """Theta = (mu_in, sigma_in, mu_out, sigma_out) from distances and expected labels (H, W)."""
    seen = ~np.isnan(y)
    y, z = y[seen], z[seen]
    floor = max(1e-6 * y.max(), 1e-15)
    theta = []
    for sign in (+1, -1):
        p = (1 + sign * z) / 2
        if p.sum() > 0:
            mu = np.sum(p * y) / np.sum(p)
            sigma = np.sqrt(np.sum(p * (y - mu) ** 2) / np.sum(p))
        elif before is None:
            mu, sigma = y.mean(), y.std()
        else:
            mu, sigma = before[:2] if sign > 0 else before[2:]
        theta += [mu, max(sigma, floor)]
    return tuple(theta)


def e_step(y, z, theta, beta):
    """The new field: the fraction printed in the paper, numerator and denominator."""
    mu_in, sigma_in, mu_out, sigma_out = theta
    s = neighbour_sum(z)
    exponent = {
        +1: +beta * s - np.log(sigma_in) - 0.5 * sigma_in**-2 * (y - mu_in) ** 2,
        -1: -beta * s - np.log(sigma_out) - 0.5 * sigma_out**-2 * (y - mu_out) ** 2,
    }
    largest = np.maximum(exponent[+1], exponent[-1])  # cancels; keeps exp() from overflowing
    weight = {sign: np.exp(exponent[sign] - largest) for sign in (+1, -1)}
    return (weight[+1] - weight[-1]) / (weight[+1] + weight[-1])


def em(y, z, beta, most_steps):
    """Run EM on (H, W) grids; the field, the steps, and the theta of the last E-step."""
    fields = [z]
    theta = None
    steps = 0
    while steps < most_steps:
        steps += 1
        theta = m_step(y, fields[-1], theta)
        fields.append(e_step(y, fields[-1], theta, beta))
        signs = [f[~np.isnan(y)] > 0 for f in fields[-3:]]
        if any(np.array_equal(signs[-1], earlier) for earlier in signs[:-1]):
            break
    return fields[-1], steps, theta if theta is not None else m_step(y, z)


# The rules that the paper compares with ----------------------------------------------------------


def keep_all(y, threshold, scale):
    return np.inf


def keep_percent(y, threshold, scale):
    return np.percentile(y, 90)


def keep_sigma(y, threshold, scale):
    return y.mean() + 2.5 * y.std()


def keep_x84(y, threshold, scale):
    median = np.median(y)
    return median + 5.2 * np.median(np.abs(y - median))


def keep_dynamic(y, threshold, scale):
    """Zhang 1994: the next threshold from the distances that the last one kept."""
    if threshold is None:
        return 20 * scale
    kept = y[y <= threshold]
    if len(kept) == 0:
        kept = y
    mu, s = kept.mean(), kept.std()
    if mu < scale:
        return mu + 3 * s
    if mu < 3 * scale:
        return mu + 2 * s
    if mu < 6 * scale:
        return mu + s
    bins = max(10, int(np.ceil(np.log2(len(y)))) + 1)
    count, edge = np.histogram(y, bins)
    for i in range(np.argmax(count) + 1, bins - 1):
        if count[i] <= count[i - 1] and count[i] < count[i + 1]:
            return (edge[i] + edge[i + 1]) / 2
    return edge[-1]


RULES = {
    "all": keep_all,
    "percent": keep_percent,
    "sigma": keep_sigma,
    "x84": keep_x84,
    "dynamic": keep_dynamic,
}


def mean_spacing(target):
    """D: the mean distance of the target's points to their closest other one."""
    nearest = []
    for i, c in enumerate(target):
        distance = np.linalg.norm(c - target, axis=1)
        distance[i] = np.inf
        nearest.append(distance.min())
    return np.mean(nearest)


# The motion --------------------------------------------------------------------------------------


def best_motion(points, onto):
    """The (4, 4) rigid motion of least squares, by Horn's unit quaternion: a rotation always."""
    a, b = points - points.mean(axis=0), onto - onto.mean(axis=0)
    m = a.T @ b
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = m
    n = np.array(
        [
            [xx + yy + zz, yz - zy, zx - xz, xy - yx],
            [yz - zy, xx - yy - zz, xy + yx, zx + xz],
            [zx - xz, xy + yx, -xx + yy - zz, yz + zy],
            [xy - yx, zx + xz, yz + zy, -xx - yy + zz],
        ]
    )
    w, x, y, z = np.linalg.eigh(n)[1][:, -1]
    pose = np.eye(4)
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    pose[:3, 3] = onto.mean(axis=0) - pose[:3, :3] @ points.mean(axis=0)
    return pose


def is_small(step, translation, rotation):
    """The paper's thresholds on T_step, metres and radians."""
    cosine = np.clip((np.trace(step[:3, :3]) - 1) / 2, -1, 1)
    return np.linalg.norm(step[:3, 3]) < translation and np.arccos(cosine) < rotation


# Algorithm 1 -------------------------------------------------------------------------------------


def register(
    source,
    target,
    init=None,
    rule="hmrf",
    beta=2.0,
    outliers=0.1,
    first_steps=600,
    steps=20,
    translation=0.01,
    rotation=0.001,
    max_iterations=50,
):
    """Register an organised source (H, W, 3) to points (N, 3).

    Returns the motion, the field (H, W), whether it converged, the number of
    ICP iterations and of EM steps.
    """
    grid = source.shape[:2]
    seen = ~np.isnan(source).any(axis=2)
    moved = source[seen]
    pose = np.eye(4) if init is None else init

    def on_grid(y):
        laid = np.full(grid, np.nan)
        laid[seen] = y
        return laid

    def move(by, points):
        return (by @ np.c_[points, np.ones(len(points))].T).T[:, :3]

    moved = move(pose, moved)
    index, y = closest(moved, target)
    em_steps = 0
    scale = mean_spacing(target) if rule == "dynamic" else None
    threshold = None
    if rule == "hmrf":
        z, em_steps, _ = em(on_grid(y), initial_field(on_grid(y), outliers), beta, first_steps)
    else:
        threshold = RULES[rule](y, None, scale)
        z = on_grid(np.where(y <= threshold, 1.0, -1.0))

    iterations = 0
    converged = False
    while not converged and iterations < max_iterations:
        iterations += 1
        if rule == "hmrf":
            z, took, _ = em(on_grid(y), z, beta, steps)
            em_steps += took
        else:
            threshold = RULES[rule](y, threshold, scale)
            z = on_grid(np.where(y <= threshold, 1.0, -1.0))
        inlier = z[seen] > 0
        step = best_motion(moved[inlier], target[index[inlier]])
        pose = step @ pose
        moved = move(step, moved)
        index, y = closest(moved, target)
        converged = is_small(step, translation, rotation)
    return pose, z, converged, iterations, em_steps
