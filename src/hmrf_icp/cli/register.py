"""``hmrf-icp register``: a pair of files, or many."""

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
from hmrf_icp.cli.loudness import Quiet, Verbose, note, say
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
from hmrf_icp.cli.pairs import Pair, asked_for
from hmrf_icp.errors import InputError

if TYPE_CHECKING:
    from hmrf_icp.clouds.cloud import PointCloud
    from hmrf_icp.registration import Where
    from hmrf_icp.result import RegistrationResult
    from hmrf_icp.view.story import Story

_MANY = "Many pairs"
_OUTPUT = "Output"


def register(
    sources: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="SOURCE",
            show_default=False,
            help="What moves: a depth map (16-bit PNG or PGM, TIFF, EXR, NPY), a cloud in metres "
            "(PLY, PCD, LAS, LAZ, E57, XYZ, XYZN, PTS, ASC, CSV, TXT, NPY, NPZ, KITTI's BIN) or a "
            "mesh (OBJ, STL, GLB, PLY); several of them, or a folder.",
        ),
    ] = None,
    target: Annotated[
        Path | None,
        typer.Argument(metavar="TARGET", show_default=False, help="What stays, of the same kinds."),
    ] = None,
    pairs: Annotated[
        Path | None,
        typer.Option(
            metavar="LIST",
            rich_help_panel=_MANY,
            help="Instead of SOURCE and TARGET: a file with a pair a line, source, target and, "
            "where there is one, the file with the start; blanks or commas between them, paths "
            "seen from LIST.",
        ),
    ] = None,
    table: Annotated[
        Path | None,
        typer.Option(
            metavar="CSV",
            rich_help_panel=_MANY,
            help="Keep a row of each pair, with its pose, from when it is done. The same command "
            "goes on from there.",
        ),
    ] = None,
    camera: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            rich_help_panel=DEPTH,
            help="Intrinsics of the depth maps: a 3x3 matrix as text, the JSON of Open3D, of "
            "RealSense or of an Azure Kinect's calibration, or ROS's camera_info in YAML. What "
            "the lens distorts is undistorted.",
        ),
    ] = None,
    intrinsics: IntrinsicsGiven = None,
    depth_scale: Annotated[
        float | None,
        typer.Option(
            metavar="UNITS",
            rich_help_panel=DEPTH,
            help="Units of the depth maps per metre: 1000 for integers and 1 for floating point, "
            "unless given.",
        ),
    ] = None,
    max_depth: Annotated[
        float | None,
        typer.Option(
            metavar="M",
            rich_help_panel=DEPTH,
            help="Leave out depths beyond this many metres.",
        ),
    ] = None,
    source_confidence: SourceConfidence = None,
    target_confidence: TargetConfidence = None,
    min_confidence: MinConfidence = 1,
    samples: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            rich_help_panel=CLOUDS,
            help="Points to spread over the surface of a mesh; 0 takes its vertices. Without, "
            "those are taken if they are many and evenly spread, and 100,000 points otherwise.",
        ),
    ] = None,
    viewpoint: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z|auto|none",
            rich_help_panel=CLOUDS,
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
            rich_help_panel=METHOD,
            help="Where to start: a 4x4 matrix as text, source to target, metres. Without, "
            "nothing is known, and the pose is looked for everywhere.",
        ),
    ] = None,
    search: Annotated[
        str,
        typer.Option(
            metavar="WHERE",
            rich_help_panel=METHOD,
            autocompletion=completion.words(("auto", "near", "everywhere")),
            help="Where to look: near the start, everywhere, or auto: near a start that is given "
            "and everywhere without.",
        ),
    ] = "auto",
    preset: Preset = presets.DEFAULT,
    rejector: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            rich_help_panel=METHOD,
            autocompletion=completion.words(presets.rejector_names()),
            help="Another rule than the preset's own for which points have a counterpart, one of: "
            f"{', '.join(presets.rejector_names())}.",
        ),
    ] = None,
    aligner: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            rich_help_panel=METHOD,
            autocompletion=completion.words(presets.aligner_names()),
            help="Another measure than the preset's own of how far matched points are apart, "
            f"one of: {', '.join(presets.aligner_names())}.",
        ),
    ] = None,
    colour: Colour = False,
    num_threads: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            rich_help_panel=METHOD,
            help="Threads to use; all cores that the process may use where it is not given. The "
            "result is the same with any number.",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="ALIGNED",
            rich_help_panel=_OUTPUT,
            help="Write the source, moved into the target's frame, as a cloud "
            "(.ply, .pcd, .las, .laz, .e57, .obj, .xyz, .xyzn, .pts, .asc, .csv, .txt, .npy, "
            ".npz); with all that it had, its normals turned, where the format has a place for it "
            "(.ply, .pcd, .las, .laz, .csv, .npz). Of many pairs this is a folder, as are --pose "
            "and --figure.",
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
            help="Print the result as one JSON object on stdout, one a line of many; all else "
            "on stderr.",
        ),
    ] = False,
    quiet: Quiet = False,  # noqa: ARG001
    verbose: Verbose = False,
) -> None:
    """Find the rigid motion that takes SOURCE onto TARGET.

    Example: hmrf-icp register A.ply B.ply

    Depth maps: hmrf-icp register a.png b.png --intrinsics 585,585,320,240

    Many onto one: hmrf-icp register A.ply B.ply C.ply TARGET.ply, or hmrf-icp
    register FOLDER TARGET.ply, with a table at the end.

    Exit status: 0 the pose is to be believed (confidence of 0.5 or more, or
    converged, where the preset gives none), all of them of many; 1 it is not
    (the result is printed and written all the same, and says what to try); 2
    bad input.
    """
    import hmrf_icp
    from hmrf_icp.cli.outputs import Outputs
    from hmrf_icp.cli.progress import most_iterations, registration_bar, told_of_compiling
    from hmrf_icp.cli.summary import json_text, summary
    from hmrf_icp.io import read_pose
    from hmrf_icp.view import Recording, story

    method = presets.preset(preset)
    if rejector is not None:
        presets.rejector(rejector)
    metric = presets.coloured(aligner) if colour else presets.aligner(aligner) if aligner else None
    require_positive("--depth-scale", depth_scale, "units per metre")
    require_positive("--max-depth", max_depth, "metres")
    lens = lens_of(camera, intrinsics)
    looked = viewpoint in (None, "auto", "none")
    stood = None if looked or viewpoint is None else position("--viewpoint", viewpoint)
    if search not in ("auto", "near", "everywhere"):
        raise InputError(f"--search: unknown {search!r}, expected auto, near or everywhere")
    start = None if init is None else read_pose(init)
    chosen = {"preset": preset, "rejector": rejector, "aligner": aligner, "colour": colour}
    asked = asked_for(sources or [], target, pairs, init, table)
    if not isinstance(asked, Pair):
        from hmrf_icp.cli.many import Many, refuse_for_many

        sure_of = source_confidence or target_confidence
        refuse_for_many(html=html, rrd=rrd, view=view or None, source_confidence=sure_of)

        def read(path: Path) -> PointCloud:
            cloud, _ = read_input(path, lens, depth_scale, max_depth, samples)
            return cloud if stood is None else seen_from(stood, cloud)

        depth = {"camera": camera, "intrinsics": intrinsics, "depth-scale": depth_scale}
        read_as = {"max-depth": max_depth, "samples": samples, "viewpoint": viewpoint}
        raise typer.Exit(
            Many(
                asked,
                read,
                presets.method(preset, rejector, metric),
                None if viewpoint == "none" else "auto",
                cast("Where", search),
                num_threads,
                folders=Outputs(output, pose, figure),
                table=table,
                inputs=[file for file in (camera, pairs) if file],
                settings=chosen | depth | read_as,
                as_json=as_json,
                profile=profile,
            ).run()
        )
    source, target = asked.source, asked.target
    outputs = Outputs(output, pose, figure, html, rrd)
    sure = (source_confidence, target_confidence)
    outputs.check([file for file in (source, target, camera, init, *sure) if file])

    named = chosen | {"source": source, "target": target}
    result: RegistrationResult | None = None
    told: Story | None = None
    written: list[Path] = []
    try:
        with registration_bar() as bar:
            bar.stage("Reading")
            (moving, moving_is_depth), (staying, staying_is_depth) = (
                read_input(file, lens, depth_scale, max_depth, samples, confidence, min_confidence)
                for file, confidence in zip((source, target), sure, strict=True)
            )
            given = (camera, intrinsics, depth_scale, max_depth)
            if not (moving_is_depth or staying_is_depth) and any(o is not None for o in given):
                note("neither file is a depth map: the options for depth maps have no effect")
            if stood is not None:
                if moving.camera is not None and staying.camera is not None:
                    note("both files come with a camera: --viewpoint has no effect")
                moving, staying = seen_from(stood, moving), seen_from(stood, staying)
            bar.stage("Registering", total=most_iterations(method))
            recording = Recording(also=bar)
            named_arguments = arguments_named({"source": source, "target": target, "init": init})
            with named_arguments, told_of_compiling(bar):
                result = hmrf_icp.register(
                    moving,
                    staying,
                    start,
                    preset=method,
                    rejector=None if rejector is None else presets.rejector(rejector),
                    aligner=metric,
                    viewpoint=None if viewpoint == "none" else "auto",
                    search=cast("Where", search),
                    num_threads=num_threads,
                    profile=profile or verbose,
                    on_iteration=recording,
                )
            bar.stage("Writing")
            called = method_named(preset, rejector, aligner, colour)
            names = source.name, target.name
            if view or html or rrd:
                told = story(result, start, recording, names=names)
            written = outputs.write(moving, staying, result, start, names, called, told)
    finally:
        # Also where writing failed: a full disk must not cost the result as well.
        if result is not None:
            if as_json:
                typer.echo(json_text(result, named))
            say(summary(result, source.name, target.name, written), err=as_json)
    if view and told is not None:
        from hmrf_icp.cli.view import serve_story

        serve_story(told, port, quiet=as_json)
    raise typer.Exit(0 if result.believed else NOT_BELIEVED)
