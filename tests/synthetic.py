"""Small clouds for the tests: a wavy surface seen from two places, with holes."""

from __future__ import annotations

import numpy as np

from hmrf_icp import se3

TRUTH = se3.rigid(se3.rotation_exp([0.03, -0.05, 0.04]), [0.06, -0.04, 0.05])


def surface(x, y):
    """A hilly surface, 2 m by 2 m, with nothing symmetric about it; metres."""
    z = 1.5 + 0.16 * np.sin(3.1 * x + 0.4) * np.cos(2.3 * y - 0.3) + 0.1 * x * y
    z = z + 0.25 * np.exp(-12 * ((x - 0.35) ** 2 + (y + 0.25) ** 2))
    return np.stack([x, y, z], axis=-1)


def patch(height, width, left, right, rng, noise=0.002, holes=0.0):
    """A grid of points (H, W, 3) over x from left to right, NaN in the holes."""
    x, y = np.meshgrid(np.linspace(left, right, width), np.linspace(-0.8, 0.8, height))
    x = x + rng.uniform(-0.2, 0.2, x.shape) * (right - left) / width
    y = y + rng.uniform(-0.2, 0.2, y.shape) * 1.6 / height
    points = surface(x, y) + rng.normal(0, noise, (height, width, 3))
    if holes:
        points[rng.random((height, width)) < holes] = np.nan
        points[: height // 4, width // 2 : width // 2 + 3] = np.nan  # and one in a piece
    return points


def pair(seed=0, height=14, width=18, holes=0.15, overlap=0.6):
    """A source that ``TRUTH`` takes onto the target's surface; the share of it that has a match."""
    rng = np.random.default_rng(seed)
    across = 1.4
    shift = (1 - overlap) * across
    source = patch(height, width, -1.0 + shift, -1.0 + shift + across, rng, holes=holes)
    target = patch(5 * height // 4, 5 * width // 4, -1.0, -1.0 + across, rng, holes=holes)
    return se3.transform(se3.inverse(TRUTH), source), target
