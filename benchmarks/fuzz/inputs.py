"""Damaged files by number, and the readers that they are for."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import seeds
from mutations import mutated, restructured

RECORDINGS = 0.02
"""Share of inputs that are a recording with one file damaged."""
WRITTEN = 0.2
"""Share of the clouds that were read which are written again, in some format."""


class Inputs:
    """All inputs of a seed, by number, and how each is read; files of some kinds or of all."""

    def __init__(self, seed: int, folder: Path, kinds: Sequence[str] = ()) -> None:
        self.seed, self.folder, self.kinds = seed, folder, kinds
        self.files, self.recordings = seeds.files(), seeds.recordings()
        self.others = [content for _, content in self.files.values()]
        for layout, content in self.recordings.items():
            for name, data in content.items():
                path = folder / layout / name
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(data)

    def read(self, number: int) -> tuple[str, str]:
        """Make an input and read it: its kind, and whether it was read or refused.

        Raises
        ------
        What a reader should not.
        """
        from hmrf_icp import InputError

        kind, recording, rng = self.chosen(number)
        try:
            (self._recording if recording else self._file)(rng, kind)
        except InputError as error:
            memory = isinstance(error.__cause__, MemoryError)
            return kind, "out of memory" if memory else "refused"
        return kind, "read"

    def chosen(self, number: int) -> tuple[str, bool, random.Random]:
        """Tell of which kind an input is, whether that is a recording, and what else draws it."""
        rng = random.Random(f"{self.seed} {number}")
        if self.kinds:
            return rng.choice(self.kinds), False, rng
        recording = rng.random() < RECORDINGS
        return rng.choice([*(self.recordings if recording else self.files)]), recording, rng

    def _file(self, rng: random.Random, kind: str) -> None:
        suffix, content = self.files[kind]
        if rng.random() < 0.6:
            content = restructured(rng, suffix, content, self.others)
        else:
            content = mutated(rng, content, self.others)
        path = self.folder / (f"input{suffix}" if suffix[0] == "." else "input.txt")
        path.write_bytes(content)
        result = READERS.get(suffix, _read_cloud)(path)
        if result is not None and rng.random() < WRITTEN:
            from hmrf_icp.io import WRITABLE, write_cloud

            write_cloud(self.folder / f"output{rng.choice(WRITABLE)}", result)

    def _recording(self, rng: random.Random, layout: str) -> None:
        from hmrf_icp.datasets import open_sequence

        name = rng.choice(sorted(self.recordings[layout]))
        path, whole = self.folder / layout / name, self.recordings[layout][name]
        path.write_bytes(mutated(rng, whole, self.others))
        try:
            for frame in open_sequence(self.folder / layout).frames:
                frame.load()
        finally:
            path.write_bytes(whole)


def _read_cloud(path: Path) -> Any:
    import numpy as np

    from hmrf_icp import PinholeCamera, PointCloud
    from hmrf_icp.io.cloud import read_any, unproject

    # One mesh in eight as people read it, the others with fewer points, which takes less time.
    content = read_any(path, None if path.stat().st_size % 8 == 0 else 500)
    if not isinstance(content, PointCloud):
        height, width = content.shape
        if content.size > 1_000_000:
            return None
        camera = PinholeCamera(width, height, 8.0, 8.0, width / 2, height / 2)
        content = unproject(path, content, camera)
    if np.isinf(content.points).any():
        raise AssertionError("a point at infinity")
    return content


def _read_pose(path: Path) -> None:
    from hmrf_icp.io import read_pose

    read_pose(path)


def _read_camera(path: Path) -> None:
    import numpy as np

    from hmrf_icp import PointCloud
    from hmrf_icp.io import read_intrinsics

    lens = read_intrinsics(path)
    # The smallest images of a Kinect, which is a camera for several sizes.
    width, height = (320, 288) if lens.others else (8, 6)
    PointCloud.from_depth(np.ones((height, width)), lens.for_image(width, height))


READERS: dict[str, Callable[[Path], Any]] = {"pose": _read_pose, "camera": _read_camera}
