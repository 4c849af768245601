"""``hmrf-icp register``: one pair of files."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from hmrf_icp import presets
from hmrf_icp.errors import InputError

if TYPE_CHECKING:
    from hmrf_icp.clouds.cloud import PointCloud
    from hmrf_icp.io import Intrinsics
    from hmrf_icp.registration import Where
    from hmrf_icp.result import RegistrationResult
    from hmrf_icp.view.story import Story

NOT_BELIEVED = 1

_DEPTH = "Depth maps"
_CLOUDS = "Clouds"
_METHOD = "Method"
_OUTPUT = "Output"


def register(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            show_default=False,
            help="What moves: a depth map (16-bit PNG or PGM, TIFF, EXR, NPY), a cloud in metres "
            "(PLY, PCD, LAS, LAZ, E57, XYZ, XYZN, PTS, ASC, CSV, TXT, NPY, NPZ, KITTI's BIN) or a "
            "mesh (OBJ, STL, GLB, PLY).",
        ),
    ],
    target: Annotated[
        Path,
        typer.Argument(metavar="TARGET", show_default=False, help="What stays, of the same kinds."),
    ],
    camera: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            rich_help_panel=_DEPTH,
            help="Intrinsics of the depth maps: a 3x3 matrix as text, the JSON of Open3D, of "
            "RealSense or of an Azure Kinect's calibration, or ROS's camera_info in YAML. What "
            "the lens distorts is undistorted.",
        ),
    ] = None,
    intrinsics: Annotated[
        str | None,
        typer.Option(
            metavar="FX,FY,CX,CY", rich_help_panel=_DEPTH, help="The same, given here, in pixels."
        ),
    ] = None,
    depth_scale: Annotated[
        float | None,
        typer.Option(
            metavar="UNITS",
            rich_help_panel=_DEPTH,
            help="Units of the depth maps per metre: 1000 for integers and 1 for floating point, "
            "unless given.",
        ),
    ] = None,
    max_depth: Annotated[
        float | None,
        typer.Option(
            metavar="M",
            rich_help_panel=_DEPTH,
            help="Leave out depths beyond this many metres.",
        ),
    ] = None,
    source_confidence: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            rich_help_panel=_DEPTH,
            help="How sure each pixel of SOURCE is, as ARKit writes it: an image of its size.",
        ),
    ] = None,
    target_confidence: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", rich_help_panel=_DEPTH, help="The same for the pixels of TARGET."
        ),
    ] = None,
    min_confidence: Annotated[
        float,
        typer.Option(
            metavar="LEVEL",
            rich_help_panel=_DEPTH,
            help="Leave out depths that are less sure: 1 is ARKit's medium, 2 its high.",
        ),
    ] = 1,
    samples: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            rich_help_panel=_CLOUDS,
            help="Points to spread over the surface of a mesh; 0 takes its vertices. Without, "
            "those are taken if they are many and evenly spread, and 100,000 points otherwise.",
        ),
    ] = None,
    viewpoint: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z|auto|none",
            rich_help_panel=_CLOUDS,
            help="Where the sensor stood, in the frame of each cloud, metres: 0,0,0 for LiDAR "
            "scans in the sensor's own frame. Holds for SOURCE and TARGET, whatever their files "
            "say; depth maps need none. auto, which is the default, finds it out from the "
            "points; none does without.",
        ),
    ] = None,
    init: Annotated[
        Path | None,
        typer.Option(
            metavar="POSE.txt",
            rich_help_panel=_METHOD,
            help="Where to start: a 4x4 matrix as text, source to target, metres. Without, "
            "nothing is known, and the pose is looked for everywhere.",
        ),
    ] = None,
    search: Annotated[
        str,
        typer.Option(
            metavar="WHERE",
            rich_help_panel=_METHOD,
            help="Where to look: near the start, everywhere, or auto: near a start that is given "
            "and everywhere without.",
        ),
    ] = "auto",
    preset: Annotated[
        str,
        typer.Option(
            metavar="NAME", rich_help_panel=_METHOD, help=f"One of: {', '.join(presets.names())}."
        ),
    ] = presets.DEFAULT,
    rejector: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            rich_help_panel=_METHOD,
            help="Another rule than the preset's own for which points have a counterpart, one of: "
            f"{', '.join(presets.rejector_names())}.",
        ),
    ] = None,
    aligner: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            rich_help_panel=_METHOD,
            help="Another measure than the preset's own of how far matched points are apart, "
            f"one of: {', '.join(presets.aligner_names())}.",
        ),
    ] = None,
    num_threads: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            rich_help_panel=_METHOD,
            help="Threads to use; all cores that the process may use where it is not given. The "
            "result is the same with any number.",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            metavar="ALIGNED",
            rich_help_panel=_OUTPUT,
            help="Write the source, moved into the target's frame, as a cloud "
            "(.ply, .pcd, .las, .laz, .e57, .obj, .xyz, .xyzn, .pts, .asc, .csv, .txt, .npy, "
            ".npz); with all that it had, its normals turned, where the format has a place for it "
            "(.ply, .pcd, .las, .laz, .csv, .npz).",
        ),
    ] = None,
    pose: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            rich_help_panel=_OUTPUT,
            help="Write the 4x4 matrix, source to target, as text that --init reads.",
        ),
    ] = None,
    figure: Annotated[
        Path | None,
        typer.Option(
            metavar="PNG",
            rich_help_panel=_OUTPUT,
            help="Write a picture of the clouds before and after, the distances and the inliers.",
        ),
    ] = None,
    html: Annotated[
        Path | None,
        typer.Option(
            metavar="HTML",
            rich_help_panel=_OUTPUT,
            help="Write a page with everything in it, to turn the clouds in a browser and to send.",
        ),
    ] = None,
    rrd: Annotated[
        Path | None,
        typer.Option(
            metavar="RRD",
            rich_help_panel=_OUTPUT,
            help="Write a recording for the viewer of rerun (needs rerun-sdk).",
        ),
    ] = None,
    view: Annotated[
        bool,
        typer.Option(
            "--view",
            rich_help_panel=_OUTPUT,
            help="Look at it in the browser afterwards, until Ctrl-C.",
        ),
    ] = False,
    port: Annotated[
        int,
        typer.Option(
            metavar="N",
            min=0,
            max=65535,
            show_default="any that is free",
            rich_help_panel=_OUTPUT,
            help="Port of the viewer, on this machine alone.",
        ),
    ] = 0,
    profile: Annotated[
        bool,
        typer.Option(
            "--profile",
            rich_help_panel=_OUTPUT,
            help="Print time and calls of each stage of the registration too.",
        ),
    ] = False,
    as_json: Annotated[
        bool,
        typer.Option(
            "--json",
            rich_help_panel=_OUTPUT,
            help="Print the result as one JSON object on stdout, all else on stderr.",
        ),
    ] = False,
) -> None:
    """Find the rigid motion that takes SOURCE onto TARGET.

    Example: hmrf-icp register A.ply B.ply

    Depth maps: hmrf-icp register a.png b.png --intrinsics 585,585,320,240

    Exit status: 0 the pose is to be believed (confidence of 0.5 or more, or
    converged, where the preset gives none); 1 it is not (the result is printed
    and written all the same, and says what to try); 2 bad input.
    """
    import hmrf_icp
    from hmrf_icp.cli.outputs import Outputs, note
    from hmrf_icp.cli.progress import most_iterations, registration_bar, told_of_compiling
    from hmrf_icp.cli.summary import json_text, summary
    from hmrf_icp.io import read_pose
    from hmrf_icp.view import Recording, story

    method = presets.preset(preset)
    if rejector is not None:
        presets.rejector(rejector)
    if aligner is not None:
        presets.aligner(aligner)
    _require_positive("--depth-scale", depth_scale, "units per metre")
    _require_positive("--max-depth", max_depth, "metres")
    lens = _lens(camera, intrinsics)
    looked = viewpoint in (None, "auto", "none")
    stood = None if looked or viewpoint is None else _position("--viewpoint", viewpoint)
    if search not in ("auto", "near", "everywhere"):
        raise InputError(f"--search: unknown {search!r}, expected auto, near or everywhere")
    start = None if init is None else read_pose(init)
    outputs = Outputs(output, pose, figure, html, rrd)
    sure = (source_confidence, target_confidence)
    outputs.check([file for file in (source, target, camera, init, *sure) if file])

    chosen = {"preset": preset, "rejector": rejector, "aligner": aligner}
    named = chosen | {"source": source, "target": target}
    result: RegistrationResult | None = None
    told: Story | None = None
    written: list[Path] = []
    try:
        with registration_bar() as bar:
            bar.stage("Reading")
            (moving, moving_is_depth), (staying, staying_is_depth) = (
                _read(file, lens, depth_scale, max_depth, samples, confidence, min_confidence)
                for file, confidence in zip((source, target), sure, strict=True)
            )
            given = (camera, intrinsics, depth_scale, max_depth)
            if not (moving_is_depth or staying_is_depth) and any(o is not None for o in given):
                note("neither file is a depth map: the options for depth maps have no effect")
            if stood is not None:
                if moving.camera is not None and staying.camera is not None:
                    note("both files come with a camera: --viewpoint has no effect")
                moving, staying = _seen_from(stood, moving), _seen_from(stood, staying)
            bar.stage("Registering", total=most_iterations(method))
            recording = Recording(also=bar)
            named_arguments = _arguments_named({"source": source, "target": target, "init": init})
            with named_arguments, told_of_compiling(bar):
                result = hmrf_icp.register(
                    moving,
                    staying,
                    start,
                    preset=method,
                    rejector=None if rejector is None else presets.rejector(rejector),
                    aligner=None if aligner is None else presets.aligner(aligner),
                    viewpoint=None if viewpoint == "none" else "auto",
                    search=cast("Where", search),
                    num_threads=num_threads,
                    profile=profile,
                    on_iteration=recording,
                )
            bar.stage("Writing")
            called = " with ".join(name for name in (preset, rejector, aligner) if name)
            names = source.name, target.name
            if view or html or rrd:
                told = story(result, start, recording, names=names)
            written = outputs.write(moving, staying, result, start, names, called, told)
    finally:
        # Also where writing failed: a full disk must not cost the result as well.
        if result is not None:
            if as_json:
                typer.echo(json_text(result, named))
            typer.echo(summary(result, source.name, target.name, written), err=as_json)
    if view and told is not None:
        from hmrf_icp.cli.view import serve_story

        serve_story(told, port, quiet=as_json)
    raise typer.Exit(0 if result.believed else NOT_BELIEVED)


def _require_positive(option: str, value: float | None, unit: str) -> None:
    if value is not None and not (math.isfinite(value) and value > 0):
        raise InputError(f"{option}: expected a positive number of {unit}, got {value:g}")


def _position(option: str, text: str) -> tuple[float, float, float]:
    try:
        x, y, z = (float(word) for word in text.split(","))
    except ValueError:
        x = y = z = math.nan
    if not all(map(math.isfinite, (x, y, z))):
        raise InputError(
            f"{option}: expected three numbers X,Y,Z in metres, such as 0,0,1.8, auto or none; "
            f"got {text!r}"
        )
    return x, y, z


def _lens(camera: Path | None, intrinsics: str | None) -> Intrinsics | None:
    from hmrf_icp.io import parse_intrinsics, read_intrinsics

    if camera is not None and intrinsics is not None:
        raise InputError("--camera and --intrinsics: give one of them, not both")
    if camera is not None:
        return read_intrinsics(camera)
    return None if intrinsics is None else parse_intrinsics(intrinsics, "--intrinsics")


def _read(
    path: Path,
    lens: Intrinsics | None,
    depth_scale: float | None,
    max_depth: float | None,
    samples: int | None = None,
    confidence: Path | None = None,
    min_confidence: float = 1,
) -> tuple[PointCloud, bool]:
    """Read a cloud, and say whether it came from a depth map."""
    from hmrf_icp.clouds.cloud import PointCloud
    from hmrf_icp.io.cloud import read_any, unproject

    content = read_any(path, samples, confidence, min_confidence)
    if isinstance(content, PointCloud):
        return content, False
    return unproject(path, content, lens, depth_scale, max_depth), True


def _seen_from(position: tuple[float, float, float], cloud: PointCloud) -> PointCloud:
    """Say where the sensor of a cloud stood; a camera stands at the origin and stays there."""
    import numpy as np

    return cloud if cloud.camera is not None else replace(cloud, viewpoint=np.array(position))


@contextmanager
def _arguments_named(files: dict[str, Path | None]) -> Iterator[None]:
    """Put the file behind the argument that the library complains about."""
    try:
        yield
    except InputError as error:
        argument, _, rest = str(error).partition(": ")
        if files.get(argument) is None:
            raise
        raise InputError(f"{argument} {files[argument]}: {rest}") from None
