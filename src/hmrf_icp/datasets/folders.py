"""Finding things in a recording's folder."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from hmrf_icp.clouds.distorted_camera import Camera
from hmrf_icp.errors import InputError

CAMERA_FILES = (
    "camera-intrinsics.txt",
    "camera_intrinsics.txt",
    "intrinsics.txt",
    "intrinsic.txt",
    "camera.txt",
    "camera_intrinsic.json",
    "camera-intrinsics.json",
    "camera_intrinsics.json",
    "intrinsic.json",
    "intrinsics.json",
    "camera_primesense.json",
    "camera.json",
)
"""Names that a file with a recording's intrinsics may have."""


def number_of(path: Path) -> int | None:
    """Return the last number in a file's name: 12 of ``frame-000012.depth.png``."""
    digits = re.findall(r"\d+", path.name.partition(".")[0]) or re.findall(r"\d+", path.stem)
    return int(digits[-1]) if digits else None


def numbered(files: Iterable[Path]) -> list[tuple[int, Path]]:
    """Sort files by the numbers in their names; by the alphabet if one has none.

    Raises
    ------
    InputError
        Two files have one number.
    """
    paths = sorted(files)
    numbers = [number_of(path) for path in paths]
    if any(number is None for number in numbers):
        return list(enumerate(paths))
    found: dict[int, Path] = {}
    for number, path in zip(numbers, paths, strict=True):
        assert number is not None
        if number in found:
            raise InputError(
                f"{path}: has the number of {found[number].name}, expected one file a frame"
            )
        found[number] = path
    return sorted(found.items())


def files_in(folder: Path, *suffixes: str) -> list[Path]:
    """Files of a folder whose names end so, whatever the case; none if there is no folder."""
    if not folder.is_dir():
        return []
    return sorted(
        path
        for path in folder.iterdir()
        if path.name.lower().endswith(suffixes) and path.is_file() and path.name[0] != "."
    )


def find_camera_file(folder: Path) -> Path | None:
    """Return the folder's intrinsics file, None where there is none.

    Raises
    ------
    InputError
        There are several.
    """
    found = [folder / name for name in CAMERA_FILES if (folder / name).is_file()]
    if len(found) > 1:
        raise InputError(
            f"{folder}: {len(found)} files of intrinsics, {' and '.join(f.name for f in found)}; "
            "keep the one that belongs to the depth maps"
        )
    return found[0] if found else None


def image_size(path: Path) -> tuple[int, int]:
    """Return width and height of a depth map, pixels.

    Raises
    ------
    InputError
        It cannot be read.
    """
    from hmrf_icp.io import read_depth

    height, width = read_depth(path).shape
    return width, height


def camera_from_file(path: Path, depth: Path) -> Camera:
    """Read the camera of a depth map.

    Raises
    ------
    InputError
        The intrinsics are malformed or for another size, or the depth map cannot be read.
    """
    from hmrf_icp.io import read_camera

    return read_camera(path, *image_size(depth))


def describe(folder: Path) -> str:
    """Say in a few words what is in a folder."""
    try:
        entries = sorted(folder.iterdir())
    except OSError as error:
        raise InputError(f"{folder}: cannot be listed: {error.strerror}") from None
    if not entries:
        return "nothing: the folder is empty"
    folders = [f"{entry.name}/" for entry in entries if entry.is_dir()]
    files = [entry for entry in entries if not entry.is_dir()]
    kinds = Counter(file.suffix.lower() for file in files)
    parts = []
    for suffix, count in kinds.most_common(6):
        names = [file.name for file in files if file.suffix.lower() == suffix]
        parts.append(", ".join(names) if count <= 3 else f"{count} files like {names[0]}")
    parts += folders[:6]
    if len(folders) > 6:
        parts.append(f"{len(folders) - 6} more folders")
    return ", ".join(parts)
