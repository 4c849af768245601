"""A recording: frames, where the sensor stood for each, and how to load what it saw."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol, TypeAlias

import numpy as np

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.distorted_camera import Camera
from hmrf_icp.errors import InputError
from hmrf_icp.se3 import Array, as_rigid

Sensor: TypeAlias = Literal["depth camera", "lidar", "cloud"]
"""What made the frames; "cloud" is anything that left unorganised points."""

Progress: TypeAlias = Callable[[str, int, "int | None"], None]
"""Called with what is being done ("download", "unpack"), bytes done, and bytes in all if known."""


class Scan(Protocol):
    """What a sensor saw, not loaded yet.

    Frames are sent to other processes: a scan holds a path or a recipe, never pixels.
    """

    def load(self) -> PointCloud:
        """Return the points, metres, in the sensor's own frame."""


@dataclass(frozen=True)
class DepthMap:
    """A depth map in a file.

    Parameters
    ----------
    path
        Anything that `hmrf_icp.io.read_depth` reads.
    camera
        Its intrinsics.
    depth_scale
        Units of the file per metre; None as in `PointCloud.from_depth`.
    """

    path: Path
    camera: Camera
    depth_scale: float | None = None

    def load(self) -> PointCloud:
        """Unproject the file into an organised cloud.

        Raises
        ------
        InputError
            The file is missing, damaged, or of another size than the camera's.
        """
        from hmrf_icp.io import read_depth

        depth = read_depth(self.path)
        try:
            return PointCloud.from_depth(depth, self.camera, self.depth_scale)
        except InputError as error:
            raise InputError(f"{self.path}: {error}") from None


@dataclass(frozen=True, eq=False)
class Frame:
    """One view of a recording.

    Parameters
    ----------
    index
        Its number in the recording. Frames that are left out leave a gap.
    pose
        (4, 4) float64, sensor to world, metres.
    scan
        What the sensor saw.
    timestamp
        Seconds, None where the recording has none.
    scene
        Tells frames of one number apart where a data set has several scenes.

    Raises
    ------
    InputError
        The pose is not rigid.
    """

    index: int
    pose: Array
    scan: Scan
    timestamp: float | None = None
    scene: str = ""

    def __post_init__(self) -> None:
        """Check and freeze the pose."""
        pose = as_rigid(self.pose, f"frame {self.index}: pose")
        pose.flags.writeable = False
        object.__setattr__(self, "pose", pose)

    def load(self) -> PointCloud:
        """Read the points, metres, in the sensor's own frame.

        Raises
        ------
        InputError
            Its file is missing or damaged.
        """
        return self.scan.load()


@dataclass(frozen=True, eq=False)
class Sequence:
    """Two frames or more with poses in one world.

    The true transformation from a source frame to a target frame is
    ``inverse(target.pose) @ source.pose``.

    Parameters
    ----------
    name
        What to call it in reports.
    format
        Name of the format that it was read as.
    frames
        In the order of recording.
    sensor
        What made them.
    camera
        Intrinsics of a depth camera, None for other sensors.
    source
        Its folder, None for one that is made on the spot.
    notes
        What a reader of results should know: what was left out, what was assumed.

    Raises
    ------
    InputError
        Fewer than two frames.
    """

    name: str
    format: str
    frames: tuple[Frame, ...]
    sensor: Sensor
    camera: Camera | None = None
    source: Path | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse what holds no pair."""
        if len(self.frames) < 2:
            why = f" ({'; '.join(self.notes)})" if self.notes else ""
            raise InputError(
                f"{self.source or self.name}: {len(self.frames)} usable frame"
                f"{'' if len(self.frames) == 1 else 's'} in this {self.format} sequence, "
                f"expected at least two{why}"
            )

    def __len__(self) -> int:
        return len(self.frames)

    def frame(self, index: int) -> Frame:
        """Return the frame with this number in the recording.

        Raises
        ------
        InputError
            There is none; the message names the nearest.
        """
        found = next((frame for frame in self.frames if frame.index == index), None)
        if found is not None:
            return found
        numbers = np.array([frame.index for frame in self.frames])
        nearest = numbers[np.abs(numbers - index).argmin()]
        raise InputError(
            f"{self.name}: no frame {index} among {len(self.frames)} numbered "
            f"{numbers.min()} to {numbers.max()}; the nearest is {nearest}"
        )

    def __repr__(self) -> str:
        return f"Sequence({self.name!r}, {self.format}, {self.sensor}, {len(self)} frames)"
