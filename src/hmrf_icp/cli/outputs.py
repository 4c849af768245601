"""The files that a registration is written to: the moved cloud, the matrix, the picture."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from hmrf_icp.cli.loudness import note
from hmrf_icp.errors import InputError

if TYPE_CHECKING:
    from hmrf_icp.clouds.cloud import PointCloud
    from hmrf_icp.result import RegistrationResult
    from hmrf_icp.se3 import Array
    from hmrf_icp.view.story import Story

FIGURE_SUFFIXES = (".png", ".pdf", ".svg")

KEEPING = (".ply", ".pcd", ".csv", ".npz")
"""Formats that have a place for all that a point has."""


@dataclass(frozen=True)
class Outputs:
    """The files that a registration is written to; None is not asked for."""

    cloud: Path | None
    pose: Path | None
    figure: Path | None
    html: Path | None = None
    rrd: Path | None = None

    @property
    def files(self) -> list[tuple[str, Path]]:
        """Each that is asked for, with its option."""
        named = {
            "--output": self.cloud,
            "--pose": self.pose,
            "--figure": self.figure,
            "--html": self.html,
            "--rrd": self.rrd,
        }
        return [(option, file) for option, file in named.items() if file is not None]

    def in_folders(self, stem: str, source: Path) -> Outputs:
        """Name the files of one pair of many, taking these here for folders.

        The moved cloud is of the source's format where that keeps all that a cloud has.
        """
        suffix = source.suffix.lower() if source.suffix.lower() in KEEPING else ".ply"
        return Outputs(
            cloud=self.cloud and self.cloud / f"{stem}{suffix}",
            pose=self.pose and self.pose / f"{stem}.txt",
            figure=self.figure and self.figure / f"{stem}.png",
        )

    def check(self, inputs: list[Path]) -> None:
        """Refuse what could not be written in the end, before minutes are spent on it."""
        from hmrf_icp.io.cloud import check_writable
        from hmrf_icp.io.files import check_suffix
        from hmrf_icp.io.whole import require_writable

        if self.cloud is not None:
            check_writable(self.cloud)
        if self.pose is not None:
            require_writable(self.pose)
        if self.figure is not None:
            check_suffix(self.figure, FIGURE_SUFFIXES, "draw a figure to")
            require_writable(self.figure)
        if self.html is not None:
            require_writable(self.html)
        if self.rrd is not None:
            from hmrf_icp.view.rerun import require_rerun

            require_writable(self.rrd)
            require_rerun()
        taken = {path.resolve(): "is an input of this run" for path in inputs}
        for option, file in self.files:
            if file.resolve() in taken:
                raise InputError(f"{option} {file}: {taken[file.resolve()]}, give another name")
            taken[file.resolve()] = f"is what {option} writes"

    def write(
        self,
        source: PointCloud,
        target: PointCloud,
        result: RegistrationResult,
        start: Array | None = None,
        names: tuple[str, str] | None = None,
        method: str | None = None,
        told: Story | None = None,
    ) -> list[Path]:
        """Write them all; none of them moves to its place before every one is complete.

        The start, the names of the clouds and the method are what the figure says; ``told`` is
        what the page and the recording show.
        """
        from hmrf_icp.clouds.moved import moved
        from hmrf_icp.io import write_cloud, write_pose
        from hmrf_icp.io.cloud import dropped
        from hmrf_icp.io.whole import written_whole

        with ExitStack() as outputs:
            if self.cloud is not None:
                partial = outputs.enter_context(written_whole(self.cloud))
                write_cloud(partial, moved(source, result.transformation))
                lost = dropped(self.cloud, source)
                if lost:
                    note(
                        f"{self.cloud.suffix} has no place for the source's "
                        f"{', '.join(lost[:8])}{' and more' if len(lost) > 8 else ''}; "
                        ".ply, .pcd, .csv and .npz have"
                    )
            if self.pose is not None:
                write_pose(outputs.enter_context(written_whole(self.pose)), result.transformation)
            if self.figure is not None:
                from hmrf_icp.figures.registration import registration_figure

                partial = outputs.enter_context(written_whole(self.figure))
                registration_figure(
                    source, target, result, partial, start, names=names, method=method
                )
            if told is not None and self.html is not None:
                from hmrf_icp.view import write_html

                write_html(told, outputs.enter_context(written_whole(self.html)))
            if told is not None and self.rrd is not None:
                from hmrf_icp.view import write_rrd

                write_rrd(told, outputs.enter_context(written_whole(self.rrd)))
        return [file for _, file in self.files]
