"""A story as a recording of rerun, for those who look at their data there."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.drawing.palette import rgb
from hmrf_icp.errors import MissingDependencyError
from hmrf_icp.io.whole import written_whole
from hmrf_icp.view.story import AGREEMENT, Story

FAINT = 90
"""Opacity of the lines of sight, of 255."""


def require_rerun() -> Any:
    """Import rerun.

    Raises
    ------
    MissingDependencyError
        It is not installed.
    """
    try:
        import rerun
    except ImportError:
        raise MissingDependencyError(
            "a recording of rerun needs rerun-sdk, which is not installed: "
            "pip install 'hmrf-icp[rerun]'"
        ) from None
    return rerun


def write_rrd(story: Story, path: str | os.PathLike[str]) -> None:
    """Write a story as a recording, with the timeline ``moment``; its viewer is not started.

    The clouds are coloured by agreement with the other's view, lines of sight that the pose puts
    something into are drawn, and every number that was reported is a plot.

    Raises
    ------
    MissingDependencyError
        rerun-sdk is not installed.
    InputError
        It cannot be written there.
    """
    rr = require_rerun()
    with written_whole(path) as partial:
        stream = rr.RecordingStream("hmrf-icp")
        stream.save(os.fspath(partial))
        _log(rr, stream, story)
        stream.flush()
        stream.disconnect()


def _log(rr: Any, stream: Any, story: Story) -> None:
    words = f"# {story.title}\n\n**{story.said.verdict}** {story.said.advice}\n\n"
    words += "\n".join(f"* {name}: {value}" for name, value in story.said.facts)
    stream.log("result", rr.TextDocument(words, media_type="text/markdown"), static=True)
    if story.said.free:
        ways = np.array([one.direction for one in story.said.free])
        stream.log(
            "clouds/free",
            rr.Arrows3D(
                vectors=ways * 0.3 * _size(story.target.points),
                origins=[one.through for one in story.said.free],
                labels=[one.text for one in story.said.free],
            ),
            static=True,
        )
    for name, cloud in (("source", story.source), ("target", story.target)):
        where = rr.Points3D(cloud.points, radii=0.5 * cloud.spacing)
        stream.log(f"clouds/{name}/points", where, static=True)
    colours = np.array([(255 * rgb(one)).astype(np.uint8) for one in AGREEMENT])
    for number, moment in enumerate(story.moments):
        stream.set_time("moment", sequence=number)
        stream.log("title", rr.TextLog(moment.title))
        pose = moment.pose
        placed = rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3])
        stream.log("clouds/source", placed)
        for name, codes in (("source", moment.of_source), ("target", moment.of_target)):
            coloured = rr.Points3D.from_fields(colors=colours[codes])
            stream.log(f"clouds/{name}/points", coloured)
        stream.log(
            "clouds/rays", rr.LineStrips3D(story.rays(moment), colors=[(*colours[1], FAINT)])
        )
        for name, value in moment.numbers.items():
            stream.log(["numbers", name], rr.Scalars(value))
        if story.image is not None:
            stream.log("image/distance", rr.DepthImage(_laid(moment.distance, story.image)))


def _laid(values: NDArray[np.float32], rows: NDArray[np.int32]) -> NDArray[np.float32]:
    return np.where(rows < 0, np.float32(0.0), values[rows])


def _size(points: NDArray[np.float32]) -> float:
    return float(np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean()))
