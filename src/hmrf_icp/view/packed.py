"""A story in bytes for the page: a head in JSON, and all arrays in one compressed block."""

from __future__ import annotations

import base64
import json
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.drawing.palette import MEANINGS
from hmrf_icp.view.story import AGREEMENT, Moment, ShownCloud, Story

LEVELS = 255
"""Of a distance, over the span of the colours, and of a probability."""


class Block:
    """Arrays one behind the other, each at a multiple of four bytes."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0

    def put(self, array: NDArray[Any], kind: str) -> dict[str, Any]:
        """Add an array as little-endian ``kind``; return where it stands."""
        content = np.ascontiguousarray(array, dtype=np.dtype(kind).newbyteorder("<")).tobytes()
        place = {"at": self._size, "count": int(array.size), "kind": kind}
        padded = content + b"\0" * (-len(content) % 4)
        self._parts.append(padded)
        self._size += len(padded)
        return place

    def text(self) -> str:
        """Return all of them, compressed, in letters that HTML leaves alone."""
        return base64.b64encode(zlib.compress(b"".join(self._parts), 6)).decode("ascii")


def packed(story: Story) -> tuple[str, str]:
    """Return head and block.

    The head is JSON in which nothing ends a script. Distances go as levels of a logarithmic
    scale, normals as bytes.
    """
    block = Block()
    said = story.said
    image = story.image
    head = {
        "title": story.title,
        "verdict": said.verdict,
        "believed": said.believed,
        "advice": said.advice,
        "facts": said.facts,
        "free": [
            {
                "text": one.text,
                "rotation": one.rotation,
                "direction": one.direction,
                "through": one.through,
            }
            for one in said.free
        ],
        "source": _cloud(story.source, block),
        "target": _cloud(story.target, block),
        "probability": None
        if story.probability is None
        else block.put(np.rint(story.probability * LEVELS), "uint8"),
        "moments": [_moment(moment, story, block) for moment in story.moments],
        "result": story.result,
        "edges": story.edges.tolist(),
        "image": None
        if image is None
        else {"height": image.shape[0], "width": image.shape[1], "rows": block.put(image, "int32")},
        "views": story.views,
        "agreement": story.agreement,
        "colours": {**MEANINGS, "agreement": AGREEMENT},
        "frame": story.frame.ravel().tolist(),
    }
    text = json.dumps(head, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c"), block.text()


def _cloud(cloud: ShownCloud, block: Block) -> dict[str, Any]:
    return {
        "name": cloud.name,
        "count": cloud.count,
        "spacing": cloud.spacing,
        "view": cloud.view,
        "viewpoint": None if cloud.viewpoint is None else cloud.viewpoint.tolist(),
        "points": block.put(cloud.points, "float32"),
        "normals": block.put(np.rint(cloud.normals * 127), "int8"),
    }


def _moment(moment: Moment, story: Story, block: Block) -> dict[str, Any]:
    low, high = np.log(story.edges[[0, -1]])
    level = (np.log(np.maximum(moment.distance, story.edges[0])) - low) / (high - low)
    return {
        "title": moment.title,
        "run": moment.run,
        "chosen": moment.chosen,
        "pose": moment.pose.ravel().tolist(),
        "distance": block.put(np.rint(np.clip(level, 0.0, 1.0) * LEVELS), "uint8"),
        "source": block.put(moment.of_source, "uint8"),
        "target": block.put(moment.of_target, "uint8"),
        "histogram": [round(float(share), 5) for share in moment.histogram],
        "numbers": {name: float(f"{value:.6g}") for name, value in moment.numbers.items()},
    }
