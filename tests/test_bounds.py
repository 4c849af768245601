"""Compiled loops under bounds checking: ``NUMBA_BOUNDSCHECK=1 pytest tests/test_bounds.py``.

Numba compiles them anew for it, which takes minutes, so it is a step of its own, with a folder
of its own for what is compiled (``NUMBA_CACHE_DIR``): loops compiled without the check would be
taken for these. A row that does not exist is then an IndexError, and no memory of others.
"""

from __future__ import annotations

import os
import warnings

import numpy as np
import pytest

import hmrf_icp
import synthetic
from hmrf_icp import PinholeCamera, PointCloud, presets
from test_fuzz_registrations import fuzz  # noqa: F401  (a fixture)

pytestmark = pytest.mark.skipif(
    os.environ.get("NUMBA_BOUNDSCHECK") != "1", reason="needs NUMBA_BOUNDSCHECK=1"
)


@pytest.fixture(autouse=True)
def without_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", hmrf_icp.RegistrationWarning)
        yield


def test_the_check_is_on():
    from hmrf_icp.field.graph import nearest_graph
    from hmrf_icp.kernels.mean_field import graph_sums

    graph = nearest_graph(np.random.default_rng(0).normal(size=(30, 3)))
    with pytest.raises(IndexError):
        graph_sums(graph.indptr, graph.indices, graph.weights, np.ones(3))


@pytest.mark.parametrize("first", [0, 25, 50, 75])
def test_random_geometry(fuzz, first):  # noqa: F811
    for number in range(first, first + 25):
        found = fuzz.tried(9, number)
        assert found["found"] in (*fuzz.FINE, "slow"), found


@pytest.mark.parametrize("aligner", presets.aligner_names())
@pytest.mark.parametrize("rejector", presets.rejector_names())
def test_every_part(rejector, aligner):
    source, target = (
        PointCloud(points, attributes={"intensity": points[..., 0]}) for points in synthetic.pair()
    )
    hmrf_icp.register(source, target, preset="paper", rejector=rejector, aligner=aligner)


@pytest.mark.parametrize("update", ["simultaneous", "sequential"])
@pytest.mark.parametrize("neighbours", ["grid", "nearest", "ring"])
def test_every_field(neighbours, update):
    field = hmrf_icp.MarkovField(neighbours=neighbours, update=update, beta="estimate")
    hmrf_icp.register(*synthetic.pair(), preset="paper", rejector=field)


def test_the_search_with_and_without_a_start_and_a_viewpoint():
    source, target = synthetic.pair(height=28, width=36)
    place = (0.0, 0.0, 0.0)
    for viewpoint in (None, place):
        clouds = [PointCloud(points, viewpoint=viewpoint) for points in (source, target)]
        for start in (None, np.eye(4)):
            hmrf_icp.register(*clouds, start)
    flat = [points.reshape(-1, 3) for points in (source, target)]
    hmrf_icp.register(*(PointCloud(points, viewpoint=place) for points in flat))


def test_clouds_that_are_thinned_and_cameras():
    rng = np.random.default_rng(0)
    points = rng.uniform(size=(45_000, 3)) * (1.0, 1.0, 0.1)
    hmrf_icp.register(points, points[::-1] + 0.01, np.eye(4))
    camera = PinholeCamera(200, 150, 180.0, 180.0, 99.5, 74.5)
    depth = 2.0 + 0.1 * np.cos(np.arange(200) / 9)[None] * np.sin(np.arange(150) / 7)[:, None]
    cloud = PointCloud.from_depth(depth, camera)
    hmrf_icp.register(cloud, cloud, np.eye(4))
    hmrf_icp.register(
        cloud.subsample(2),
        cloud.subsample(2),
        preset="paper",
        rejector=hmrf_icp.HiddenMarkovRandomField(precision="single"),
    )
