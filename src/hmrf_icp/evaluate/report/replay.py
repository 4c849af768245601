"""One run done again from the data, so that it can be looked at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.errors import HmrfIcpError, InputError
from hmrf_icp.evaluate import peers
from hmrf_icp.evaluate.methods import Method, own_methods
from hmrf_icp.evaluate.prepared import Prepared
from hmrf_icp.evaluate.protocol import Axes, Start, perturbed, true_transformation
from hmrf_icp.evaluate.report.page import ShownRun
from hmrf_icp.evaluate.report.pictures import Scene, draw_scene
from hmrf_icp.evaluate.report.study import Study
from hmrf_icp.evaluate.report.worst import WorstRun, worst_runs

Array = NDArray[np.float64]


def shown_runs(study: Study, count: int) -> tuple[list[ShownRun], str]:
    """Choose the worst runs and draw each of them.

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
        shown = [
            ShownRun(run, replay.draw(study, run, f"worst-{n}")) for n, run in enumerate(worst, 1)
        ]
    except (HmrfIcpError, OSError) as error:
        return [ShownRun(run, None) for run in worst], f"There are no pictures: {error}."
    return shown, ""


@dataclass(frozen=True, eq=False)
class Replay:
    """The data of an evaluation, and the starts that it used.

    Attributes
    ----------
    sequence
        The recording.
    subsample
        Step of rows and columns.
    axes
        The directions of the starts.
    methods
        By name.
    """

    sequence: Any
    subsample: int
    axes: Axes
    methods: Mapping[str, Method]

    @classmethod
    def of(cls, study: Study) -> Replay:
        """Open the data that ``config.json`` names.

        Raises
        ------
        InputError
            It does not name any, or they are not there any more.
        """
        from hmrf_icp.datasets import open_sequence

        config = study.config
        dataset = config.get("dataset")
        if not isinstance(dataset, str):
            raise InputError("config.json does not name the data set")
        if dataset != "synthetic" and not Path(dataset).is_dir():
            raise InputError(f"the data are not at {dataset}")
        catalogue = dict(own_methods())
        catalogue.update({m.name: m for family in peers.FAMILIES for m in family.methods()})
        return cls(
            open_sequence(dataset),
            int(config.get("subsample", 1)),
            Axes.random(int(config["axes"]), int(config["seed"])),
            catalogue,
        )

    def draw(self, study: Study, run: WorstRun, name: str) -> Any:
        """Register the pair again and draw what came out."""
        row = study.runs.where(np.array([run.index]))
        frames = [self.sequence.frame(int(row[role][0])) for role in ("source", "target")]
        source, target = (
            Prepared(frame.load().subsample(self.subsample), frame.index) for frame in frames
        )
        truth = true_transformation(frames[0].pose, frames[1].pose)
        start = Start(float(row["angle"][0]), float(row["translation"][0]))
        init = perturbed(truth, source.centroid, self.axes, int(row["axis"][0]), start)
        end = None
        if not row.failed[0]:
            end = self.methods[str(row["method"][0])].register(source, target, init).transformation
        scene = Scene(
            source.points,
            target.points,
            init,
            end,
            truth,
            from_camera=self.sequence.sensor == "depth camera",
        )
        return draw_scene(scene, name, f"{run.title}: {run.facts}.")
