"""One run done again from the data, so that it can be looked at."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import datasets, se3
from hmrf_icp.errors import HmrfIcpError, InputError, RegistrationWarning
from hmrf_icp.evaluate import peers
from hmrf_icp.evaluate.configuration import Configuration
from hmrf_icp.evaluate.methods import NamedMethod, own_methods
from hmrf_icp.evaluate.plain import plain
from hmrf_icp.evaluate.prepared import Prepared
from hmrf_icp.evaluate.progress import Progress, silent
from hmrf_icp.evaluate.protocol import Axes, Pair, Start, perturbed, true_transformation
from hmrf_icp.evaluate.report.page import ShownRun
from hmrf_icp.evaluate.report.pictures import Scene, draw_scene
from hmrf_icp.evaluate.report.runs import Runs
from hmrf_icp.evaluate.report.study import Study
from hmrf_icp.evaluate.report.style import Drawing
from hmrf_icp.evaluate.report.worst import WorstRun, worst_runs
from hmrf_icp.evaluate.sources import PairSource, source_of
from hmrf_icp.evaluate.work import Clouds

Array = NDArray[np.float64]

RENDERED = "synthetic"
"""Beginning of the names of data sets that are made on the spot, and so are always there."""

MOST_AXES = 1_000_000
"""An evaluation has some dozen."""

SAME = 1e-4
"""A run done again that ends within this many metres and radians of its row ended the same."""


def shown_runs(study: Study, count: int, report: Progress = silent) -> tuple[list[ShownRun], str]:
    """Choose the worst runs and draw each of them, and report how many are drawn.

    Returns
    -------
    The runs, and a sentence that says why they have no picture (empty where
    they have).
    """
    worst = worst_runs(study, count)
    if not worst:
        return [], ""
    try:
        replay = Replay.of(study)
        drawn = []
        for place, run in enumerate(worst, 1):
            report("Drawing the worst runs", place - 1, len(worst))
            drawn.append(replay.draw(study, run, f"worst-{place}"))
    except (HmrfIcpError, OSError) as error:
        reason = plain(str(error))
        return [ShownRun(run, None) for run in worst], f"There are no pictures: {reason}."
    return [ShownRun(run, drawing) for run, drawing in zip(worst, drawn, strict=True)], ""


@dataclass(frozen=True, eq=False)
class Problem:
    """What a run was given.

    Attributes
    ----------
    source, target
        The clouds.
    init, truth
        (4, 4) the start, None where there was none, and the true pose.
    """

    source: Prepared
    target: Prepared
    init: Array | None
    truth: Array


@dataclass(frozen=True, eq=False)
class Replay:
    """The data of an evaluation, and the starts that it used.

    Attributes
    ----------
    source
        Where the pairs come from.
    clouds
        How frames become the clouds that are registered.
    axes
        The directions of the starts.
    from_camera
        Whether the target was seen from the origin of its frame, which is where to look from.
    methods
        By name.
    """

    source: PairSource
    clouds: Clouds
    axes: Axes
    from_camera: bool
    methods: Mapping[str, NamedMethod]

    @classmethod
    def of(cls, study: Study) -> Replay:
        """Open the data that ``config.json`` names; nothing is downloaded.

        Raises
        ------
        InputError
            It does not name any, or they are not there any more.
        """
        config = study.config
        try:
            dataset = str(config["dataset"])
            subsample, axes, seed = (int(config[key]) for key in ("subsample", "axes", "seed"))
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise InputError(f"config.json does not say how the runs were made ({error})") from None
        if not (0 < axes <= MOST_AXES and seed >= 0 and subsample > 0):
            raise InputError(
                f"config.json has {axes} axes, the seed {seed} and a step of {subsample}; "
                "no run can have been made so"
            )
        if not dataset.startswith(RENDERED) and not Path(dataset).is_dir():
            raise InputError(f"the data are not at {dataset}")
        data = datasets.open_dataset(dataset)
        return cls(
            source_of(data, Configuration(dataset)),
            Clouds("replay", subsample, bool(config.get("points_alone", False))),
            Axes.random(axes, seed),
            isinstance(data, datasets.Sequence) and data.sensor == "depth camera",
            {**own_methods(), **peers.catalogue()},
        )

    def problem(self, study: Study, index: int) -> Problem:
        """Read what the run of a row was given.

        Raises
        ------
        InputError
            A frame cannot be read, or the row is none of this evaluation.
        """
        row = study.runs.where(np.array([index]))
        axis = _whole(row, "axis")
        if axis >= len(self.axes):
            raise InputError(f"row {row.line[0]} has axis {axis} of {len(self.axes)}")
        place = study.scenes.get(str(row["pair"][0]), "")
        overlap = float(row["overlap"][0])
        pair = Pair(_whole(row, "target"), _whole(row, "source"), overlap, place)
        posed = self.source.posed(pair)
        source, target = (self.clouds.prepare(frame) for frame in (posed.source, posed.target))
        truth = true_transformation(posed.source.pose, posed.target.pose)
        start = Start(float(row["angle"][0]), posed.unit * float(row["translation"][0]))
        init = None
        if start.given:
            init = perturbed(truth, source.centroid, self.axes, axis, start)
        return Problem(source, target, init, truth)

    def draw(self, study: Study, run: WorstRun, name: str) -> Drawing:
        """Register the pair again and draw what came out.

        Raises
        ------
        InputError
            A frame cannot be read, or the method is not in this installation.
        """
        row = study.runs.where(np.array([run.index]))
        problem = self.problem(study, run.index)
        source, target, init, truth = (
            problem.source,
            problem.target,
            problem.init,
            problem.truth,
        )
        end = None
        caption = ""
        if not row.failed[0]:
            end = self.registered(str(row["method"][0]), source, target, init)
            metres, radians = se3.error(end, truth)
            recorded = float(row["error_m"][0]), float(row["error_rad"][0])
            if not (
                math.isclose(metres, recorded[0], rel_tol=0.01, abs_tol=SAME)
                and math.isclose(radians, recorded[1], rel_tol=0.01, abs_tol=SAME)
            ):
                caption = (
                    f"Done again for this picture, the run ended {metres:.3g} m and {radians:.3g} "
                    "rad off: not as in its row, so versions or data have changed since."
                )
        scene = Scene(
            source.points,
            target.points,
            np.eye(4) if init is None else init,
            end,
            truth,
            from_camera=self.from_camera,
        )
        return draw_scene(scene, name, f"{run.title}: {run.facts}.", caption)

    def registered(
        self, name: str, source: Prepared, target: Prepared, init: Array | None
    ) -> Array:
        """Return the pose (4, 4) that a method gives.

        Raises
        ------
        InputError
            It gives none, or is not in this installation.
        """
        if name not in self.methods:
            raise InputError(f"there is no method called {name} in this installation")
        with warnings.catch_warnings():
            # What the method had to say of these clouds, it said when it was evaluated.
            warnings.simplefilter("ignore", RegistrationWarning)
            try:
                outcome = self.methods[name].register(source, target, init)
                return se3.as_rigid(outcome.transformation, "its pose")
            except Exception as error:  # of a library of others, or of one that has changed since
                kind = type(error).__name__
                raise InputError(f"{name}, done again, gave no pose ({kind}: {error})") from error


def _whole(row: Runs, column: str) -> int:
    """Read a cell as a number from zero on."""
    word = str(row[column][0])
    if not re.fullmatch(r"[0-9]{1,9}", word):
        raise InputError(f"row {row.line[0]} has the {column} {word!r}, expected a whole number")
    return int(word)
