"""Depth maps from images and arrays, in whatever unit they hold."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.errors import InputError
from hmrf_icp.io.arrays import read_npy
from hmrf_icp.io.exr import read_exr
from hmrf_icp.io.files import check_suffix, existing_file, quietly, reading, require_bounded
from hmrf_icp.io.pgm import read_pgm

if TYPE_CHECKING:
    from PIL.ImageFile import ImageFile

IMAGE_SUFFIXES = (".png", ".pgm", ".tif", ".tiff", ".exr")
"""Files that can only be depth maps."""

DEPTH_SUFFIXES = (*IMAGE_SUFFIXES, ".npy")
"""Files that may be depth maps; an array in NPY may also be a cloud."""

MOST_PIXELS = 100_000_000
"""Images of more are taken for damaged: a few bytes can promise gigabytes."""

MEDIUM = 1
"""Confidence that a pixel must have, if none is asked for; ARKit's are 0, 1 and 2."""

_PNG_START = b"\x89PNG\r\n\x1a\n"
_PNG_END = b"IEND\xaeB`\x82"
_PHOTOMETRIC, _WHITE_IS_ZERO, _SAMPLE_FORMAT = 262, 0, 339
"""TIFF's numbers of two tags, and what one of them may say."""

_TIFF_STARTS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")

# Pillow's name for a layout of pixels -> what it is in words, for the layouts that cannot be depth.
_NOT_DEPTH = {
    "1": "a 1-bit image",
    "L": "an 8-bit image",
    "P": "an 8-bit image with a palette",
    "LA": "an 8-bit image with an alpha channel",
}


def read_depth(
    path: str | os.PathLike[str],
    confidence: str | os.PathLike[str] | None = None,
    min_confidence: float = MEDIUM,
) -> NDArray[Any]:
    """Read a depth map as it stands in the file, without a unit.

    Parameters
    ----------
    path
        16-bit PNG or PGM, TIFF (16-bit integers or floating point of 32 or 64 bits), EXR (`pip
        install 'hmrf-icp[exr]'`) or NPY.
    confidence
        An image or array of the same size that says how sure each depth is, as ARKit writes
        beside its own: PNG, PGM, TIFF or NPY, of 8 bits too.
    min_confidence
        Depths whose confidence is less become 0, "nothing seen". The default is ARKit's medium;
        2 is its high.

    Returns
    -------
    (H, W), integers or floating point; `PointCloud.from_depth` makes metres and points of it.

    Raises
    ------
    InputError
        The file is missing, empty, damaged or of an unknown kind, has 8 bits a
        pixel or several channels; the confidence is of another size.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from hmrf_icp import read_depth
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.save(Path(folder, "depth.npy"), np.full((2, 3), 1.5))
    ...     read_depth(Path(folder, "depth.npy")).shape
    (2, 3)
    """
    file = existing_file(path)
    depth = _read(file)
    if confidence is None:
        return depth
    return confident(depth, read_confidence(confidence), min_confidence, str(confidence))


def _read(file: Path) -> NDArray[Any]:
    suffix = check_suffix(file, DEPTH_SUFFIXES, "read a depth map from")
    if suffix == ".npy":
        depth = read_npy(file)
        if depth.ndim != 2:
            raise InputError(
                f"{file}: expected a depth map of shape (H, W), found an array of shape "
                f"{depth.shape}"
            )
        return check_depth_type(file, depth)
    if suffix == ".exr":
        return read_exr(file)
    return read_pgm(file) if suffix == ".pgm" else _read_image(file)


def read_confidence(path: str | os.PathLike[str]) -> NDArray[Any]:
    """Read how sure each depth is, (H, W).

    Raises
    ------
    InputError
        The file is missing, damaged or of an unknown kind, or has several channels.
    """
    file = existing_file(path)
    suffix = check_suffix(file, DEPTH_SUFFIXES, "read a confidence from")
    if suffix == ".npy":
        levels = read_npy(file)
    elif suffix in (".pgm", ".exr"):
        levels = read_pgm(file, eight=True) if suffix == ".pgm" else read_exr(file)
    else:
        levels = _read_image(file, eight=True)
    if levels.ndim != 2:
        raise InputError(f"{file}: expected one confidence a pixel, got shape {levels.shape}")
    return levels


def confident(
    depth: NDArray[Any], levels: NDArray[Any], least: float, name: str = "confidence"
) -> NDArray[Any]:
    """Return the depths (H, W) whose level is ``least`` or more, and 0 for all others.

    Raises
    ------
    InputError
        The two are of different sizes.
    """
    if depth.shape != levels.shape:
        (height, width), (rows, columns) = depth.shape, levels.shape
        raise InputError(
            f"{name}: {columns} x {rows} pixels, the depth map has {width} x {height}; expected "
            "the confidence of each of its pixels"
        )
    with np.errstate(invalid="ignore"):
        return np.where(levels >= least, depth, depth.dtype.type(0))


def check_depth_type(path: Path, depth: NDArray[Any]) -> NDArray[Any]:
    """Refuse an array whose numbers cannot be depths."""
    if depth.dtype.kind not in "iuf" or depth.dtype.itemsize < 2:
        raise InputError(
            f"{path}: an array of {depth.dtype} cannot be a depth map, expected integers of 16 "
            "bits or more, or floating point"
        )
    return depth


def _read_image(path: Path, eight: bool = False) -> NDArray[Any]:
    # Opened by class and not by Image.open, whose limit on the size is a warning of the process.
    from PIL.PngImagePlugin import PngImageFile
    from PIL.TiffImagePlugin import TiffImageFile

    with reading(path, "an image"):
        data = path.read_bytes()
        if data.startswith(_PNG_START):
            if _PNG_END not in data:
                raise InputError(f"{path}: the PNG image is cut short")
            # Checksums, which decoding leaves unread; it also keeps a damaged file out where
            # another library has told Pillow to put up with those.
            PngImageFile(io.BytesIO(data)).verify()
            # Some versions of Pillow widen to 32 bits, which would hide that 65535 is the end.
            pixels = _pixels(path, PngImageFile(io.BytesIO(data)), len(data), eight)
            return pixels.astype(np.uint16)
        if data.startswith(_TIFF_STARTS):
            with quietly():
                image = TiffImageFile(io.BytesIO(data))
                pixels = _pixels(path, image, len(data), eight)
            if image.tag_v2.get(_PHOTOMETRIC) == _WHITE_IS_ZERO:
                raise InputError(
                    f"{path}: a TIFF image whose zero is white holds distances upside down; write "
                    "it with zero as black (PhotometricInterpretation 1)"
                )
            # Pillow has no unsigned 32 bits, and makes large ones negative.
            unsigned = image.tag_v2.get(_SAMPLE_FORMAT, (1,))[0] == 1
            return pixels.view(np.uint32) if unsigned and pixels.dtype == np.int32 else pixels
        raise InputError(f"{path}: not a PNG or TIFF image, its first bytes are {data[:8]!r}")


def _pixels(path: Path, image: ImageFile, size: int, eight: bool) -> NDArray[Any]:
    """Decode an image out of ``size`` bytes, if it can be a depth map, or one of 8 bits."""
    bands = len(image.getbands())
    if (image.mode in _NOT_DEPTH and not (eight and image.mode == "L")) or bands > 1:
        found = _NOT_DEPTH.get(image.mode, f"an image of {bands} channels ({image.mode})")
        raise InputError(
            f"{path}: {found}, expected one channel of depth: 16-bit integers or 32-bit "
            "floating point"
        )
    frames = getattr(image, "n_frames", 1)
    if frames > 1:
        raise InputError(f"{path}: {frames} images in one file, expected one")
    if image.width * image.height > MOST_PIXELS:
        raise InputError(
            f"{path}: an image of {image.width} x {image.height} pixels is larger than any depth "
            "map, or its header is damaged"
        )
    require_bounded(path, size, image.width * image.height * (2 if "16" in image.mode else 4))
    # Pillow leaves black what no strip of the file covers.
    strips = [extents for _, extents, *_ in image.tile if extents is not None]
    covered = sum((x1 - x0) * (y1 - y0) for x0, y0, x1, y1 in strips)
    if covered < image.width * image.height:
        raise InputError(
            f"{path}: cut short: {image.width} x {image.height} pixels promised, strips of "
            f"{covered} found"
        )
    return np.array(image)
