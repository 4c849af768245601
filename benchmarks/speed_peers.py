"""How the peers of `speed.py` are called: from points in memory, all preparation included."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np

from hmrf_icp import se3
from speed_measure import Left


def need(*libraries: str) -> None:
    """Leave a row out whose peer is not installed."""
    for library in libraries:
        if find_spec(library) is None:
            raise Left(f"{library} is not installed; pip install '.[peers]'")


def gicp(
    source: np.ndarray,
    target: np.ndarray,
    init: np.ndarray,
    voxel: float,
    reach: float,
    threads: int,
) -> np.ndarray:
    """Run small_gicp's GICP on voxels, metres; matches up to ``reach`` away."""
    import small_gicp

    (onto, tree), (free, _) = (
        small_gicp.preprocess_points(points, downsampling_resolution=voxel, num_threads=threads)
        for points in (target, source)
    )
    result = small_gicp.align(
        onto,
        free,
        tree,
        init,
        registration_type="GICP",
        max_correspondence_distance=reach,
        num_threads=threads,
    )
    return np.array(result.T_target_source)


def kiss_gicp(source: np.ndarray, target: np.ndarray, voxel: float, threads: int) -> np.ndarray:
    """Match with KISS-Matcher on voxels, metres; refine on all points with GICP."""
    import kiss_matcher
    import small_gicp

    matcher = kiss_matcher.KISSMatcher(kiss_matcher.KISSMatcherConfig(voxel_size=voxel))
    found = matcher.estimate(list(source.astype(np.float32)), list(target.astype(np.float32)))
    rotation = se3.nearest_rotation(np.asarray(found.rotation, dtype=float))
    clouds = [small_gicp.PointCloud(points) for points in (target, source)]
    trees = [small_gicp.KdTree(cloud, num_threads=threads) for cloud in clouds]
    for cloud, tree in zip(clouds, trees, strict=True):
        small_gicp.estimate_covariances(cloud, tree, num_neighbors=20, num_threads=threads)
    result = small_gicp.align(
        *clouds,
        trees[0],
        se3.rigid(rotation, found.translation),
        registration_type="GICP",
        max_correspondence_distance=2 * voxel,
        max_iterations=50,
        num_threads=threads,
    )
    return np.array(result.T_target_source)


def open3d_point_to_point(
    source: np.ndarray, target: np.ndarray, init: np.ndarray, reach: float, iterations: int
) -> np.ndarray:
    """Run exactly so many iterations of Open3D's point-to-point ICP."""
    from open3d import geometry, pipelines, utility

    clouds = [
        geometry.PointCloud(utility.Vector3dVector(points.copy())) for points in (source, target)
    ]
    registration = pipelines.registration
    result = registration.registration_icp(
        *clouds,
        reach,
        init,
        registration.TransformationEstimationPointToPoint(),
        registration.ICPConvergenceCriteria(0.0, 0.0, iterations),
    )
    return np.array(result.transformation)
