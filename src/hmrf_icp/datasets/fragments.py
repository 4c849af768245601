"""Fragments: clouds fused from many views, each in a frame of its own, with a pose file each."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.datasets.folders import files_in, numbered
from hmrf_icp.datasets.formats import Format
from hmrf_icp.datasets.sequence import Frame, Sequence

_SUFFIXES = (".ply", ".pcd")


@dataclass(frozen=True)
class Fragment:
    """A cloud in a file. Nothing is said of where it was seen from: many places, as a rule."""

    path: Path

    def load(self) -> PointCloud:
        """Read the points; a viewpoint is known only where the file itself has one.

        Raises
        ------
        InputError
            The file is missing or damaged.
        """
        from hmrf_icp.io import read_cloud

        return read_cloud(self.path)


def open_fragments(folder: Path) -> Sequence:
    """Open a folder of ``NAME.ply`` or ``NAME.pcd`` with ``NAME.pose.txt`` beside each.

    The matrix takes the fragment to the world.

    Raises
    ------
    InputError
        A pose is malformed or not rigid; fewer than two fragments have one.
    """
    from hmrf_icp.io.pose import read_pose

    files = numbered(files_in(folder, *_SUFFIXES))
    frames = tuple(
        Frame(index, read_pose(_pose_of(file)), Fragment(file))
        for index, file in files
        if _pose_of(file).is_file()
    )
    notes = ["no viewpoint is known of fragments"]
    if len(frames) < len(files):
        notes.append(f"{len(files) - len(frames)} of {len(files)} fragments left out: no pose")
    return Sequence(folder.name, FORMAT.name, frames, "cloud", None, folder, tuple(notes))


def _pose_of(file: Path) -> Path:
    return file.with_name(f"{file.stem}.pose.txt")


FORMAT = Format(
    "fragments with poses",
    "*.ply or *.pcd, each with *.pose.txt",
    lambda folder: any(_pose_of(file).is_file() for file in files_in(folder, *_SUFFIXES)),
    open_fragments,
)
