"""Registration of depth maps and point clouds that overlap only in part."""

from hmrf_icp import presets
from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.distorted_camera import DistortedCamera
from hmrf_icp.clouds.distortion import Distortion
from hmrf_icp.clouds.prepared import PreparedCloud, prepare
from hmrf_icp.errors import (
    HmrfIcpError,
    InputError,
    MissingDependencyError,
    RegistrationWarning,
)
from hmrf_icp.field.general import MarkovField
from hmrf_icp.field.paper import HiddenMarkovRandomField
from hmrf_icp.io import read_camera, read_cloud, read_depth, write_cloud
from hmrf_icp.loop.align import PointToPoint
from hmrf_icp.loop.colour import Coloured
from hmrf_icp.loop.criteria import Criteria, RelativeCriteria
from hmrf_icp.loop.degeneracy import FreeMotion
from hmrf_icp.loop.icp import Iteration, Method
from hmrf_icp.loop.match import NearestNeighbour
from hmrf_icp.loop.reject import X84, Dynamic, KeepAll, KeepPercent, KeepSigma
from hmrf_icp.loop.surface_metrics import PlaneToPlane, PointToPlane, Symmetric
from hmrf_icp.registration import register
from hmrf_icp.result import RegistrationResult
from hmrf_icp.search.coarse_to_fine import CoarseToFine
from hmrf_icp.search.visibility import Visibility
from hmrf_icp.search.visible_match import VisibleMatch
from hmrf_icp.stages import Stage

__version__ = "0.2.0"

__all__ = [
    "X84",
    "CoarseToFine",
    "Coloured",
    "Criteria",
    "DistortedCamera",
    "Distortion",
    "Dynamic",
    "FreeMotion",
    "HiddenMarkovRandomField",
    "HmrfIcpError",
    "InputError",
    "Iteration",
    "KeepAll",
    "KeepPercent",
    "KeepSigma",
    "MarkovField",
    "Method",
    "MissingDependencyError",
    "NearestNeighbour",
    "PinholeCamera",
    "PlaneToPlane",
    "PointCloud",
    "PointToPlane",
    "PointToPoint",
    "PreparedCloud",
    "RegistrationResult",
    "RegistrationWarning",
    "RelativeCriteria",
    "Stage",
    "Symmetric",
    "Visibility",
    "VisibleMatch",
    "prepare",
    "presets",
    "read_camera",
    "read_cloud",
    "read_depth",
    "register",
    "write_cloud",
]


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
