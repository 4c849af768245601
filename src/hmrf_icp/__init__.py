"""Registration of depth maps and point clouds that overlap only in part."""

from hmrf_icp import presets
from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.errors import (
    HmrfIcpError,
    InputError,
    MissingDependencyError,
    RegistrationWarning,
)
from hmrf_icp.loop.criteria import Criteria, RelativeCriteria
from hmrf_icp.loop.degeneracy import FreeMotion
from hmrf_icp.loop.icp import Iteration, Method
from hmrf_icp.registration import register
from hmrf_icp.result import RegistrationResult
from hmrf_icp.search.visibility import Verdict

__version__ = "0.1.0"

__all__ = [
    "Criteria",
    "FreeMotion",
    "HmrfIcpError",
    "InputError",
    "Iteration",
    "Method",
    "MissingDependencyError",
    "PinholeCamera",
    "PointCloud",
    "RegistrationResult",
    "RegistrationWarning",
    "RelativeCriteria",
    "Verdict",
    "presets",
    "register",
]
