"""Clouds with next to nothing to register by: a result, or an error that says what is missing."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import InputError, PinholeCamera, PointCloud, presets
from hmrf_icp.clouds.prepared import prepare

RNG = np.random.default_rng(11)
CAMERA = PinholeCamera(20, 16, 18.0, 18.0, 9.5, 7.5)


def sparse(share):
    depth = np.random.default_rng(2).uniform(2, 3, (16, 20))
    depth[np.random.default_rng(3).random(depth.shape) < share] = np.nan
    return PointCloud.from_depth(depth, CAMERA)


def rows():
    points = CAMERA.unproject(np.full((16, 20), 2.0))
    points[np.arange(16) % 4 != 1] = np.nan
    return PointCloud(points, CAMERA)


def unit(points):
    return points / np.linalg.norm(points, axis=1)[:, None]


LINES = np.concatenate([np.c_[np.arange(40.0), np.full((40, 2), 30.0 * k)] for k in range(3)])

CLOUDS = {
    "ten": RNG.uniform(size=(10, 3)),
    "thirteen": RNG.uniform(size=(13, 3)),
    "thirty": RNG.uniform(size=(30, 3)),
    "holes": sparse(0.94),
    "rows": rows(),
    "duplicates": np.repeat(RNG.normal(size=(12, 3)), 20, axis=0),
    "lines": LINES,
    "plane": RNG.uniform(size=(50, 3)) * (1, 1, 0),
    "lattice": np.stack(np.meshgrid(*[np.arange(4.0)] * 3), -1).reshape(-1, 3),
    "tiny": 1e-20 * RNG.normal(size=(40, 3)),
    "large": 1e9 * unit(RNG.normal(size=(40, 3))),
    "one far off": np.r_[RNG.normal(size=(40, 3)), [[1e4, 0.0, 0.0]]],
}
METHODS = [
    *({"preset": preset} for preset in presets.names()),
    *(
        {"preset": "paper", "rejector": rejector, "aligner": aligner}
        for rejector in presets.rejector_names()
        for aligner in presets.aligner_names()
    ),
    *(
        {"preset": "robust", "rejector": rejector, "aligner": aligner}
        for rejector, aligner in zip(
            presets.rejector_names(), presets.aligner_names() * 2, strict=False
        )
    ),
]
"""The search, which takes longer, with every rejector and every aligner, but not with all pairs."""


def painted(cloud):
    """The cloud with intensities, which one of the metrics needs."""
    cloud = cloud if isinstance(cloud, PointCloud) else PointCloud(cloud)
    value = np.random.default_rng(4).uniform(size=cloud.shape)
    return PointCloud(cloud.points, cloud.camera, attributes={"intensity": value})


def sound(result):
    numbers = [*result.transformation.ravel(), result.overlap, result.inlier_rmse]
    numbers += [result.confidence or 0.0]
    return bool(np.isfinite(numbers).all())


@pytest.mark.parametrize("name", CLOUDS)
def test_every_method_answers(name):
    cloud = CLOUDS[name]
    points = cloud.points if isinstance(cloud, PointCloud) else cloud
    size = np.nanmax(np.abs(points))
    source = prepare(painted(cloud))
    targets = [
        prepare(painted(cloud)),
        prepare(painted(points.reshape(-1, 3)[::-1] + 100.0 * size)),
    ]
    for i, method in enumerate(METHODS):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", hmrf_icp.RegistrationWarning)
            needs_pixels = method.get("rejector", method["preset"]) in ("hmrf", "paper")
            if needs_pixels and not source.cloud.organised:
                with pytest.raises(InputError, match="organised"):
                    hmrf_icp.register(source, targets[i % 2], **method)
                continue
            result = hmrf_icp.register(source, targets[i % 2], **method)
        assert sound(result), method


def test_nothing_to_go_by_is_not_believed():
    for name in ("lines", "plane"):
        for given in (CLOUDS[name], RNG.permutation(CLOUDS[name])):
            result = hmrf_icp.register(CLOUDS[name], given + np.array([0.3, 0.2, 0.0]))
            assert result.confidence < 0.5


@pytest.mark.parametrize(
    ("cloud", "missing"),
    [
        (RNG.normal(size=(9, 3)), "9 observed points of 9, expected at least 10"),
        (np.full((20, 3), np.nan), "0 observed points of 20"),
        (np.repeat(RNG.normal(size=(3, 3)), 20, axis=0), "60 points at 3 places"),
        (np.ones((20, 3)), "20 points are the same"),
        (np.arange(20.0)[:, None] * (1, 2, 3), "on one line"),
        (1e13 * RNG.normal(size=(20, 3)), "coordinate"),
        (1e-40 * RNG.normal(size=(20, 3)), "expected metres"),
    ],
)
@pytest.mark.parametrize("ready", [False, True])
def test_what_is_refused_says_what_is_missing(cloud, missing, ready):
    if ready:
        cloud = hmrf_icp.PreparedCloud(PointCloud(cloud))
    for pair in ((cloud, CLOUDS["thirty"]), (CLOUDS["thirty"], cloud)):
        with pytest.raises(InputError, match=missing):
            hmrf_icp.register(*pair)


@pytest.mark.parametrize("far", [1e13, 1e100, 1e300])
def test_a_start_beyond_all_measure_is_refused(far):
    start = np.eye(4)
    start[0, 3] = far
    with pytest.raises(InputError, match="init: a translation"):
        hmrf_icp.register(CLOUDS["thirty"], CLOUDS["thirty"], start)
