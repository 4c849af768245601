"""Registration of depth maps and point clouds that overlap only in part."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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

_HOMES = {
    "hmrf_icp.clouds.camera": "PinholeCamera",
    "hmrf_icp.clouds.cloud": "PointCloud",
    "hmrf_icp.clouds.distorted_camera": "DistortedCamera",
    "hmrf_icp.clouds.distortion": "Distortion",
    "hmrf_icp.clouds.prepared": "PreparedCloud prepare",
    "hmrf_icp.errors": "HmrfIcpError InputError MissingDependencyError RegistrationWarning",
    "hmrf_icp.field.general": "MarkovField",
    "hmrf_icp.field.paper": "HiddenMarkovRandomField",
    "hmrf_icp.io": "read_camera read_cloud read_depth write_cloud",
    "hmrf_icp.loop.align": "PointToPoint",
    "hmrf_icp.loop.colour": "Coloured",
    "hmrf_icp.loop.criteria": "Criteria RelativeCriteria",
    "hmrf_icp.loop.degeneracy": "FreeMotion",
    "hmrf_icp.loop.icp": "Iteration Method",
    "hmrf_icp.loop.match": "NearestNeighbour",
    "hmrf_icp.loop.reject": "X84 Dynamic KeepAll KeepPercent KeepSigma",
    "hmrf_icp.loop.surface_metrics": "PlaneToPlane PointToPlane Symmetric",
    "hmrf_icp.registration": "register",
    "hmrf_icp.result": "RegistrationResult",
    "hmrf_icp.search.coarse_to_fine": "CoarseToFine",
    "hmrf_icp.search.visibility": "Visibility",
    "hmrf_icp.search.visible_match": "VisibleMatch",
    "hmrf_icp.stages": "Stage",
}
"""Names of the package's front by the module that they are made in: loaded when first asked for."""

_HOME = {name: module for module, names in _HOMES.items() for name in names.split()}

_ROOMS = frozenset(
    {"datasets", "errors", "evaluate", "io", "plot", "presets", "se3", "synthetic", "view"}
)
"""Modules that are found here without an import of their own."""


def __getattr__(name: str) -> Any:
    if name in _ROOMS:
        return import_module(f"hmrf_icp.{name}")
    if name not in _HOME:
        raise AttributeError(f"module 'hmrf_icp' has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_HOME[name]), name)
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
