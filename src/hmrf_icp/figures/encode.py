"""Pictures one after the other as a file: GIF by Pillow, MP4 by the ffmpeg of imageio-ffmpeg."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.errors import InputError, MissingDependencyError

SUFFIXES = (".gif", ".mp4")

COLOURS = 128
"""Of a GIF, the same for all of its pictures: what stays does not flicker."""

SAMPLED = 12
"""Pictures that the colours are chosen from."""


class Film(Protocol):
    """Pictures that are drawn when they are asked for."""

    @property
    def frames(self) -> Sequence[int]:
        """For how many frames each of the pictures is shown."""

    def draw(self, number: int) -> NDArray[np.uint8]:
        """Draw a picture (H, W, 3), all of one size."""


def check_film(path: str | os.PathLike[str]) -> None:
    """Refuse what no film can be written to, before any is made.

    Raises
    ------
    InputError
        The suffix is none of a film, or no file can be written there.
    MissingDependencyError
        MP4 is asked for and imageio-ffmpeg is not installed.
    """
    from hmrf_icp.io.whole import require_writable

    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: expected the name of a film, {' or '.join(SUFFIXES)}")
    if suffix == ".mp4":
        _ffmpeg()
    require_writable(path)


def write_film(
    path: str | os.PathLike[str],
    film: Film,
    fps: int,
    on_progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write pictures as a film; the file appears whole or not at all.

    Parameters
    ----------
    path
        ``.gif``, which runs in a loop, or ``.mp4``, whose pictures have even sides.
    film
        The pictures.
    fps
        Frames a second; a GIF counts in hundredths of a second.
    on_progress
        Called with the number of pictures drawn and of all.

    Raises
    ------
    InputError, MissingDependencyError
        As :func:`check_film`.
    """
    from hmrf_icp.io.whole import written_whole

    check_film(path)
    write = _write_gif if Path(path).suffix.lower() == ".gif" else _write_mp4

    def pictures() -> Iterator[NDArray[np.uint8]]:
        for number in range(len(film.frames)):
            yield film.draw(number)
            if on_progress is not None:
                on_progress(number + 1, len(film.frames))

    with written_whole(path) as partial:
        write(partial, film, pictures(), fps)


def _write_gif(path: Path, film: Film, pictures: Iterator[NDArray[np.uint8]], fps: int) -> None:
    from PIL import Image

    number = len(film.frames)
    some = np.unique(np.linspace(0, number - 1, SAMPLED).astype(np.intp))
    sheet = Image.fromarray(np.concatenate([film.draw(int(k)) for k in some]))
    colours = sheet.quantize(COLOURS, method=Image.Quantize.MEDIANCUT)
    first, *others = (
        Image.fromarray(pixels).quantize(palette=colours, dither=Image.Dither.NONE)
        for pixels in pictures
    )
    # Hundredths of a second; what is rounded off one is given to the next.
    ends = np.round(np.cumsum(film.frames) * 100.0 / fps)
    lasting = np.maximum(np.diff(ends, prepend=0.0), 2.0) * 10.0
    first.save(
        path,
        format="GIF",
        save_all=True,
        append_images=others,
        duration=[int(time) for time in lasting],
        loop=0,
    )


def _write_mp4(path: Path, film: Film, pictures: Iterator[NDArray[np.uint8]], fps: int) -> None:
    ffmpeg = _ffmpeg()
    writer = None
    try:
        for pixels, frames in zip(pictures, film.frames, strict=True):
            if writer is None:
                writer = ffmpeg.write_frames(
                    str(path),
                    (pixels.shape[1], pixels.shape[0]),
                    fps=fps,
                    codec="libx264",
                    pix_fmt_out="yuv420p",
                    macro_block_size=2,
                    output_params=["-crf", "20", "-movflags", "+faststart"],
                    ffmpeg_log_level="error",
                )
                writer.send(None)
            for _ in range(frames):
                writer.send(np.ascontiguousarray(pixels))
    finally:
        if writer is not None:
            writer.close()


def _ffmpeg() -> Any:
    try:
        import imageio_ffmpeg
    except ImportError:
        raise MissingDependencyError(
            "a film as MP4 needs imageio-ffmpeg: pip install 'hmrf-icp[film]'; a GIF needs nothing"
        ) from None
    return imageio_ffmpeg
