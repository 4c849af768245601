"""``hmrf-icp animate``: a film of a registration."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from hmrf_icp import presets
from hmrf_icp.cli import completion
from hmrf_icp.cli.inputs import (
    NOT_BELIEVED,
    arguments_named,
    lens_of,
    position,
    read_input,
    require_positive,
    seen_from,
)
from hmrf_icp.cli.loudness import Quiet, Verbose, say
from hmrf_icp.cli.options import (
    CLOUDS,
    DEPTH,
    METHOD,
    Colour,
    IntrinsicsGiven,
    MinConfidence,
    Preset,
    SourceConfidence,
    TargetConfidence,
    method_named,
)
from hmrf_icp.errors import InputError

if TYPE_CHECKING:
    from hmrf_icp.registration import Where

_FILM = "Film"


def animate(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE", show_default=False, help="What moves, as for hmrf-icp register."
        ),
    ],
    target: Annotated[
        Path, typer.Argument(metavar="TARGET", show_default=False, help="What stays.")
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="FILM",
            show_default=False,
            rich_help_panel=_FILM,
            help="The film: .gif, or .mp4, which needs the extra 'film'.",
        ),
    ],
    fps: Annotated[
        int, typer.Option(metavar="N", rich_help_panel=_FILM, help="Frames a second, 1 to 60.")
    ] = 20,
    size: Annotated[
        str, typer.Option(metavar="WxH", rich_help_panel=_FILM, help="Pixels, even numbers.")
    ] = "960x540",
    seconds: Annotated[
        float,
        typer.Option(
            metavar="S",
            rich_help_panel=_FILM,
            help="From the start to the result; each iteration has one frame at least.",
        ),
    ] = 4.0,
    dark: Annotated[
        bool, typer.Option("--dark", rich_help_panel=_FILM, help="On a dark ground.")
    ] = False,
    truth: Annotated[
        Path | None,
        typer.Option(
            metavar="POSE.txt",
            rich_help_panel=_FILM,
            help="The true pose, a 4x4 matrix as text, if it is known: errors are told against it.",
        ),
    ] = None,
    camera: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            rich_help_panel=DEPTH,
            help="Intrinsics: a 3x3 matrix, Open3D's, RealSense's, Azure's or ROS's file.",
        ),
    ] = None,
    intrinsics: IntrinsicsGiven = None,
    depth_scale: Annotated[
        float | None,
        typer.Option(metavar="UNITS", rich_help_panel=DEPTH, help="Units per metre."),
    ] = None,
    max_depth: Annotated[
        float | None,
        typer.Option(metavar="M", rich_help_panel=DEPTH, help="Leave out depths beyond."),
    ] = None,
    source_confidence: SourceConfidence = None,
    target_confidence: TargetConfidence = None,
    min_confidence: MinConfidence = 1,
    samples: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            rich_help_panel=CLOUDS,
            help="Points spread over a mesh; 0 takes its vertices.",
        ),
    ] = None,
    viewpoint: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z|auto|none",
            rich_help_panel=CLOUDS,
            help="Where the sensor stood, as for hmrf-icp register.",
        ),
    ] = None,
    init: Annotated[
        Path | None,
        typer.Option(metavar="POSE.txt", rich_help_panel=METHOD, help="Where to start."),
    ] = None,
    search: Annotated[
        str,
        typer.Option(
            metavar="WHERE", rich_help_panel=METHOD, help="Where to look: near, everywhere, auto."
        ),
    ] = "auto",
    preset: Preset = presets.DEFAULT,
    rejector: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            rich_help_panel=METHOD,
            autocompletion=completion.words(presets.rejector_names()),
            help=f"Another rejection rule: {', '.join(presets.rejector_names())}.",
        ),
    ] = None,
    aligner: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            rich_help_panel=METHOD,
            autocompletion=completion.words(presets.aligner_names()),
            help=f"Another metric: {', '.join(presets.aligner_names())}.",
        ),
    ] = None,
    colour: Colour = False,
    quiet: Quiet = False,  # noqa: ARG001
    verbose: Verbose = False,
) -> None:
    """Register SOURCE to TARGET, and film how it went.

    Example: hmrf-icp animate A.ply B.ply -o film.gif

    The source moves into place while its inliers (green)
    are told from its outliers (grey). Each iteration is
    shown as it was; what is interpolated says so.

    Exit status: 0 the pose is to be believed; 1 it is not
    (the film is written and says so); 2 bad input.
    """
    from hmrf_icp import plot
    from hmrf_icp.cli.progress import most_iterations, registration_bar, told_of_compiling
    from hmrf_icp.cli.summary import summary
    from hmrf_icp.figures.encode import check_film
    from hmrf_icp.figures.film import check_numbers
    from hmrf_icp.io import read_pose
    from hmrf_icp.loop.icp import Iteration
    from hmrf_icp.registration import register

    metric = presets.coloured(aligner) if colour else aligner
    method = presets.method(preset, rejector, metric)
    require_positive("--depth-scale", depth_scale, "units per metre")
    require_positive("--max-depth", max_depth, "metres")
    pixels = read_size(size)
    check_numbers(fps, pixels, seconds)
    lens = lens_of(camera, intrinsics)
    looked = viewpoint in (None, "auto", "none")
    stood = None if looked or viewpoint is None else position("--viewpoint", viewpoint)
    if search not in ("auto", "near", "everywhere"):
        raise InputError(f"--search: unknown {search!r}, expected auto, near or everywhere")
    start = None if init is None else read_pose(init)
    known = None if truth is None else read_pose(truth)
    check_film(output)
    sure = (source_confidence, target_confidence)
    inputs = [file for file in (source, target, camera, init, truth, *sure) if file is not None]
    if output.resolve() in [file.resolve() for file in inputs]:
        raise InputError(f"--output {output}: is an input of this run, give another name")

    recording = plot.Recording()
    with registration_bar() as bar:

        def told(iteration: Iteration) -> None:
            recording(iteration)
            bar(iteration)

        bar.stage("Reading")
        moving, staying = (
            read_input(file, lens, depth_scale, max_depth, samples, confidence, min_confidence)[0]
            for file, confidence in zip((source, target), sure, strict=True)
        )
        if stood is not None:
            moving, staying = seen_from(stood, moving), seen_from(stood, staying)
        bar.stage("Registering", total=most_iterations(method))
        named_arguments = arguments_named({"source": source, "target": target, "init": init})
        with named_arguments, told_of_compiling(bar):
            result = register(
                moving,
                staying,
                start,
                preset=method,
                viewpoint=None if viewpoint == "none" else "auto",
                search=cast("Where", search),
                profile=verbose,
                on_iteration=told,
            )
        plot.animate(
            output,
            result,
            init=start,
            preset=method,
            recording=recording,
            truth=known,
            fps=fps,
            size=pixels,
            seconds=seconds,
            dark=dark,
            names=(source.name, target.name),
            method=method_named(preset, rejector, aligner, colour),
            on_progress=lambda done, total: bar.show("Drawing", done, total),
        )
    say(summary(result, source.name, target.name, [output]))
    raise typer.Exit(0 if result.believed else NOT_BELIEVED)


def read_size(text: str) -> tuple[int, int]:
    """Read ``WxH``, pixels.

    Raises
    ------
    InputError
        Something else.
    """
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise InputError(f"--size: expected width and height, as in 960x540, got {text!r}")
    return int(width), int(height)
