"""Benchmarks of fragments: 3DMatch, 3DLoMatch, and the Redwood scenes whose layout they took.

Choi, Zhou and Koltun (CVPR 2015); Zeng et al. (CVPR 2017); Huang et al. (CVPR 2021).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hmrf_icp.datasets.criterion import LARGEST_RMSE, MatchedRmse
from hmrf_icp.datasets.folders import files_in, numbered
from hmrf_icp.datasets.formats import Format
from hmrf_icp.datasets.fragments import Fragment
from hmrf_icp.datasets.pair_set import ListedPair, PairSet
from hmrf_icp.datasets.tables import Row, read_rows
from hmrf_icp.errors import InputError
from hmrf_icp.se3 import Array

LOG, INFORMATION, OVERLAP = "gt.log", "gt.info", "gt_overlap.log"

_CLOUD = "cloud_bin_"


def open_fragment_benchmark(folder: Path) -> PairSet:
    """Open one scene, or a folder of scenes.

    A scene has clouds ``cloud_bin_N.ply``, and beside them or in a sub-folder
    (``3DMatch/``, ``3DLoMatch/``; its name is the benchmark's) or in ``SCENE-evaluation/``
    the files ``gt.log`` (pair i, j, and the matrix that takes cloud j to cloud i) and ``gt.info``.
    The benchmarks count pairs with j > i + 1. ``gt_overlap.log`` (i, j, overlap) is read where
    it is; else the overlap is measured.

    Raises
    ------
    InputError
        A file is missing or malformed, or a pair names a cloud that is not there.
    """
    scenes = [folder] if _is_scene(folder) else _scenes_in(folder)
    pairs = [pair for scene in scenes for pair in _pairs(scene)]
    # All scenes of one benchmark, then all of the next.
    order = list(dict.fromkeys(pair.benchmark for pair in pairs))
    pairs.sort(key=lambda pair: order.index(pair.benchmark))
    criterion = (
        f"the root mean square error of the pair's true matches (gt.info) is at most "
        f"{LARGEST_RMSE:g} m"
    )
    notes = ("pairs of consecutive fragments are left out, as by the benchmarks",)
    return PairSet(folder.name, FORMAT.name, tuple(pairs), criterion, True, folder, notes)


def _clouds(scene: Path) -> list[Path]:
    return [path for path in files_in(scene, ".ply") if path.name.startswith(_CLOUD)]


def _is_scene(folder: Path) -> bool:
    return bool(_clouds(folder)) and bool(_lists(folder))


def _scenes_in(folder: Path) -> list[Path]:
    return [path for path in sorted(folder.iterdir()) if path.is_dir() and _is_scene(path)]


def _lists(scene: Path) -> list[tuple[str, Path]]:
    """Names of the scene's benchmarks, and the folders of their files."""
    inside = [(path.name, path) for path in sorted(scene.iterdir()) if (path / LOG).is_file()]
    # 3DMatch before 3DLoMatch, the harder one.
    inside.sort(key=lambda item: ("lo" in item[0].lower(), item[0]))
    beside = scene.with_name(f"{scene.name}-evaluation")
    return inside + [("", path) for path in (scene, beside) if (path / LOG).is_file()]


def _pairs(scene: Path) -> Iterator[ListedPair]:
    clouds = {number: Fragment(path) for number, path in numbered(_clouds(scene))}
    for benchmark, folder in _lists(scene):
        poses = _blocks(folder / LOG, 4)
        information = _blocks(folder / INFORMATION, 6)
        overlaps = _overlaps(folder / OVERLAP) if (folder / OVERLAP).is_file() else {}
        for (i, j), (head, pose) in poses.items():
            if j <= i + 1:
                continue
            for number in (i, j):
                if number not in clouds:
                    raise InputError(
                        f"{head.place}: a pair with cloud {number}, but there is no "
                        f"{scene / f'{_CLOUD}{number}.ply'}"
                    )
            if (i, j) not in information:
                raise InputError(f"{folder / INFORMATION}: no block for the pair {i} {j} of {LOG}")
            matrix = information[i, j][1]
            if not matrix[0, 0] > 0:
                raise InputError(
                    f"{information[i, j][0].place}: expected a positive number of matches at the "
                    f"head of the matrix, found {matrix[0, 0]:g}"
                )
            yield ListedPair(
                benchmark,
                scene.name,
                i,
                j,
                clouds[i],
                clouds[j],
                head.rigid(pose),
                MatchedRmse(matrix),
                overlaps.get((i, j)),
            )


def _blocks(path: Path, size: int) -> dict[tuple[int, int], tuple[Row, Array]]:
    """Blocks of a log: a line with i, j and a count, then a matrix (size, size)."""
    rows = read_rows(path)
    blocks = {}
    for first in range(0, len(rows), size + 1):
        head, body = rows[first], rows[first + 1 : first + 1 + size]
        if len(head.words) != 3 or not all(word.lstrip("-").isdigit() for word in head.words):
            raise head.fail(f"three integers before a {size} x {size} matrix")
        if len(body) < size:
            raise InputError(
                f"{rows[-1].place}: the file ends inside the block of line {head.line}"
            )
        for row in body:
            if len(row.words) != size:
                raise row.fail(f"{size} numbers, a row of a matrix")
        matrix = np.array([row.numbers(f"{size} numbers, a row of a matrix") for row in body])
        blocks[int(head.words[0]), int(head.words[1])] = head, matrix
    return blocks


def _overlaps(path: Path) -> dict[tuple[int, int], float]:
    expected = "i, j and an overlap"
    found = {}
    for row in read_rows(path):
        if len(row.words) != 3:
            raise row.fail(expected)
        i, j, share = row.numbers(expected)
        found[int(i), int(j)] = float(np.clip(share, 0.0, 1.0))
    return found


FORMAT = Format(
    "fragment benchmark",
    "scenes of cloud_bin_*.ply with gt.log and gt.info, as of 3DMatch, 3DLoMatch and Redwood",
    lambda folder: _is_scene(folder) or bool(_scenes_in(folder)),
    open_fragment_benchmark,
)
