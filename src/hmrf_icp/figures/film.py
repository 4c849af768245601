"""A film of a registration: the source moves into place while the field settles."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmrf_icp import presets, se3
from hmrf_icp.clouds.cloud import PointCloudLike
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.drawing import palette
from hmrf_icp.drawing.oblique import lit
from hmrf_icp.drawing.painter import paint
from hmrf_icp.errors import InputError
from hmrf_icp.figures.encode import check_film, write_film
from hmrf_icp.figures.pair import Pair
from hmrf_icp.figures.screen import Screen
from hmrf_icp.figures.shots import Shot, shots_of
from hmrf_icp.figures.states import Recording, states_of
from hmrf_icp.figures.style import Lengths, Names
from hmrf_icp.figures.view import View
from hmrf_icp.presets import Registrar
from hmrf_icp.registration import between_frames
from hmrf_icp.result import RegistrationResult
from hmrf_icp.se3 import Array

POINTS = 20_000
"""About so many points of each cloud are drawn."""

SMALLEST_SIDE, LARGEST_SIDE = 160, 4096
"""Pixels that a film has each way, at least and at most."""

FASTEST = 60
"""Most frames a second."""


def animate(
    path: str | os.PathLike[str],
    result: RegistrationResult,
    source: PreparedCloud | PointCloudLike | None = None,
    target: PreparedCloud | PointCloudLike | None = None,
    *,
    init: ArrayLike | None = None,
    preset: str | Registrar = presets.DEFAULT,
    recording: Recording | None = None,
    truth: ArrayLike | None = None,
    fps: int = 20,
    size: tuple[int, int] = (960, 540),
    seconds: float = 4.0,
    dark: bool = False,
    names: Names | None = None,
    method: str | None = None,
    unit: str | None = "m",
    on_progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Write a film of a registration; the file appears whole or not at all.

    It goes through the poses of ``result.history``, one picture each, and decides at each who is
    an inlier (of Algorithm 1 alone, these are its labels). What stands between two iterations is
    interpolated and says so, in words and by a hollow mark on the time line.

    Parameters
    ----------
    path
        ``.gif``, or ``.mp4`` (``pip install 'hmrf-icp[film]'``).
    result, source, target
        As for :func:`hmrf_icp.plot.before_after`.
    init, preset
        As they were given to ``register``.
    recording
        What the registration told (:class:`Recording`): where the candidates of a search ended
        that were not kept is shown too.
    truth
        (4, 4) the true pose, source to target, if it is known: errors are told against it, and
        without it what is left to the result.
    fps
        Frames a second, 1 to 60.
    size
        Width and height, pixels; even numbers.
    seconds
        From the start to the result; more where there are more iterations than frames.
    dark
        Whether on a dark ground.
    names, method, unit
        As for :func:`hmrf_icp.plot.before_after`; ``method`` is the preset's name if None.
    on_progress
        Called with the number of pictures drawn and of all.

    Returns
    -------
    The path.

    Raises
    ------
    InputError
        The file cannot be written, a number is out of its range, a pose is not rigid, or the
        clouds are missing or others.
    MissingDependencyError
        MP4 is asked for and imageio-ffmpeg is not installed.
    """
    check_numbers(fps, size, seconds)
    check_film(path)
    chosen = presets.preset(preset) if isinstance(preset, str) else preset
    if method is None and isinstance(preset, str):
        method = preset
    pair = Pair.of(result, source, target)
    start = pair.between(se3.as_rigid(init))
    known = None if truth is None else se3.as_rigid(truth, "truth")
    states = states_of(pair, result, start, chosen)
    tried = () if recording is None else recording.tried(result)
    shots = shots_of(pair, states, tried, fps, seconds)
    film = RegistrationFilm(pair, result, shots, known, size, dark, names, method, Lengths(unit))
    write_film(path, film, fps, on_progress)
    return Path(path)


def check_numbers(fps: int, size: tuple[int, int], seconds: float) -> None:
    """Refuse what no film can be.

    Raises
    ------
    InputError
        A number is out of its range.
    """
    if not 1 <= fps <= FASTEST:
        raise InputError(f"fps: expected 1 to {FASTEST} frames a second, got {fps}")
    if not all(SMALLEST_SIDE <= side <= LARGEST_SIDE and side % 2 == 0 for side in size):
        raise InputError(
            f"size: expected even numbers of pixels from {SMALLEST_SIDE} to {LARGEST_SIDE}, "
            f"got {size[0]} x {size[1]}"
        )
    if not (math.isfinite(seconds) and 0.0 < seconds <= 600.0):
        raise InputError(f"seconds: expected more than 0 and at most 600, got {seconds:g}")


class RegistrationFilm:
    """The pictures of a film, drawn when they are asked for."""

    def __init__(
        self,
        pair: Pair,
        result: RegistrationResult,
        shots: Sequence[Shot],
        truth: Array | None,
        size: tuple[int, int],
        dark: bool,
        names: Names | None,
        method: str | None,
        lengths: Lengths,
    ) -> None:
        self._pair, self._result, self._shots, self._truth = pair, result, shots, truth
        self._lengths = lengths
        organised = pair.source.cloud.organised
        candidates = any(shot.kind == "candidate" for shot in shots)
        self._screen = Screen(size, dark, organised, candidates, result, names, method, lengths)
        self._view = view = View.of(pair, POINTS)
        width, height = self._screen.stage
        poses = [shot.pose for shot in shots if shot.kind != "candidate"]
        self._limits = view.limits([poses[0], poses[-1]], width / height)
        self._screen.scale(self._limits)
        self._staying = lit(view.staying, _same(palette.TARGET, len(view.stayed)), view.frame)
        of = max(shot.place for shot in shots)
        self._screen.timeline([shot.place for shot in shots if shot.kind != "between"], of)

    @property
    def frames(self) -> list[int]:
        """For how many frames each of the pictures is shown."""
        return [shot.frames for shot in self._shots]

    def draw(self, number: int) -> NDArray[np.uint8]:
        """Draw a picture (H, W, 3)."""
        shot, view, screen = self._shots[number], self._view, self._screen
        moving = view.moving.moved(shot.pose)
        if shot.probability is None:
            colours = _same(palette.SOURCE, len(view.kept))
        else:
            colours = palette.between(shot.probability[view.kept])
        layers = [(view.staying, self._staying), (moving, lit(moving, colours, view.frame))]
        screen.show(paint(layers, view.frame, self._limits, screen.stage))
        if self._pair.source.cloud.organised:
            screen.map(self._map(shot))
        screen.say(shot, self._far(shot.pose))
        return screen.pixels()

    def _far(self, pose: Array) -> str:
        """Say how far a pose is from the true one, or from the result."""
        given = between_frames(pose, self._pair.source, self._pair.target)
        goal = self._result.transformation if self._truth is None else self._truth
        metres, radians = se3.error(given, goal)
        far = f"{self._lengths.text(metres)}, {math.degrees(radians):.2f} deg"
        if self._truth is not None:
            return f"error {far}"
        return "" if pose is self._shots[-1].pose else f"to the result {far}"

    def _map(self, shot: Shot) -> NDArray[Any]:
        """Image (H, W, 4) of the labels, clear where unobserved."""
        cloud = self._pair.source.cloud
        image = np.zeros((*cloud.shape, 4))
        chance = shot.probability
        seen = _same(palette.SOURCE, len(cloud)) if chance is None else palette.between(chance)
        image[cloud.observed] = np.column_stack([seen, np.ones(len(cloud))])
        return image


def _same(colour: str, number: int) -> Array:
    return np.tile(palette.rgb(colour), (number, 1))
