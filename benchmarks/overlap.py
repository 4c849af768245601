"""Estimated against true overlap: ``python benchmarks/overlap.py FOLDER [--every N]``.

FOLDER holds ``kitchen-exact`` and ``tabletop-exact`` (depth maps and poses) and ``real`` (pairs
of clouds with a known motion). Every N-th frame is registered by the default to three
target frames, from 6 degrees off, at 160 x 120 points. The true overlap is
``hmrf_icp.evaluate.protocol.surface_overlap`` under the known pose. Beside it, the paper's measure:
a source point counts when the target is nearer than six times its own neighbour, by the area that
it stands for and as a share of the points. `overlap_rendered.py` holds all of them against
rendered scenes, where what a sensor saw is known.
"""

from __future__ import annotations

import argparse
import json
import math
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import hmrf_icp
from hmrf_icp import PinholeCamera, PointCloud, RegistrationWarning, datasets, prepare, se3
from hmrf_icp.evaluate import protocol
from hmrf_icp.figures.style import inked, own_figure
from hmrf_icp.io.whole import written_whole

TARGETS = {"kitchen-exact": (60, 190, 310), "tabletop-exact": (0, 12, 27)}
START = protocol.Start(math.pi / 30)
AXES = protocol.Axes.random(1, seed=0)
SOLVED = 0.05
LEAST = 0.02
FIGURE = Path(__file__).parents[1] / "docs" / "figures" / "overlap.png"
LOOKS = {
    "kitchen-exact": ("o", "#56b4e9"),
    "tabletop-exact": ("s", "#8a6d00"),
    "real": ("^", "#4b0092"),
}
"""Marker and colour: kinds of pairs, so none of the colours that mean something in the figures."""


def true_overlap(
    source: PointCloud, target: PointCloud, truth: np.ndarray
) -> tuple[float, float, float]:
    """Overlap under the known pose: of surface, by the paper's reach of area, and of points."""
    one, other = prepare(source), prepare(target)
    area, points = one.surface.area, source.observed_points
    distance, _ = other.tree.query(se3.transform(truth, points))
    near = distance < protocol.NEIGHBOUR_FACTOR * protocol.neighbour_distance(points)
    surface = protocol.surface_overlap(one, other, truth)
    return surface, float(area @ near / area.sum()), float(near.mean())


def pairs(
    folder: Path, every: int
) -> Iterator[tuple[str, str, PointCloud, PointCloud, np.ndarray]]:
    for name, targets in TARGETS.items():
        sequence = datasets.open_sequence(folder / name)
        for index in targets:
            fixed = sequence.frame(index)
            target = fixed.load().subsample(4)
            for free in sequence.frames[::every]:
                if free.index != index:
                    truth = protocol.true_transformation(free.pose, fixed.pose)
                    yield name, f"{index}-{free.index}", free.load().subsample(4), target, truth
    for one in sorted((folder / "real").iterdir()):
        about = json.loads((one / "meta.json").read_text())
        clouds = []
        for which in ("source", "target"):
            points = np.load(one / f"{which}.npz")["points"].astype(float)
            camera = None
            if about.get("camera") and points.ndim == 3:
                width, height, *lens = about["camera"]
                camera = PinholeCamera(int(width), int(height), *lens)
            viewpoint = about.get("viewpoint")
            cloud = PointCloud(points, camera, None if viewpoint is None else np.array(viewpoint))
            step = math.ceil(math.sqrt(len(cloud) / 20_000)) if cloud.organised else 1
            clouds.append(cloud.subsample(step))
        yield "real", one.name, clouds[0], clouds[1], np.loadtxt(one / "gt.txt")


def measured(folder: Path, every: int) -> list[dict[str, object]]:
    rows: list[dict[str, object]] = []
    for kind, name, source, target, truth in pairs(folder, every):
        surface, area, points = true_overlap(source, target, truth)
        if area < LEAST:
            continue
        centroid = source.observed_points.mean(axis=0)
        init = protocol.perturbed(truth, centroid, AXES, 0, START)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RegistrationWarning)
            result = hmrf_icp.register(source, target, init)
        size = prepare(target).surface.size
        off = se3.inverse(truth) @ result.transformation
        moved = float(np.linalg.norm(se3.transform(off, centroid) - centroid))
        turned = se3.rotation_angle(off)
        # Frames of a camera by the paper's measure; other clouds by a share of their size.
        near = SOLVED if kind != "real" else SOLVED * size
        row = {
            "kind": kind,
            "name": name,
            "surface": surface,
            "area": area,
            "points": points,
            "estimate": result.overlap,
            "metres": moved,
            "radians": turned,
            "seconds": result.seconds,
            "confidence": result.confidence,
            "solved": moved < near and turned < SOLVED,
        }
        rows.append(row)
    return rows


def table(rows: list[dict[str, object]]) -> str:
    lines = [
        "| pairs | solved | within 0.05 of surface | mean difference "
        "| of area by the paper's reach | mean difference | of points |",
        "|---|---|---|---|---|---|---|",
    ]
    for kind in LOOKS:
        right = [r for r in rows if r["kind"] == kind and r["solved"]]
        surface, area, points = (
            np.array([r["estimate"] - r[key] for r in right])
            for key in ("surface", "area", "points")
        )
        lines.append(
            f"| {kind} ({sum(r['kind'] == kind for r in rows)}) | {len(right)} "
            f"| {np.mean(abs(surface) <= 0.05):.2f} | {surface.mean():+.3f} "
            f"| {np.mean(abs(area) <= 0.05):.2f} | {area.mean():+.3f} "
            f"| {np.mean(abs(points) <= 0.05):.2f} |"
        )
    return "\n".join(lines)


def draw(rows: list[dict[str, object]], path: Path) -> None:
    figure = own_figure(5.2, 5.0)
    axes = figure.add_axes((0.13, 0.11, 0.84, 0.84))
    ink = inked(axes)
    axes.fill_between([0, 1], [-0.05, 0.95], [0.05, 1.05], color=ink, alpha=0.15, linewidth=0)
    axes.plot([0, 1], [0, 1], color=ink, linewidth=0.8)
    for kind, (marker, colour) in LOOKS.items():
        for solved, face in ((True, colour), (False, "none")):
            some = [r for r in rows if r["kind"] == kind and r["solved"] == solved]
            x, y = ([r[key] for r in some] for key in ("surface", "estimate"))
            axes.scatter(x, y, s=24, marker=marker, facecolors=face, edgecolors=ink, linewidths=0.6)
        axes.scatter([], [], s=24, marker=marker, color=colour, label=kind)
    axes.scatter([], [], s=24, facecolors="none", edgecolors=ink, label="not solved")
    axes.set(xlim=(0, 1.02), ylim=(0, 1.02))
    axes.set_xlabel("true overlap: share of surface, under the known pose")
    axes.set_ylabel("result.overlap")
    axes.legend(frameon=False, loc="upper left", labelcolor=ink)
    with written_whole(path) as partial:
        figure.savefig(partial)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--every", type=int, default=3)
    parser.add_argument("--rows", type=Path, help="write every run here, as JSON")
    chosen = parser.parse_args()
    rows = measured(chosen.folder, chosen.every)
    if chosen.rows:
        chosen.rows.write_text(json.dumps(rows, indent=1))
    print(table(rows))
    draw(rows, FIGURE)


if __name__ == "__main__":
    main()
