"""Register one cloud to another: the entrance to the package."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmrf_icp import presets, se3
from hmrf_icp.clouds.cloud import PointCloudLike, some_of
from hmrf_icp.clouds.prepared import PreparedCloud, prepare
from hmrf_icp.errors import InputError, RegistrationWarning
from hmrf_icp.loop.align import Aligner
from hmrf_icp.loop.criteria import StoppingRule
from hmrf_icp.loop.degeneracy import FreeMotion
from hmrf_icp.loop.icp import Iteration, LoopResult, rms
from hmrf_icp.loop.reject import Rejector
from hmrf_icp.presets import AlignerName, PresetName, Registrar, RejectorName
from hmrf_icp.result import RegistrationResult
from hmrf_icp.search.coarse_to_fine import SearchResult

UNIT_MIX_UP = 100.0
"""Ratio of the sizes of two clouds above which metres and millimetres were probably mixed up."""


def register(
    source: PreparedCloud | PointCloudLike | str | os.PathLike[str],
    target: PreparedCloud | PointCloudLike | str | os.PathLike[str],
    init: ArrayLike | None = None,
    *,
    preset: PresetName | Registrar = presets.DEFAULT,
    rejector: RejectorName | Rejector | None = None,
    aligner: AlignerName | Aligner | None = None,
    criteria: StoppingRule | None = None,
    search: Literal["auto", "near", "everywhere"] = "auto",
    on_iteration: Callable[[Iteration], None] | None = None,
) -> RegistrationResult:
    """Find the rigid motion that takes ``source`` onto ``target``.

    Parameters
    ----------
    source
        The cloud that moves (the paper's free cloud): a :class:`PointCloud`, an
        array (H, W, 3) or (N, 3) in metres, an object with ``.points``, the path of a
        file with a cloud, or any of these prepared (:func:`hmrf_icp.prepare`). For
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

    Examples
    --------
    >>> import numpy as np
    >>> import hmrf_icp
    >>> points = np.random.default_rng(0).uniform(size=(2000, 3)) * [1.0, 0.7, 0.0]
    >>> points[:, 2] = 0.1 * np.sin(7.0 * points[:, 0]) * np.cos(9.0 * points[:, 1])
    >>> shift = np.eye(4)
    >>> shift[:3, 3] = 0.02, -0.01, 0.01
    >>> result = hmrf_icp.register(points - shift[:3, 3], points)
    >>> bool(np.allclose(result.transformation, shift, atol=1e-6))
    True
    """
    started = time.perf_counter()
    moving, fixed = (
        prepare(_read(cloud, name), name)
        for cloud, name in ((source, "source"), (target, "target"))
    )
    start = se3.as_rigid(init, "init")
    warn_of_units(moving, fixed)

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
    near = init is not None if search == "auto" else search == "near"
    found = method.run(moving, fixed, between_origins(start, moving, fixed), near, on_iteration)
    judged = found if isinstance(found, SearchResult) else None
    loop = found.loop if isinstance(found, SearchResult) else found
    inlier = loop.labels.inlier
    if loop.stuck:
        warnings.warn(
            f"stopped after {len(loop.history)} iterations: {np.count_nonzero(inlier)} inliers "
            f"among {inlier.size} points do not determine a motion; is the start too far off?",
            RegistrationWarning,
            stacklevel=2,
        )
    on_grid = moving.cloud.on_grid
    return RegistrationResult(
        transformation=between_frames(loop.transformation, moving, fixed),
        inlier_probability=on_grid(loop.labels.probability),
        distance=on_grid(loop.matches.distance),
        converged=loop.converged,
        iterations=len(loop.history),
        em_iterations=loop.em_iterations,
        overlap=float(inlier.mean()),
        inlier_rmse=rms(loop.matches.distance[inlier]),
        seconds=time.perf_counter() - started,
        history=loop.history,
        information=None if loop.last is None else loop.last.information,
        degenerate=free_motions(loop),
        confidence=None if judged is None else judged.confidence,
        visibility=None if judged is None else judged.visibility,
    )


def between_origins(
    transformation: NDArray[np.float64], source: PreparedCloud, target: PreparedCloud
) -> NDArray[np.float64]:
    """Express a motion (4, 4) between the frames as given on the prepared clouds."""
    moved: NDArray[np.float64] = transformation.copy()
    moved[:3, 3] += transformation[:3, :3] @ source.origin - target.origin
    return moved


def between_frames(
    transformation: NDArray[np.float64], source: PreparedCloud, target: PreparedCloud
) -> NDArray[np.float64]:
    """Express a motion (4, 4) between the prepared clouds on the frames as given."""
    moved: NDArray[np.float64] = transformation.copy()
    moved[:3, 3] += target.origin - transformation[:3, :3] @ source.origin
    return moved


def _read(
    cloud: PreparedCloud | PointCloudLike | str | os.PathLike[str], name: str
) -> PreparedCloud | PointCloudLike:
    """Read a cloud that is given as a file."""
    if not isinstance(cloud, str | os.PathLike):
        return cloud
    from hmrf_icp.io import read_cloud

    try:
        return read_cloud(cloud)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def free_motions(loop: LoopResult) -> tuple[FreeMotion, ...]:
    """Describe what the last step left unmoved."""
    if loop.last is None or loop.last.degenerate is None:
        return ()
    return tuple(FreeMotion(twist) for twist in loop.last.degenerate)


def warn_of_units(source: PreparedCloud, target: PreparedCloud) -> None:
    """Warn where one cloud is a hundred times the size of the other, or more."""
    sizes = [
        float(np.median(np.linalg.norm(points - np.median(points, axis=0), axis=1)))
        for points in (some_of(source.points), some_of(target.points))
    ]
    small, large = sorted(sizes)
    if large > UNIT_MIX_UP * small:
        warnings.warn(
            f"source spreads over {sizes[0]:.3g} and target over {sizes[1]:.3g} (median distance "
            "from the centre): one is probably in millimetres and the other in metres",
            RegistrationWarning,
            stacklevel=3,
        )
