"""Angles and starts as people write them: ``pi/30``, ``2pi/15``, ``6deg``, ``pi/6+0.3``."""

from __future__ import annotations

import math
import re

from hmrf_icp.errors import InputError
from hmrf_icp.evaluate.protocol import NO_START, NONE, Start

_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_OF_PI = re.compile(rf"(?P<times>{_NUMBER})?\s*\*?\s*(?:pi|π)\s*(?:/\s*(?P<by>{_NUMBER}))?")
_DEGREES = re.compile(rf"(?P<degrees>{_NUMBER})\s*(?:deg|°)")
_RADIANS = re.compile(_NUMBER)


def parse_angle(text: str) -> float:
    """Read an angle in radians, as a fraction of pi, or in degrees.

    Raises
    ------
    InputError
        None of these.
    """
    word = text.strip()
    if found := _OF_PI.fullmatch(word):
        by = float(found["by"] or 1)
        if by > 0:
            return float(found["times"] or 1) * math.pi / by
    elif found := _DEGREES.fullmatch(word):
        return math.radians(float(found["degrees"]))
    elif _RADIANS.fullmatch(word):
        return float(word)
    raise InputError(
        f"angle: expected radians (0.1), a fraction of pi (pi/30, 2pi/15), degrees (6deg) or "
        f"{NONE} for no start at all, got {text!r}"
    )


def parse_start(text: str, translation: float = 0.0) -> Start:
    """Read an angle, with metres behind a ``+`` where it has a translation of its own; or none.

    Parameters
    ----------
    text
        ``pi/30``, ``pi/6+0.3``, or ``none``.
    translation
        Metres for one that does not say.

    Raises
    ------
    InputError
        Not an angle, or not a number of metres.
    """
    if text.strip() == NONE:
        return NO_START
    angle, plus, metres = text.partition("+")
    if plus:
        if not _RADIANS.fullmatch(metres.strip()):
            raise InputError(f"start {text!r}: expected metres behind the +, got {metres!r}")
        translation = float(metres)
    return Start(parse_angle(angle), translation)
