"""How each peer is called: same points, same start, one thread.

What a peer derives from one cloud (k-d tree, normals, covariances) is kept with the cloud
(:class:`Prepared`); nobody's settings were tuned beyond what stands here.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3
from hmrf_icp.evaluate.methods import Estimate
from hmrf_icp.evaluate.prepared import Prepared

Array = NDArray[np.float64]

MAX_ITERATIONS = 50
"""As many as the paper gives its own; the libraries' defaults are 20 and 30."""

RANSAC_ITERATIONS = 100_000

NEIGHBOURS = 20
"""Points that a normal or a covariance is estimated from."""


def size(cloud: Prepared) -> float:
    """Root mean square distance of the points from their centroid."""

    def measure() -> float:
        return float(np.sqrt(((cloud.points - cloud.centroid) ** 2).sum(axis=1).mean()))

    return cloud.derived("size", measure)


class NoAnswerError(Exception):
    """A peer says that it has no answer."""


# --- Open3D -----------------------------------------------------------------------------------


def open3d_cloud(cloud: Prepared) -> Any:
    """Return the points as Open3D's cloud, with normals."""

    def build() -> Any:
        import open3d as o3d

        made = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.array(cloud.points)))
        made.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(NEIGHBOURS))
        return made

    return cloud.derived("open3d", build)


def open3d(source: Prepared, target: Prepared, init: Array, reach: float, metric: str) -> Estimate:
    """Run Open3D's ICP, point-to-point, point-to-plane or that with a Tukey kernel."""
    import open3d as o3d

    pipeline: Any = o3d.pipelines.registration
    estimation = {
        "point": lambda: pipeline.TransformationEstimationPointToPoint(),
        "plane": lambda: pipeline.TransformationEstimationPointToPlane(),
        # The kernel is the threshold; matches up to three times as far may pull until it cuts in.
        "tukey": lambda: pipeline.TransformationEstimationPointToPlane(pipeline.TukeyLoss(k=reach)),
    }[metric]()
    furthest = 3.0 * reach if metric == "tukey" else reach
    return _align(open3d_cloud(source), open3d_cloud(target), init, furthest, estimation)


def open3d_multiscale(source: Prepared, target: Prepared, init: Array, reach: float) -> Estimate:
    """Go from voxels of the threshold and four times its reach to all points and its own.

    Scale by scale with the same function as the others: Open3D's own
    ``multi_scale_icp`` gathers every point within its distance, and takes two
    minutes of one core for a pair of 19,200 points at 0.8 m.
    """
    import open3d as o3d

    pipeline: Any = o3d.pipelines.registration
    outcome = Estimate(init)
    for voxel, furthest in ((reach, 4 * reach), (reach / 2, 2 * reach), (0.0, reach)):
        outcome = _align(
            _open3d_thinned(source, voxel),
            _open3d_thinned(target, voxel),
            outcome.transformation,
            furthest,
            pipeline.TransformationEstimationPointToPlane(),
        )
    return outcome


def _open3d_thinned(cloud: Prepared, voxel: float) -> Any:
    whole = open3d_cloud(cloud)
    if voxel == 0.0:
        return whole
    return cloud.derived(("open3d", voxel), lambda: whole.voxel_down_sample(voxel))


def _align(source: Any, target: Any, init: Array, furthest: float, estimation: Any) -> Estimate:
    import open3d as o3d

    pipeline: Any = o3d.pipelines.registration
    # It complains on stdout of clouds without a match, which is an answer here like any other.
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        result = pipeline.registration_icp(
            source,
            target,
            furthest,
            init,
            estimation,
            pipeline.ICPConvergenceCriteria(max_iteration=MAX_ITERATIONS),
        )
    return Estimate(np.array(result.transformation), fitness=float(result.fitness))


# --- small_gicp -------------------------------------------------------------------------------


def _gicp_cloud(cloud: Prepared) -> tuple[Any, Any]:
    def build() -> tuple[Any, Any]:
        import small_gicp

        made = small_gicp.PointCloud(cloud.points)
        tree = small_gicp.KdTree(made, num_threads=1)
        small_gicp.estimate_covariances(made, tree, num_neighbors=NEIGHBOURS, num_threads=1)
        return made, tree

    return cloud.derived("small_gicp", build)


def gicp(source: Prepared, target: Prepared, init: Array, reaches: Iterable[float]) -> Estimate:
    """Run small_gicp's GICP at each distance in turn, one starting where the last ended."""
    import small_gicp

    source_cloud, _ = _gicp_cloud(source)
    target_cloud, target_tree = _gicp_cloud(target)
    pose, iterations = init, 0
    for reach in reaches:
        result = small_gicp.align(
            target_cloud,
            source_cloud,
            target_tree,
            pose,
            registration_type="GICP",
            max_correspondence_distance=reach,
            max_iterations=MAX_ITERATIONS,
            num_threads=1,
        )
        pose = np.array(result.T_target_source)
        # It counts from zero: an alignment that stops after its first step reports 0.
        iterations += int(result.iterations) + 1
    return Estimate(
        pose,
        iterations=iterations,
        converged=bool(result.converged),
        fitness=float(result.num_inliers) / len(source.points),
    )


# --- Fast and Robust ICP ----------------------------------------------------------------------


def fricp(source: Prepared, target: Prepared, init: Array, metric: str) -> Estimate:
    """Run it as its package is set, which is for partial overlap.

    Its authors' own settings (a first scale three times the median residual)
    solved a third less on the rendered kitchen.
    """
    import fricp_cpp

    def build() -> Any:
        if metric == "point_to_point":
            return fricp_cpp.Target(target.points)
        return fricp_cpp.Target(target.points, np.asarray(open3d_cloud(target).normals))

    result = fricp_cpp.registration_icp(
        source.points,
        target.derived(("fricp", metric), build),
        init=init,
        estimation_method=metric,
        num_threads=1,
    )
    return Estimate(
        np.array(result.transformation),
        iterations=int(result.robust_info["num_iterations"]),
        fitness=float(result.fitness),
    )


# --- FPFH and RANSAC --------------------------------------------------------------------------


def features(cloud: Prepared, voxel: float) -> tuple[Any, Any]:
    """Return the cloud thinned to voxels, and their FPFH."""

    def build() -> tuple[Any, Any]:
        import open3d as o3d

        made = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.array(cloud.points)))
        made = made.voxel_down_sample(voxel)
        near, around = (
            o3d.geometry.KDTreeSearchParamHybrid(radius=radius * voxel, max_nn=count)
            for radius, count in ((2, 30), (5, 100))
        )
        made.estimate_normals(near)
        pipeline: Any = o3d.pipelines.registration
        return made, pipeline.compute_fpfh_feature(made, around)

    return cloud.derived(("fpfh", voxel), build)


def fpfh(source: Prepared, target: Prepared, reach: float, refined: bool) -> Estimate:
    """Match FPFH on voxels of half the threshold by RANSAC, as Open3D's tutorial does."""
    import open3d as o3d

    pipeline: Any = o3d.pipelines.registration
    voxel = reach / 2

    def match() -> Estimate:
        (moving, theirs), (fixed, ours) = features(source, voxel), features(target, voxel)
        o3d.utility.random.seed(0)
        found = pipeline.registration_ransac_based_on_feature_matching(
            moving,
            fixed,
            theirs,
            ours,
            True,
            1.5 * voxel,
            pipeline.TransformationEstimationPointToPoint(False),
            3,
            [
                pipeline.CorrespondenceCheckerBasedOnEdgeLength(0.9),
                pipeline.CorrespondenceCheckerBasedOnDistance(1.5 * voxel),
            ],
            pipeline.RANSACConvergenceCriteria(RANSAC_ITERATIONS, 0.999),
        )
        return Estimate(np.array(found.transformation), fitness=float(found.fitness))

    # As below: the same from every start, and the matches are those that are refined.
    outcome = source.derived(("fpfh", target.name, reach), match)
    return gicp(source, target, outcome.transformation, (reach,)) if refined else outcome


# --- KISS-Matcher -----------------------------------------------------------------------------


def kiss_gicp(source: Prepared, target: Prepared, reach: float) -> Estimate:
    """Match descriptors on voxels of half the threshold, then refine; the start is not used."""

    def both() -> Estimate | None:
        import kiss_matcher

        matcher = kiss_matcher.KISSMatcher(kiss_matcher.KISSMatcherConfig(voxel_size=reach / 2))
        found = matcher.estimate(
            list(source.points.astype(np.float32)), list(target.points.astype(np.float32))
        )
        if not found.valid:
            return None
        rotation = se3.nearest_rotation(np.asarray(found.rotation, dtype=np.float64))
        return gicp(source, target, se3.rigid(rotation, found.translation), (reach,))

    # The answer is the same from every start of a pair: worked out once, charged to each.
    outcome = source.derived(("kiss", target.name, reach), both)
    if outcome is None:
        raise NoAnswerError("KISS-Matcher found no consistent matches")
    return outcome
