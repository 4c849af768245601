"""The two clouds of a result, where the picture needs them."""

from __future__ import annotations

from dataclasses import dataclass

from hmrf_icp.clouds.cloud import PointCloud, PointCloudLike
from hmrf_icp.clouds.prepared import PreparedCloud, prepare
from hmrf_icp.errors import InputError
from hmrf_icp.registration import between_origins
from hmrf_icp.result import RegistrationResult
from hmrf_icp.se3 import Array


@dataclass(frozen=True, eq=False)
class Pair:
    """A source, a target and the pose between them, in the frames of the prepared clouds.

    Attributes
    ----------
    source, target
        The clouds.
    pose
        (4, 4) the pose of the result, between the origins of these.
    """

    source: PreparedCloud
    target: PreparedCloud
    pose: Array

    @classmethod
    def of(
        cls,
        result: RegistrationResult,
        source: PreparedCloud | PointCloudLike | None = None,
        target: PreparedCloud | PointCloudLike | None = None,
    ) -> Pair:
        """Take the clouds that are given, or those that the result holds.

        Raises
        ------
        InputError
            One is given and the other not, the result is of another source, or nobody has them.
        """
        held = result.correspondences
        if source is not None and target is not None:
            moving, fixed = prepare(source, "source"), prepare(target, "target")
            if moving.cloud.shape != held.shape:
                raise InputError(
                    f"result: is of a source of shape {held.shape}, this one has "
                    f"{moving.cloud.shape}"
                )
            return cls(moving, fixed, between_origins(result.transformation, moving, fixed))
        if source is not None or target is not None:
            raise InputError("source, target: give both clouds, or neither")
        if held.clouds is None or held.pose is None:
            raise InputError(
                "result: is a copy, or was pickled, and holds no clouds; give source and target"
            )
        return cls(*held.clouds, held.pose)

    def between(self, pose: Array) -> Array:
        """Express a pose (4, 4) between the frames as given on these clouds."""
        return between_origins(pose, self.source, self.target)

    @property
    def clouds(self) -> tuple[PointCloud, PointCloud]:
        """Source and target."""
        return self.source.cloud, self.target.cloud
