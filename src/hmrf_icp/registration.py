"""Register one cloud to another: the entrance to the package."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hmrf_icp import presets, se3
from hmrf_icp.clouds.cloud import PointCloud, as_cloud, require_registrable, some_of
from hmrf_icp.errors import InputError, RegistrationWarning
from hmrf_icp.loop.align import Aligner
from hmrf_icp.loop.criteria import StoppingRule
from hmrf_icp.loop.degeneracy import FreeMotion
from hmrf_icp.loop.icp import Iteration, Outcome, Registrar, rms
from hmrf_icp.loop.reject import Rejector
from hmrf_icp.result import RegistrationResult

UNIT_MIX_UP = 100.0
"""Ratio of the sizes of two clouds above which metres and millimetres were probably mixed up."""


def register(
    source: Any,
    target: Any,
    init: ArrayLike | None = None,
    preset: str | Registrar = presets.DEFAULT,
    *,
    rejector: str | Rejector | None = None,
    aligner: str | Aligner | None = None,
    criteria: StoppingRule | None = None,
    on_iteration: Callable[[Iteration], None] | None = None,
) -> RegistrationResult:
    """Find the rigid motion that takes ``source`` onto ``target``.

    Parameters
    ----------
    source
        The cloud that moves (the paper's free cloud): a :class:`PointCloud`, an
        array (H, W, 3) or (N, 3) in metres, or an object with ``.points``. For
        ``preset="paper"`` it must be organised.
    target
        The cloud that stays (the paper's fixed cloud), of any kind.
    init
        (4, 4) rigid motion to start from, source to target; None for the identity.
    preset
        Name of a method (:func:`hmrf_icp.presets.names`), or one of your own.
    rejector
        Name of another rejection rule (:func:`hmrf_icp.presets.rejector_names`),
        or one of your own, in place of the method's.
    aligner
        Name of another metric (:func:`hmrf_icp.presets.aligner_names`), or an
        aligner of your own, in place of the method's.
    criteria
        When to stop, in place of the method's.
    on_iteration
        Called with an :class:`Iteration` after each.

    Raises
    ------
    InputError
        A cloud, the start or a name is not what it should be.

    Warns
    -----
    RegistrationWarning
        The sizes of the clouds differ so much that their units probably do, or
        so few inliers were left that no motion could be found from them.
    """
    started = time.perf_counter()
    source, target = as_cloud(source, "source"), as_cloud(target, "target")
    require_registrable(source, "source")
    require_registrable(target, "target")
    start = se3.as_rigid(init, "init")
    warn_of_units(source, target)

    chosen = presets.preset(preset) if isinstance(preset, str) else preset
    if not isinstance(chosen, Registrar):
        raise InputError(
            f"preset: unknown {preset!r}, expected a method or one of {', '.join(presets.names())}"
        )
    method = chosen.with_parts(
        reject=presets.rejector(rejector) if isinstance(rejector, str) else rejector,
        align=presets.aligner(aligner) if isinstance(aligner, str) else aligner,
        criteria=criteria,
    )
    outcome = method.run(source, target, start, on_iteration)
    inlier = outcome.labels.inlier
    if outcome.stuck:
        warnings.warn(
            f"stopped after {len(outcome.history)} iterations: {np.count_nonzero(inlier)} inliers "
            f"among {inlier.size} points do not determine a motion; is the start too far off?",
            RegistrationWarning,
            stacklevel=2,
        )
    return RegistrationResult(
        transformation=outcome.transformation,
        inlier_probability=source.on_grid(outcome.labels.probability),
        distance=source.on_grid(outcome.matches.distance),
        converged=outcome.converged,
        iterations=len(outcome.history),
        em_iterations=outcome.em_iterations,
        overlap=float(inlier.mean()),
        inlier_rmse=rms(outcome.matches.distance[inlier]),
        seconds=time.perf_counter() - started,
        history=outcome.history,
        information=None if outcome.last is None else outcome.last.information,
        degenerate=free_motions(outcome),
        confidence=outcome.confidence,
        verdict=outcome.verdict,
    )


def free_motions(outcome: Outcome) -> tuple[FreeMotion, ...]:
    """Describe what the last step left unmoved."""
    if outcome.last is None or outcome.last.degenerate is None:
        return ()
    return tuple(FreeMotion(twist) for twist in outcome.last.degenerate)


def warn_of_units(source: PointCloud, target: PointCloud) -> None:
    """Warn where one cloud is a hundred times the size of the other, or more."""
    sizes = [
        float(np.median(np.linalg.norm(points - np.median(points, axis=0), axis=1)))
        for points in (some_of(source.observed_points), some_of(target.observed_points))
    ]
    small, large = sorted(sizes)
    if large > UNIT_MIX_UP * small:
        warnings.warn(
            f"source spreads over {sizes[0]:.3g} and target over {sizes[1]:.3g} (median distance "
            "from the centre): one is probably in millimetres and the other in metres",
            RegistrationWarning,
            stacklevel=3,
        )
