"""A cloud in another frame, with all that it had."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hmrf_icp import se3
from hmrf_icp.clouds.cloud import PointCloud


def moved(cloud: PointCloud, pose: ArrayLike) -> PointCloud:
    """Move a cloud by a rigid motion.

    Normals turn, the viewpoint moves, attributes stay as they are. A camera
    stands at the origin of its cloud's frame and looks along z: a cloud that
    has moved has none, and keeps where it stood as its viewpoint.

    Parameters
    ----------
    cloud
        In the frame that the motion starts from.
    pose
        (4, 4) rigid motion, metres.

    Raises
    ------
    InputError
        The matrix is not a rigid motion.
    """
    motion = se3.as_rigid(pose, "pose")
    if np.array_equal(motion, np.eye(4)):
        return cloud
    turn = se3.rigid(motion[:3, :3], np.zeros(3))
    return PointCloud(
        se3.transform(motion, cloud.points),
        viewpoint=None if cloud.viewpoint is None else se3.transform(motion, cloud.viewpoint),
        normals=None if cloud.normals is None else se3.transform(turn, cloud.normals),
        attributes=cloud.attributes,
    )
