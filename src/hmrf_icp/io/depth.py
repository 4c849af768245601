"""Depth maps from images and arrays, in whatever unit they hold."""

from __future__ import annotations

import os
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.errors import InputError
from hmrf_icp.io.arrays import read_npy
from hmrf_icp.io.files import check_suffix, existing_file, reading
from hmrf_icp.io.pgm import read_pgm

IMAGE_SUFFIXES = (".png", ".pgm", ".tif", ".tiff")
"""Files that can only be depth maps."""

DEPTH_SUFFIXES = (*IMAGE_SUFFIXES, ".npy")
"""Files that may be depth maps; an array in NPY may also be a cloud."""

# Pillow's name for a layout of pixels -> what it is in words, for the layouts that cannot be depth.
_NOT_DEPTH = {
    "1": "a 1-bit image",
    "L": "an 8-bit image",
    "P": "an 8-bit image with a palette",
    "LA": "an 8-bit image with an alpha channel",
}


def read_depth(path: str | os.PathLike[str]) -> NDArray[Any]:
    """Read a depth map as it stands in the file, without a unit.

    Parameters
    ----------
    path
        16-bit PNG or PGM, TIFF (16-bit integers or 32-bit floating point) or NPY.

    Returns
    -------
    (H, W), integers or floating point; `PointCloud.from_depth` makes metres and points of it.

    Raises
    ------
    InputError
        The file is missing, empty, damaged or of an unknown kind, has 8 bits a
        pixel or several channels.
    """
    file = existing_file(path)
    suffix = check_suffix(file, DEPTH_SUFFIXES, "read a depth map from")
    if suffix == ".npy":
        depth = read_npy(file)
        if depth.ndim != 2:
            raise InputError(
                f"{file}: expected a depth map of shape (H, W), found an array of shape "
                f"{depth.shape}"
            )
        return check_depth_type(file, depth)
    return read_pgm(file) if suffix == ".pgm" else _read_image(file)


def check_depth_type(path: Path, depth: NDArray[Any]) -> NDArray[Any]:
    """Refuse an array whose numbers cannot be depths."""
    if depth.dtype.kind not in "iuf" or depth.dtype.itemsize < 2:
        raise InputError(
            f"{path}: an array of {depth.dtype} cannot be a depth map, expected integers of 16 "
            "bits or more, or floating point"
        )
    return depth


def _read_image(path: Path) -> NDArray[Any]:
    from PIL import Image, UnidentifiedImageError

    with (
        reading(path, "an image", Image.DecompressionBombError),
        warnings.catch_warnings(),
        path.open("rb") as stream,
    ):
        # Pillow warns of files that are damaged (and then raises, or reads on past what does not
        # matter) and of sizes that no depth map has; only the latter is news.
        warnings.simplefilter("ignore")
        warnings.simplefilter("error", Image.DecompressionBombWarning)
        try:
            image = Image.open(stream, formats=("PNG", "TIFF"))
        except Image.DecompressionBombWarning as error:
            raise InputError(f"{path}: too large for a depth map: {error}") from None
        except UnidentifiedImageError:
            raise InputError(
                f"{path}: not a PNG or TIFF image, or cut short in its first bytes"
            ) from None
        if image.mode in _NOT_DEPTH or len(image.getbands()) > 1:
            found = _NOT_DEPTH.get(
                image.mode, f"an image of {len(image.getbands())} channels ({image.mode})"
            )
            raise InputError(
                f"{path}: {found}, expected one channel of depth: 16-bit integers or 32-bit "
                "floating point"
            )
        frames = getattr(image, "n_frames", 1)
        if frames > 1:
            raise InputError(f"{path}: {frames} images in one file, expected one")
        if image.format == "PNG":
            # Checksums and the closing chunk, of which decoding sees only part; it also keeps
            # a damaged file out where another library has told Pillow to put up with those.
            image.verify()
            stream.seek(0)
            image = Image.open(stream, formats=("PNG",))
        pixels = np.array(image)
    # Some versions of Pillow widen 16-bit PNG to 32 bits, which would hide that 65535 is its end.
    return pixels.astype(np.uint16) if image.format == "PNG" else pixels
