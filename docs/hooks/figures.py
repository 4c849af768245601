"""The method's figures are drawn by the code of the day, whatever lies beside the pages."""

from __future__ import annotations

import functools
import importlib.util
import io
import warnings
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

DRAWING = Path(__file__).resolve().parents[1] / "figures" / "draw.py"


@functools.cache
def _drawn() -> dict[str, bytes]:
    """Draw them, once a process; PNG by name."""
    spec = importlib.util.spec_from_file_location("draw", DRAWING)
    if spec is None or spec.loader is None:
        raise FileNotFoundError(DRAWING)
    draw = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(draw)
    pictures = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what a registration says of its result
        for name, figure in draw.of_the_method(draw.desk_pair()).items():
            stream = io.BytesIO()
            figure.savefig(stream, dpi=draw.DPI, format="png")
            pictures[name] = stream.getvalue()
    return pictures


def on_files(files: Files, config: Any) -> Files:
    """Put what was drawn in the place of what lies there."""
    for name, picture in _drawn().items():
        place = f"figures/{name}"
        committed = files.get_file_from_path(place)
        if committed is not None:
            files.remove(committed)
        files.append(File.generated(config, place, content=picture))
    return files
