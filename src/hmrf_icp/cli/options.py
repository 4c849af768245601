"""Options that are the same in several commands, and the panels of help that they stand in."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hmrf_icp import presets
from hmrf_icp.cli import completion

DEPTH = "Depth maps"
SURE = "Confidence of depths"
CLOUDS = "Clouds"
METHOD = "Method"

IntrinsicsGiven = Annotated[
    str | None,
    typer.Option(
        metavar="FX,FY,CX,CY", rich_help_panel=DEPTH, help="The same, given here, in pixels."
    ),
]
SourceConfidence = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        rich_help_panel=SURE,
        help="How sure each pixel of SOURCE is, as ARKit writes it: an image of its size.",
    ),
]
TargetConfidence = Annotated[
    Path | None,
    typer.Option(metavar="FILE", rich_help_panel=SURE, help="The same for the pixels of TARGET."),
]
MinConfidence = Annotated[
    float,
    typer.Option(
        metavar="LEVEL",
        rich_help_panel=SURE,
        help="Leave out depths that are less sure: 1 is ARKit's medium, 2 its high.",
    ),
]
Preset = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        rich_help_panel=METHOD,
        autocompletion=completion.words(presets.names()),
        help=f"One of: {', '.join(presets.names())}.",
    ),
]
Colour = Annotated[
    bool,
    typer.Option("--colour", rich_help_panel=METHOD, help="Go by colours or intensities too."),
]


def method_named(preset: str, rejector: str | None, aligner: str | None, colour: bool) -> str:
    """Name a method by what was asked for, as figures and films do."""
    parts = (preset, rejector, aligner, "colour" if colour else None)
    return " with ".join(part for part in parts if part)
