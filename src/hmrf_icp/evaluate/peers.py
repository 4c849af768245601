"""Today's alternatives, each as a :class:`NamedMethod`: same points, same start, one thread.

A library that is not installed is left out with a sentence saying so. What a
peer derives from one cloud (k-d tree, normals, covariances) is kept with the
cloud (:class:`Prepared`); nobody's settings were tuned beyond what stands here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3
from hmrf_icp.errors import InputError
from hmrf_icp.evaluate.methods import Estimate, NamedMethod
from hmrf_icp.evaluate.prepared import Prepared

Array = NDArray[np.float64]
Register: TypeAlias = Callable[[Prepared, Prepared, "Array | None"], Estimate]

THRESHOLDS = (0.05, 0.1, 0.2, 0.4, 0.8)
"""Distances in metres that a peer which wants one is run at, each as a method of its own."""

VOXELS_MATCHED = (0.1, 0.2)
"""Those of them for FPFH with RANSAC, which takes seconds on the voxels of a smaller one."""

SHARE = 8
"""In percent of the clouds' size, where these are not in metres.

For methods that thin clouds these are voxels of 4 %: of a fragment of a room 0.05 m, which is what
benchmarks of fragments are usually run with.
"""

MAX_ITERATIONS = 50
"""As many as the paper gives its own; the libraries' defaults are 20 and 30."""

RANSAC_ITERATIONS = 100_000

NEIGHBOURS = 20
"""Points that a normal or a covariance is estimated from."""


@dataclass(frozen=True)
class Family:
    """A peer before its threshold is chosen.

    Parameters
    ----------
    name, libraries
        Its name in results, and the modules that it needs.
    build
        Makes the method for a threshold in metres (0 where it wants none).
    thresholds
        Empty where it wants none.
    """

    name: str
    libraries: tuple[str, ...]
    build: Callable[[float], Register]
    thresholds: tuple[float, ...] = THRESHOLDS

    def shares(self) -> tuple[NamedMethod, ...]:
        """Return the method at a share of the clouds' size, in place of metres."""
        if not self.thresholds:
            return self.methods()

        def register(source: Prepared, target: Prepared, init: Array | None) -> Estimate:
            reach = SHARE / 100 * 0.5 * (size(source) + size(target))
            return self.build(reach)(source, target, init)

        return (NamedMethod(f"{self.name}@{SHARE}%", register),)

    @property
    def missing(self) -> tuple[str, ...]:
        """What it needs and is not installed."""
        return tuple(library for library in self.libraries if find_spec(library) is None)

    def methods(self) -> tuple[NamedMethod, ...]:
        """Return one method a threshold."""
        if not self.thresholds:
            return (NamedMethod(self.name, self.build(0.0)),)
        return tuple(
            NamedMethod(f"{self.name}@{metres:g}", self.build(metres)) for metres in self.thresholds
        )


def size(cloud: Prepared) -> float:
    """Root mean square distance of the points from their centroid."""

    def measure() -> float:
        return float(np.sqrt(((cloud.points - cloud.centroid) ** 2).sum(axis=1).mean()))

    return cloud.derived("size", measure)


class NoAnswerError(Exception):
    """A peer says that it has no answer."""


# --- Open3D -----------------------------------------------------------------------------------


def _open3d_cloud(cloud: Prepared) -> Any:
    def build() -> Any:
        import open3d as o3d

        made = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(cloud.points))
        made.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(NEIGHBOURS))
        return made

    return cloud.derived("open3d", build)


def _open3d(source: Prepared, target: Prepared, init: Array, reach: float, metric: str) -> Estimate:
    import open3d as o3d

    pipeline: Any = o3d.pipelines.registration
    estimation = {
        "point": lambda: pipeline.TransformationEstimationPointToPoint(),
        "plane": lambda: pipeline.TransformationEstimationPointToPlane(),
        # The kernel is the threshold; matches up to three times as far may pull until it cuts in.
        "tukey": lambda: pipeline.TransformationEstimationPointToPlane(pipeline.TukeyLoss(k=reach)),
    }[metric]()
    furthest = 3.0 * reach if metric == "tukey" else reach
    return _align(_open3d_cloud(source), _open3d_cloud(target), init, furthest, estimation)


def _open3d_multiscale(source: Prepared, target: Prepared, init: Array, reach: float) -> Estimate:
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
    whole = _open3d_cloud(cloud)
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


def _fricp(source: Prepared, target: Prepared, init: Array, metric: str) -> Estimate:
    """Run it as its package is set, which is for partial overlap.

    Its authors' own settings (a first scale three times the median residual)
    solved a third less on the rendered kitchen.
    """
    import fricp_cpp

    def build() -> Any:
        if metric == "point_to_point":
            return fricp_cpp.Target(target.points)
        return fricp_cpp.Target(target.points, np.asarray(_open3d_cloud(target).normals))

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


def _features(cloud: Prepared, voxel: float) -> tuple[Any, Any]:
    def build() -> tuple[Any, Any]:
        import open3d as o3d

        made = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(cloud.points))
        made = made.voxel_down_sample(voxel)
        near, around = (
            o3d.geometry.KDTreeSearchParamHybrid(radius=radius * voxel, max_nn=count)
            for radius, count in ((2, 30), (5, 100))
        )
        made.estimate_normals(near)
        pipeline: Any = o3d.pipelines.registration
        return made, pipeline.compute_fpfh_feature(made, around)

    return cloud.derived(("fpfh", voxel), build)


def _fpfh(source: Prepared, target: Prepared, reach: float, refined: bool) -> Estimate:
    """Match FPFH on voxels of half the threshold by RANSAC, as Open3D's tutorial does."""
    import open3d as o3d

    pipeline: Any = o3d.pipelines.registration
    voxel = reach / 2

    def match() -> Estimate:
        (moving, theirs), (fixed, ours) = _features(source, voxel), _features(target, voxel)
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


def _kiss_gicp(source: Prepared, target: Prepared, reach: float) -> Estimate:
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


FAMILIES = (
    Family("o3d-point", ("open3d",), lambda reach: _bind(_open3d, reach, "point")),
    Family("o3d-plane", ("open3d",), lambda reach: _bind(_open3d, reach, "plane")),
    Family("o3d-tukey", ("open3d",), lambda reach: _bind(_open3d, reach, "tukey")),
    Family("o3d-multiscale", ("open3d",), lambda reach: _bind(_open3d_multiscale, reach)),
    Family("gicp", ("small_gicp",), lambda reach: _bind(gicp, (reach,))),
    Family("gicp-chain", ("small_gicp",), lambda _: _bind(gicp, THRESHOLDS[::-1]), ()),
    Family("fricp", ("fricp_cpp",), lambda _: _bind(_fricp, "point_to_point"), ()),
    Family("fricp-plane", ("fricp_cpp", "open3d"), lambda _: _bind(_fricp, "point_to_plane"), ()),
    Family("kiss-gicp", ("kiss_matcher", "small_gicp"), lambda reach: _kiss(reach)),
    Family("fpfh", ("open3d",), lambda reach: _fpfh_of(reach, False), VOXELS_MATCHED),
    Family(
        "fpfh-gicp",
        ("open3d", "small_gicp"),
        lambda reach: _fpfh_of(reach, True),
        VOXELS_MATCHED,
    ),
)

FOR_PAIRS = ("gicp", "kiss-gicp", "fpfh", "fpfh-gicp")
"""Families that are compared on lists of pairs, where nobody chose."""

FOR_PAIRS_METRES = tuple(f"{name}@0.1" for name in FOR_PAIRS)
"""The same on fragments in metres, at the benchmarks' usual voxels of 0.05 m."""


def _bind(function: Callable[..., Estimate], *settings: Any) -> Register:
    def register(source: Prepared, target: Prepared, init: Array | None) -> Estimate:
        # What is local has to begin somewhere: with the frames as they are.
        return function(source, target, np.eye(4) if init is None else init, *settings)

    return register


def _kiss(reach: float) -> Register:
    def register(source: Prepared, target: Prepared, init: Array | None) -> Estimate:  # noqa: ARG001
        return _kiss_gicp(source, target, reach)

    return register


def _fpfh_of(reach: float, refined: bool) -> Register:
    def register(source: Prepared, target: Prepared, init: Array | None) -> Estimate:  # noqa: ARG001
        return _fpfh(source, target, reach, refined)

    return register


START_FREE = ("kiss-gicp", "fpfh", "fpfh-gicp")
"""Families that do not look at the start."""


def catalogue() -> dict[str, NamedMethod]:
    """Return every peer at every threshold by name, installed or not."""
    return {
        method.name: method
        for family in FAMILIES
        for method in (*family.methods(), *family.shares())
    }


@dataclass(frozen=True)
class Choice:
    """The peers to run, and a sentence for each that is not installed."""

    methods: tuple[NamedMethod, ...]
    skipped: tuple[str, ...]


def choose(names: Iterable[str] | None, metres: bool = True) -> Choice:
    """Find peers by name.

    Parameters
    ----------
    names
        A family (``gicp``: at every threshold) or one setting (``gicp@0.1``, ``gicp@8%``);
        None means all.
    metres
        Whether the clouds are in metres; a family's thresholds are shares of their size if not.

    Raises
    ------
    InputError
        An unknown name; the message lists the known ones.
    """
    families = {family.name: family for family in FAMILIES}
    wanted = set(families) if names is None else set(names)
    unknown = sorted(wanted - set(families) - set(catalogue()))
    if unknown:
        raise InputError(
            f"peers: no peer is called {', '.join(unknown)}; known are {', '.join(families)}, "
            f"and one threshold of those that want one, as in gicp@{THRESHOLDS[0]:g}"
        )
    chosen: list[NamedMethod] = []
    skipped = []
    for family in FAMILIES:
        usual = family.methods() if metres else family.shares()
        every = {m.name: m for m in (*family.methods(), *family.shares())}
        mine = [
            m
            for m in every.values()
            if m.name in wanted or (family.name in wanted and m.name in {u.name for u in usual})
        ]
        if mine and family.missing:
            skipped.append(
                f"{family.name}: skipped, {' and '.join(family.missing)} not installed "
                "(pip install 'hmrf-icp[peers]')"
            )
        elif mine:
            chosen.extend(mine)
    return Choice(tuple(chosen), tuple(skipped))
