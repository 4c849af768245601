"""Registration of depth maps and point clouds that overlap only in part."""

from hmrf_icp import presets
from hmrf_icp.camera import PinholeCamera
from hmrf_icp.cloud import PointCloud
from hmrf_icp.criteria import Criteria, RelativeCriteria
from hmrf_icp.degeneracy import FreeMotion
from hmrf_icp.errors import (
    HmrfIcpError,
    InputError,
    MissingDependencyError,
    RegistrationWarning,
)
from hmrf_icp.evidence import Verdict
from hmrf_icp.icp import Iteration, Method
from hmrf_icp.registration import register
from hmrf_icp.result import RegistrationResult

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
