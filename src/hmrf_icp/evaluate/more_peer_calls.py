"""How the peers are called that came later: colour, NDT, FGR, CPD; as :mod:`peer_calls` has it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.downsample import downsample
from hmrf_icp.clouds.shading import intensity
from hmrf_icp.errors import InputError
from hmrf_icp.evaluate import peer_calls
from hmrf_icp.evaluate.methods import Estimate
from hmrf_icp.evaluate.prepared import Prepared

Array = NDArray[np.float64]

CPD_POINTS = 1000
"""Of each cloud: every one is weighed against every other, in NumPy."""

CPD_OUTLIERS = 0.1
"""Share of outliers that it is told; with none, which is its default, it wants all to match."""


def coloured(source: Prepared, target: Prepared, init: Array, reach: float) -> Estimate:
    """Run Open3D's coloured ICP with the weights of the paper (lambda = 0.968)."""
    import open3d as o3d

    pipeline: Any = o3d.pipelines.registration
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        result = pipeline.registration_colored_icp(
            _with_colours(source),
            _with_colours(target),
            reach,
            init,
            pipeline.TransformationEstimationForColoredICP(),
            pipeline.ICPConvergenceCriteria(max_iteration=peer_calls.MAX_ITERATIONS),
        )
    return Estimate(np.array(result.transformation), fitness=float(result.fitness))


def _with_colours(cloud: Prepared) -> Any:
    def build() -> Any:
        import open3d as o3d

        bright = intensity(cloud.cloud)
        if bright is None:
            raise InputError("the cloud has no colours")
        made = o3d.geometry.PointCloud(peer_calls.open3d_cloud(cloud))
        made.colors = o3d.utility.Vector3dVector(np.repeat(bright[:, None], 3, axis=1))
        return made

    return cloud.derived("open3d-colour", build)


def ndt(source: Prepared, target: Prepared, init: Array, reach: float) -> Estimate:
    """Run Open3D's normal distributions transform on voxels of the threshold."""
    import open3d as o3d

    pipeline: Any = o3d.pipelines.registration
    option = pipeline.NormalDistributionsTransformOption(
        voxel_size=reach, max_iteration=peer_calls.MAX_ITERATIONS
    )
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        result = pipeline.registration_ndt(
            peer_calls.open3d_cloud(source), peer_calls.open3d_cloud(target), option, init
        )
    return Estimate(np.array(result.transformation), fitness=float(result.fitness))


def fgr(source: Prepared, target: Prepared, reach: float, refined: bool) -> Estimate:
    """Match FPFH on voxels of half the threshold by Fast Global Registration.

    Its distance is half a voxel, as in Open3D's tutorial; the rest as the library is set.
    """

    def match() -> Estimate:
        import open3d as o3d

        pipeline: Any = o3d.pipelines.registration
        voxel = reach / 2
        (moving, theirs), (fixed, ours) = (
            peer_calls.features(cloud, voxel) for cloud in (source, target)
        )
        o3d.utility.random.seed(0)
        option = pipeline.FastGlobalRegistrationOption(maximum_correspondence_distance=0.5 * voxel)
        found = pipeline.registration_fgr_based_on_feature_matching(
            moving, fixed, theirs, ours, option
        )
        near = pipeline.evaluate_registration(moving, fixed, 1.5 * voxel, found.transformation)
        pose = np.array(found.transformation)
        rotation = se3.nearest_rotation(pose[:3, :3])
        return Estimate(se3.rigid(rotation, pose[:3, 3]), fitness=float(near.fitness))

    # The same from every start of a pair: worked out once, charged to each.
    outcome = source.derived(("fgr", target.name, reach), match)
    if not refined:
        return outcome
    return peer_calls.gicp(source, target, outcome.transformation, (reach,))


def cpd(source: Prepared, target: Prepared, init: Array) -> Estimate:
    """Run pycpd's rigid Coherent Point Drift on about 1,000 points of each cloud.

    Its scale is held at 1: the package has no rigid registration without one, and in clouds
    that overlap in part the scale shrinks.
    """
    import pycpd

    class Rigid(pycpd.RigidRegistration):  # type: ignore[misc]
        q: float
        sigma2: float

        def update_transform(self) -> None:
            super().update_transform()
            self.s = 1.0
            middle = (self.P @ self.X).sum(axis=0) / self.Np
            middle_of_source = (self.P.T @ self.Y).sum(axis=0) / self.Np
            self.t = middle - middle_of_source @ self.R

        def update_variance(self) -> None:
            before = self.q
            square = self.Pt1 @ (self.X_hat**2).sum(axis=1)
            cost = square - 2.0 * np.trace(self.A @ self.R) + self.YPY
            self.q = cost / (2.0 * self.sigma2) + 0.5 * self.D * self.Np * np.log(self.sigma2)
            self.diff = np.abs(self.q - before)
            self.sigma2 = cost / (self.Np * self.D)
            if self.sigma2 <= 0.0:
                self.sigma2 = self.tolerance / 10.0

    moved = se3.transform(init, _few(source))
    found = Rigid(X=_few(target), Y=moved, max_iterations=peer_calls.MAX_ITERATIONS, w=CPD_OUTLIERS)
    found.register()
    # Rows times R: a point as a column is turned by its transpose.
    motion = se3.rigid(se3.nearest_rotation(found.R.T), np.asarray(found.t).reshape(3))
    return Estimate(
        motion @ init,
        iterations=int(found.iteration),
        fitness=float(np.clip(found.Np / len(moved), 0.0, 1.0)),
    )


def _few(cloud: Prepared) -> Array:
    def build() -> Array:
        return downsample(PointCloud(cloud.points), CPD_POINTS).cloud.observed_points

    return cloud.derived(("few", CPD_POINTS), build)
