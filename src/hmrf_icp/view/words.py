"""A registration's numbers in words, with units."""

from __future__ import annotations

import math
from collections.abc import Iterator

from hmrf_icp import se3
from hmrf_icp.loop.icp import Iteration
from hmrf_icp.result import RegistrationResult, count
from hmrf_icp.se3 import Array

UNITLESS = ("beta", "share", "shape", "spread")
"""What the name of a parameter that is no length ends in; see :mod:`hmrf_icp.field.residuals`."""


PARAMETERS = {
    "mu_in": "inliers’ mean",
    "sigma_in": "inliers’ deviation",
    "mu_out": "outliers’ mean",
    "sigma_out": "outliers’ deviation",
    "inlier_sigma": "inliers’ deviation",
    "outlier_maximum": "outliers’ maximum",
    "share": "share of inliers, expected",
}
"""What some parameters are called; others by their own names."""


def length(metres: float) -> str:
    """Say a length in the unit that needs no zeros."""
    if metres == 0.0 or not math.isfinite(metres):
        return f"{metres:g} m"
    for size, unit in ((1e-3, "µm"), (0.1, "mm"), (1e3, "m")):
        if metres < size:
            scale = {"µm": 1e6, "mm": 1e3, "m": 1.0}[unit]
            return f"{metres * scale:.3g} {unit}"
    return f"{metres / 1e3:.3g} km"


def angle(radians: float) -> str:
    """Say an angle in degrees."""
    return f"{math.degrees(radians):.3g}°"


def motion(pose: Array) -> str:
    """Say how far a motion (4, 4) goes."""
    return f"{length(se3.translation_norm(pose))}, {angle(se3.rotation_angle(pose))}"


def apart(pose: Array, truth: Array) -> str:
    """Say how far a pose is off the true one."""
    metres, radians = se3.error(pose, truth)
    return f"{length(metres)} and {angle(radians)} from the true pose"


def facts(result: RegistrationResult) -> Iterator[tuple[str, str]]:
    """Yield what a result says of itself, name and value."""
    yield "Overlap", f"{result.overlap:.1%} of the source's surface"
    yield "Inliers", f"{result.fitness:.1%} of the points, RMSE {length(result.inlier_rmse)}"
    yield "Motion", motion(result.transformation)
    state = "converged" if result.converged else "did not converge"
    yield "Loop", f"{state} after {count(result.iterations, 'iteration')}"
    yield "Time", f"{result.seconds:.2f} s"


def numbers(iteration: Iteration | None) -> dict[str, float]:
    """Return what an iteration reported by names with their units."""
    if iteration is None:
        return {}
    told = {
        "inliers, share": iteration.inlier_share,
        "RMSE of inliers, m": iteration.inlier_rmse,
        "shift of a step, m": iteration.step_translation,
        "turn of a step, degrees": math.degrees(iteration.step_rotation),
        "EM steps": float(iteration.em_iterations),
    }
    for name, value in iteration.parameters.items():
        if name != "iteration":
            words = PARAMETERS.get(name, name.replace("_", " "))
            told[words if name.endswith(UNITLESS) else f"{words}, m"] = float(value)
    return {name: value for name, value in told.items() if math.isfinite(value)}
