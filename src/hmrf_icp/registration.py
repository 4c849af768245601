"""Register one cloud to another: the entrance to the package."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmrf_icp import presets, se3, threads
from hmrf_icp.clouds.cloud import LARGEST_COORDINATE, PointCloudLike
from hmrf_icp.clouds.prepared import PreparedCloud, prepare
from hmrf_icp.clouds.sensor_view import SensorView
from hmrf_icp.errors import (
    InputError,
    RegistrationWarning,
    interruptible,
    no_interrupt_lost,
)
from hmrf_icp.loop.align import Aligner
from hmrf_icp.loop.correspondences import Correspondences
from hmrf_icp.loop.criteria import StoppingRule
from hmrf_icp.loop.degeneracy import FreeMotion, about_another, about_origin
from hmrf_icp.loop.icp import Iteration, LoopResult
from hmrf_icp.loop.match import Matches
from hmrf_icp.loop.reject import Labels, Rejector
from hmrf_icp.presets import AlignerName, PresetName, Registrar, RejectorName
from hmrf_icp.result import RegistrationResult
from hmrf_icp.search.coarse_to_fine import SearchResult
from hmrf_icp.stages import Stopwatch, stage, timed_by

Registrable: TypeAlias = PreparedCloud | PointCloudLike | str | os.PathLike[str]
"""A cloud, anything that is taken for one, or the file that it is in."""

Where: TypeAlias = Literal["auto", "near", "everywhere"]
"""Where the pose is looked for."""

UNIT_MIX_UP = 100.0
"""Ratio of the sizes of two clouds above which metres and millimetres were probably mixed up."""


def register(
    source: Registrable,
    target: Registrable,
    init: ArrayLike | None = None,
    *,
    preset: PresetName | Registrar = presets.DEFAULT,
    rejector: RejectorName | Rejector | None = None,
    aligner: AlignerName | Aligner | None = None,
    criteria: StoppingRule | None = None,
    viewpoint: ArrayLike | Literal["auto"] | None = "auto",
    search: Where = "auto",
    num_threads: int | None = None,
    profile: bool = False,
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
        (4, 4) rigid motion to start from, source to target: the pose is looked for near it.
        None means that nothing is known: the identity is tried, and then everywhere.
    preset
        Name of a method (:func:`hmrf_icp.presets.names`), or one of your own.
    rejector
        Name of another rejection rule (:func:`hmrf_icp.presets.rejector_names`),
        or one of your own, in place of the method's.
    aligner
        Name of another metric (:func:`hmrf_icp.presets.aligner_names`), or an
        aligner of your own, in place of the method's. ``"colour"`` takes the colours or
        intensities of both clouds as evidence beside the surfaces.
    criteria
        When to stop, in place of the method's.
    viewpoint
        (3,) where the sensor of both clouds stood, each in its own frame, metres, for those
        that do not say so themselves. ``"auto"`` recovers it from the points, or the camera
        from the grid, and assumes the likeliest place where that fails; None does without.
        :attr:`RegistrationResult.source_view` says what was used. A cloud that was prepared
        has been asked already.
    search
        ``"near"`` the start, the identity where none is given; ``"everywhere"``, with the
        start as one hypothesis among others; ``"auto"``, near a start that is given and
        everywhere without. A method that is Algorithm 1 alone always stays near.
    num_threads
        Threads that look for neighbours, at most the cores that this process may use, which
        is also the default. The result is the same with any number, and none of them
        outlives the call.
    profile
        Whether time and calls of each stage are kept, in :attr:`RegistrationResult.profile`.
    on_iteration
        Called with an :class:`Iteration` after each, for progress. The default runs
        Algorithm 1 from several candidates: it is called for those of all of them, and
        the ``history`` of the result holds those that led to the pose returned.

    Raises
    ------
    InputError
        A cloud, the start or a name is not what it should be, or ``aligner="colour"`` meets
        a cloud without colours.

    Warns
    -----
    RegistrationWarning
        The pose is more likely wrong than right (a confidence below 0.5), the sizes of
        the clouds differ so much that their units probably do, some points stand for
        "nothing measured", so few inliers were
        left that no motion could be found from them, or a method that is EM to its end
        (``"paper"``) converged although the labels of its last decision had not settled.

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
    watch = Stopwatch() if profile else None
    with no_interrupt_lost(), threads.using(num_threads), interruptible(), timed_by(watch):
        result = _register(
            source,
            target,
            init,
            viewpoint,
            presets.method(preset, rejector, aligner, criteria),
            search,
            on_iteration,
            stacklevel=3,
        )
    return result if watch is None else replace(result, profile=watch.stages)


def _register(
    source: Registrable,
    target: Registrable,
    init: ArrayLike | None,
    viewpoint: ArrayLike | Literal["auto"] | None,
    method: Registrar,
    search: Where,
    on_iteration: Callable[[Iteration], None] | None,
    stacklevel: int,
) -> RegistrationResult:
    from hmrf_icp.kernels.compilation import Compilation

    started = time.perf_counter()
    moving, fixed = threads.current().map(
        lambda given: prepare(_read(*given), given[1], viewpoint),
        ((source, "source"), (target, "target")),
    )
    start = se3.as_rigid(init, "init")
    far = float(np.abs(start[:3, 3]).max())
    if far > LARGEST_COORDINATE:
        raise InputError(
            f"init: a translation of {far:.3g} m; expected at most {LARGEST_COORDINATE:g} m"
        )
    if search not in get_args(Where):
        raise InputError(
            f"search: unknown {search!r}, expected one of {', '.join(get_args(Where))}"
        )
    for name, cloud in (("source", moving), ("target", fixed)):
        for note in cloud.cloud.notes:
            warnings.warn(f"{name}: {note}", RegistrationWarning, stacklevel=stacklevel)
    warn_of_units(moving, fixed, stacklevel + 1)
    near = init is not None if search == "auto" else search == "near"
    begin = between_origins(start, moving, fixed)

    def told(iteration: Iteration) -> None:
        if on_iteration is not None:
            on_iteration(_as_given(iteration, moving, fixed))

    with Compilation() as compilation:
        found = method.run(moving, fixed, begin, near, None if on_iteration is None else told)
    seconds = time.perf_counter() - started - compilation.seconds
    loop = found.loop if isinstance(found, SearchResult) else found
    if loop.stuck:
        inlier = loop.labels.inlier
        warnings.warn(
            f"stopped after {len(loop.history)} iterations: {np.count_nonzero(inlier)} inliers "
            f"among {inlier.size} points do not determine a motion; is the start too far off?",
            RegistrationWarning,
            stacklevel=stacklevel,
        )
    elif isinstance(found, LoopResult) and loop.converged and not loop.labels.em_converged:
        warnings.warn(
            f"EM of the last decision stopped after {loop.labels.em_iterations} steps, before its "
            "labels settled; more steps of the rejector would",
            RegistrationWarning,
            stacklevel=stacklevel,
        )
    if isinstance(found, SearchResult) and found.plan.assume_viewpoints:
        for name, cloud in (("source", moving), ("target", fixed)):
            if cloud.doubt is not None:
                warnings.warn(
                    f"{name}: {cloud.doubt}: it was not used; give the place where the sensor "
                    "stood in the frame of the points as they are, or none",
                    RegistrationWarning,
                    stacklevel=stacklevel,
                )
    result = described(found, moving, fixed, seconds)
    if result.confidence is not None and not result.believed:
        warnings.warn(
            f"confidence {result.confidence:.2f}: the pose is more likely wrong than right; "
            f"{result.advice}",
            RegistrationWarning,
            stacklevel=stacklevel,
        )
    return result


@stage("description")
def described(
    found: LoopResult | SearchResult, source: PreparedCloud, target: PreparedCloud, seconds: float
) -> RegistrationResult:
    """Say what was found of the prepared clouds in the frames that these were given in."""
    searched = found if isinstance(found, SearchResult) else None
    loop = found.loop if isinstance(found, SearchResult) else found

    def seen_from(cloud: PreparedCloud) -> SensorView:
        return cloud.seen_from if searched is None else searched.seen_from(cloud)

    def decide(matches: Matches) -> Labels:
        return loop.labels if searched is None else searched.labels(source, target, matches)

    middle = se3.transform(loop.transformation, source.centroid)
    information = None if loop.last is None else loop.last.information
    confidence = None if searched is None else searched.confidence
    if confidence is not None and mixed_up(source, target):
        confidence = 0.0  # a speck agrees wherever it lies
    return RegistrationResult(
        transformation=between_frames(loop.transformation, source, target),
        converged=loop.converged,
        iterations=len(loop.history),
        em_iterations=loop.em_iterations,
        seconds=seconds,
        history=tuple(_as_given(iteration, source, target) for iteration in loop.history),
        # About a point: the same in both frames.
        information=None if information is None else about_origin(information, -middle),
        centre=middle + target.origin,
        degenerate=free_motions(loop, target),
        confidence=confidence,
        visibility=None if searched is None else searched.visibility,
        source_view=seen_from(source),
        target_view=seen_from(target),
        correspondences=Correspondences(source, target, loop.transformation, decide),
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


def _as_given(iteration: Iteration, source: PreparedCloud, target: PreparedCloud) -> Iteration:
    """Express where an iteration led in the frames that the clouds were given in."""
    pose = iteration.transformation
    if pose is None:
        return iteration
    return replace(iteration, transformation=between_frames(pose, source, target))


def _read(cloud: Registrable, name: str) -> PreparedCloud | PointCloudLike:
    """Read a cloud that is given as a file."""
    if not isinstance(cloud, str | os.PathLike):
        return cloud
    from hmrf_icp.io import read_cloud

    try:
        return read_cloud(cloud)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def free_motions(loop: LoopResult, target: PreparedCloud) -> tuple[FreeMotion, ...]:
    """Describe what the last step left unmoved, in the frame that the target was given in."""
    if loop.last is None or loop.last.degenerate is None:
        return ()
    moved = [about_another(twist, target.origin) for twist in loop.last.degenerate]
    return tuple(FreeMotion(twist) for twist in moved)


def mixed_up(source: PreparedCloud, target: PreparedCloud) -> tuple[float, float] | None:
    """Sizes of both where one is a hundred times the other or more; None elsewhere."""
    one, other = source.spread, target.spread
    return (one, other) if max(one, other) > UNIT_MIX_UP * min(one, other) else None


def warn_of_units(source: PreparedCloud, target: PreparedCloud, stacklevel: int) -> None:
    """Warn where the clouds are probably in different units."""
    sizes = mixed_up(source, target)
    if sizes is not None:
        warnings.warn(
            f"source spreads over {sizes[0]:.3g} and target over {sizes[1]:.3g} (median distance "
            "from the centre): one is probably in millimetres and the other in metres",
            RegistrationWarning,
            stacklevel=stacklevel,
        )
