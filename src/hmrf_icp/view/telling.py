"""The story of a registration, told from its result and from what was recorded of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmrf_icp import se3
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.drawing.oblique import viewing_frame
from hmrf_icp.errors import InputError
from hmrf_icp.figures.states import Recording
from hmrf_icp.loop.degeneracy import FreeMotion
from hmrf_icp.registration import between_origins
from hmrf_icp.result import RegistrationResult
from hmrf_icp.search.visibility import knowing
from hmrf_icp.view import words
from hmrf_icp.view.steps import Step, steps
from hmrf_icp.view.story import Free, Moment, Said, ShownCloud, Story

Array = NDArray[np.float64]

POINTS = 20_000
"""Points of each cloud that are shown at the most: as many as the search looks at."""

WIDEST = 320
"""Columns of the image at the most."""

BINS = 40
"""Of the histograms of distances."""

NEAREST, FARTHEST = 2.0, 99.5
"""Percentiles of the distances, at the end and over all moments, that the bins span."""

SPAN = 1e-4
"""Smallest distance that a bin tells apart, as a share of the largest: exact clouds have zero."""


def story(
    result: RegistrationResult,
    init: ArrayLike | None = None,
    recording: Recording | None = None,
    truth: ArrayLike | None = None,
    names: tuple[str, str] = ("source", "target"),
    points: int = POINTS,
) -> Story:
    """Tell what a registration did.

    Parameters
    ----------
    result
        What came out, as it was returned: a copy has no clouds to show.
    init
        (4, 4) the start that was given; None for the identity.
    recording
        What it tried; without, the iterations that led to the result are told alone.
    truth
        (4, 4) the true pose where it is known, source to target.
    names
        What the two clouds are called.
    points
        Points of each cloud that are shown, at the most.

    Raises
    ------
    InputError
        The result is a copy, or a pose is not rigid.
    """
    clouds = result.correspondences.clouds
    if clouds is None:
        raise InputError(
            "result: a copy, which holds no clouds to show; expected the result that register "
            "returned, in the same process"
        )
    source, target = clouds
    recorded = () if recording is None else recording.iterations
    end, middle = result.transformation, result.centre - target.origin
    off = "" if truth is None else f"It is {words.apart(end, se3.as_rigid(truth, 'truth'))}. "
    said = Said(
        verdict=_sentence(result.verdict),
        believed=result.believed,
        advice=off + ("" if result.advice is None else _sentence(result.advice)),
        facts=tuple(words.facts(result)),
        free=tuple(_free(one, target.origin, middle) for one in result.degenerate),
    )
    told = _Telling(source, target, names, points)
    passed = steps(se3.as_rigid(init, "init"), end, result.history, recorded)
    return told(passed, said, truth, result.correspondences.matched.probability)


def story_of_pose(
    source: PreparedCloud,
    target: PreparedCloud,
    init: ArrayLike | None,
    end: Array,
    said: str,
    truth: ArrayLike | None = None,
    names: tuple[str, str] = ("source", "target"),
) -> Story:
    """Tell of a pose (4, 4) of a method that says nothing more of it than ``said``."""
    off = "" if truth is None else f"It is {words.apart(end, se3.as_rigid(truth, 'truth'))}."
    facts = (("Motion", words.motion(end)),)
    passed = steps(se3.as_rigid(init, "init"), end, ())
    told = _Telling(source, target, names, POINTS)
    return told(passed, Said(said, None, off, facts), truth)


class _Telling:
    """What all moments of a story share: the clouds, and who can be asked of them."""

    def __init__(
        self, source: PreparedCloud, target: PreparedCloud, names: tuple[str, str], points: int
    ) -> None:
        self._clouds = source, target
        self._most = points
        # The places that the search looked from, and the points that it looked at.
        self._few = [cloud.viewed.downsampled(points) for cloud in (source, target)]
        self._names = names

    def __call__(
        self,
        passed: Sequence[Step],
        said: Said,
        truth: ArrayLike | None,
        probability: Array | None = None,
    ) -> Story:
        """Tell of the steps that were passed through."""
        source, target = self._clouds
        few, onto = self._few
        result = len(passed) - 1
        if truth is not None:
            passed = (*passed, Step(se3.as_rigid(truth, "truth"), "True pose", 0, False))
        poses = [between_origins(step.transformation, source, target) for step in passed]
        distances = [
            target.tree.query(np.ascontiguousarray(se3.transform(pose, few.points)))[0]
            for pose in poses
        ]
        edges = bins(distances, result)
        by_source, by_target, views = knowing(few, onto)
        moments = tuple(
            Moment(
                step.title,
                step.run,
                step.chosen,
                pose,
                distance.astype(np.float32),
                by_target.ask(few.points, few.surface.normals, pose),
                by_source.ask(onto.points, onto.surface.normals, se3.inverse(pose)),
                np.histogram(np.clip(distance, edges[0], edges[-1]), edges)[0] / len(distance),
                words.numbers(step.iteration),
            )
            for step, pose, distance in zip(passed, poses, distances, strict=True)
        )
        rows = source.viewed.representatives(self._most)
        return Story(
            said=said,
            source=_shown(few, source, self._names[0]),
            target=_shown(onto, target, self._names[1]),
            probability=None if probability is None else mean_of(probability, rows, len(few)),
            moments=moments,
            result=result,
            edges=edges,
            image=_image(source, rows),
            views=views,
            frame=viewing_frame(source.cloud, target.cloud, poses[result]),
        )


def bins(distances: Sequence[Array], result: int) -> Array:
    """Lay out bins from the smallest distances of the result to the largest of all moments."""
    high = max(float(np.percentile(distance, FARTHEST)) for distance in distances)
    low = float(np.percentile(distances[result], NEAREST))
    high = high if high > 0.0 else 1.0
    return np.geomspace(min(max(low, SPAN * high), 0.5 * high), high, BINS + 1)


def mean_of(values: Array, rows: NDArray[np.intp], count: int) -> NDArray[np.float32]:
    """Average values (M,) over the points that each of ``count`` shown ones stands for."""
    many = np.bincount(rows, minlength=count)
    return (np.bincount(rows, values, count) / np.maximum(many, 1)).astype(np.float32)


def _shown(few: PreparedCloud, whole: PreparedCloud, name: str) -> ShownCloud:
    surface, view = few.surface, few.seen_from
    return ShownCloud(
        name,
        few.points.astype(np.float32),
        surface.normals.astype(np.float32),
        whole.origin,
        few.neighbour_distance,
        len(whole),
        few.cloud.viewpoint if view.known else None,
        view.text,
    )


def _image(source: PreparedCloud, rows: NDArray[np.intp]) -> NDArray[np.int32] | None:
    """Lay the rows of the shown points out on the source's grid, thinned."""
    if not source.cloud.organised:
        return None
    grid = source.cloud.on_grid(rows.astype(np.int32), -1)
    step = max(1, -(-grid.shape[1] // WIDEST))
    return np.ascontiguousarray(grid[::step, ::step])


def _free(motion: FreeMotion, origin: Array, middle: Array) -> Free:
    through = middle if motion.point is None else motion.point - origin
    if motion.point is not None:
        # The point of the axis that is nearest to the clouds, not to the origin.
        through = through + motion.direction * float(motion.direction @ (middle - through))
    direction = tuple(motion.direction.tolist())
    return Free(str(motion), motion.rotation, direction, tuple(through.tolist()))


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."
