"""A spinning LiDAR in a corridor: what rings get wrong alike in both scans is no information."""

from __future__ import annotations

import numpy as np
import pytest

import hmrf_icp
import spinning
from hmrf_icp import PointCloud, prepare
from hmrf_icp.loop.match import NearestNeighbour
from hmrf_icp.loop.placed import Placed
from hmrf_icp.loop.reject import Labels
from hmrf_icp.loop.surface_metrics import Symmetric

PLACES = {"corridor": spinning.corridor, "tunnel": spinning.tunnel}


def step_at_truth(source, target, truth, near=0.1):
    """What the last stage makes of the true pose; matches count by their distance."""
    source, target = prepare(source).downsampled(20_000), prepare(target).downsampled(20_000)
    placed = Placed.at(truth, source.points)
    matches = NearestNeighbour().prepare(source, target)(placed)
    chance = np.exp(-0.5 * (matches.distance / near) ** 2)
    return Symmetric().prepare(source, target)(placed, matches, Labels(2.0 * chance - 1.0))


@pytest.mark.parametrize("organised", [True, False])
@pytest.mark.parametrize("tilts", [(0.0, 0.0), (8.0, 3.0)])
@pytest.mark.parametrize("noise", [0.0, 0.02])
@pytest.mark.parametrize("beams", [16, 32, 64])
@pytest.mark.parametrize("place", PLACES)
def test_no_ring_measures_the_length_of_a_corridor(place, beams, noise, tilts, organised):
    source, target, truth, axis = spinning.pair(PLACES[place], beams, noise, tilts, organised)
    step = step_at_truth(source, target, truth)
    along = [abs(twist[3:] @ axis) for twist in step.degenerate if np.linalg.norm(twist[:3]) < 0.9]
    assert max(along) > 0.95
    assert step.weakest < 0.65


@pytest.mark.parametrize(
    ("place", "beams", "tilts", "organised"),
    [
        ("corridor", 16, (0.0, 0.0), False),
        ("corridor", 64, (8.0, 3.0), False),
        ("corridor", 32, (8.0, 3.0), True),
        ("tunnel", 32, (0.0, 0.0), False),
    ],
)
def test_the_default_says_so(place, beams, tilts, organised):
    source, target, truth, axis = spinning.pair(PLACES[place], beams, 0.01, tilts, organised)
    result = hmrf_icp.register(source, target, truth)
    assert any(abs(m.direction @ axis) > 0.95 for m in result.degenerate if not m.rotation)
    assert result.confidence < 0.5


def test_an_end_of_the_corridor_is_found():
    def with_an_end(rays):
        return np.minimum(
            spinning.corridor(rays), np.where(rays[..., 0] > 0, 4.0, np.inf) / rays[..., 0]
        )

    source, target, truth, _ = spinning.pair(with_an_end, 32, 0.01, (8.0, 3.0))
    step = step_at_truth(source, target, truth)
    assert len(step.degenerate) == 0
    assert step.weakest > 2.0


def test_normals_reach_across_rings():
    cloud, _ = spinning.scan(spinning.corridor, 0, 16, 0.005)
    surface = prepare(cloud).surface
    walls = (np.abs(surface.points[:, 2]) < 0.5) & (np.abs(surface.points[:, 0]) < 3.0)
    assert (np.abs(surface.normals[walls, 1]) > 0.95).mean() > 0.95


def test_points_on_a_line_have_no_normal():
    # A ring round a room is a line that turns corners: it spans a plane, and is no surface.
    angle = np.linspace(0.0, 2.0 * np.pi, 4000, endpoint=False)
    corner = 1.0 / np.maximum(np.abs(np.cos(angle)), np.abs(np.sin(angle)))
    ring = np.stack([corner * np.cos(angle), corner * np.sin(angle), np.zeros(4000)], axis=1)
    surface = prepare(PointCloud(ring)).surface
    assert (surface.normals == 0.0).all(axis=1).mean() > 0.95
