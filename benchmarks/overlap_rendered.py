"""Overlap against what a sensor really saw: ``python benchmarks/overlap_rendered.py``.

Views of a desk and a table (160 x 120 pixels, noise of 1 mm at 1 m), with camera and as points
alone, and scans of a street by LiDARs of 16, 32 and 64 beams (noise of 2 cm, 1 to 20 m apart). The
true overlap is that of the source's surface as rays find it: the source's view is rendered densely,
each ray counts by the area that it stands for, and is seen by the target where a ray from
there meets the same place, within its field of view. Held against it, under the known pose:
``result.overlap``, and the measures of ``hmrf_icp.evaluate.protocol``.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np

from hmrf_icp import PinholeCamera, PointCloud, prepare, se3
from hmrf_icp.clouds.overlap import overlap
from hmrf_icp.evaluate import protocol
from hmrf_icp.synthetic import render, scenes
from hmrf_icp.synthetic.primitives import Box, Frustum, Primitive, Rectangle

FRAMES = ((8, 0), (16, 0), (24, 0), (30, 10), (40, 18), (12, 30), (50, 30), (45, 20))
BEAMS = {16: (-15.0, 15.0), 32: (-25.0, 10.0), 64: (-25.0, 3.0)}
APART = (1.0, 4.0, 10.0, 20.0)
AZIMUTHS, FAR, HEIGHT = 900, 60.0, 1.8
DENSE = 6
SAME = 1e-3
LEAST = 0.02

Case = tuple[str, PointCloud, PointCloud, np.ndarray, float]


def at(x: float, y: float, z: float) -> np.ndarray:
    return se3.rigid(np.eye(3), [x, y, z])


def street(seed: int) -> scenes.Scene:
    """Two rows of houses, and before them cars and poles."""
    rng = np.random.default_rng(seed)
    parts: list[Primitive] = [Rectangle(at(0, 0, 0), (160.0, 160.0))]
    for side in (-1, 1):
        x = -60.0
        while x < 60.0:
            width, depth, height = rng.uniform(6, 18), rng.uniform(6, 12), rng.uniform(4, 14)
            place = at(x + width / 2, side * (rng.uniform(8, 13) + depth / 2), height / 2)
            parts.append(Box(place, (width, depth, height)))
            x += width + rng.uniform(1, 6)
        for _ in range(6):
            place = at(rng.uniform(-50, 50), side * rng.uniform(4, 6), 0.75)
            parts.append(Box(place, (4.2, 1.8, 1.5)))
        for _ in range(8):
            place = at(rng.uniform(-50, 50), side * rng.uniform(6, 8), 0.0)
            parts.append(Frustum(place, 0.15, 0.15, 6.0))
    return scenes.Scene("street", tuple(parts))


def hit(scene: scenes.Scene, place: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Which of the points (N, 3) nothing hides from a place, both in the world."""
    rays = points - place
    reach = np.linalg.norm(rays, axis=1)
    first = np.full(len(points), np.inf)
    for part in scene.primitives:
        first = np.minimum(first, part.intersect(place, rays / reach[:, None]))
    return np.asarray(np.abs(first - reach) < SAME * reach)


def areas(points: np.ndarray, jump: float) -> np.ndarray:
    """Area of each cell of a grid of points (H, W, 3); NaN where neighbours are not of one surface.

    ``jump`` is the share of the distance from which they are not.
    """
    down, right = points[1:, :-1] - points[:-1, :-1], points[:-1, 1:] - points[:-1, :-1]
    reach = np.linalg.norm(points, axis=-1)
    steps = [np.diff(reach, axis=axis) for axis in (0, 1)]
    far = np.maximum(np.abs(steps[0][:, :-1]), np.abs(steps[1][:-1])) > jump * reach[:-1, :-1]
    return np.where(far, np.nan, np.linalg.norm(np.cross(down, right), axis=-1))


def of_surface(area: np.ndarray, seen: np.ndarray) -> float:
    return float(area @ seen / area.sum())


def views(name: str) -> Iterator[Case]:
    camera = PinholeCamera(160, 120, 146.0, 146.0, 79.5, 59.5)
    dense = PinholeCamera(640, 480, 584.0, 584.0, 319.5, 239.5)
    scene, poses = scenes.SCENES[name](), scenes.trajectory(name, 60)
    for pair in FRAMES:
        clouds = []
        for index in pair:
            depth = render.render(scene, camera, poses[index])
            noise = 1e-3 * np.random.default_rng(index).standard_normal(depth.shape)
            clouds.append(PointCloud.from_depth(depth + noise * depth**2, camera, depth_scale=1.0))
        source, target = (poses[index] for index in pair)
        points = dense.unproject(render.render(scene, dense, source))
        area = areas(points, 0.03)
        some = np.isfinite(area)
        world = se3.transform(source, points[:-1, :-1][some])
        u, v, depth = camera.project(se3.transform(se3.inverse(target), world))
        seen = (depth > 0) & (abs(u - 79.5) < 80.0) & (abs(v - 59.5) < 60.0)
        seen[seen] = hit(scene, target[:3, 3], world[seen])
        share = of_surface(area[some], seen)
        truth = se3.inverse(target) @ source
        if share >= LEAST:
            yield f"{name}, with its camera", *clouds, truth, share
            bare = [PointCloud(cloud.observed_points) for cloud in clouds]
            yield f"{name}, points alone", *bare, truth, share


def scans(seed: int) -> Iterator[Case]:
    scene = street(seed)
    for beams, between in BEAMS.items():
        for apart in APART:
            yield scan_pair(scene, beams, np.radians(between), apart, seed)


def scan_pair(
    scene: scenes.Scene, beams: int, between: Sequence[float], apart: float, seed: int
) -> Case:
    source = at(0.0, 0.0, HEIGHT)
    target = se3.rigid(se3.rotation_exp([0.0, 0.0, 0.2]), [apart, 0.5, HEIGHT])
    up = np.linspace(*between, beams)
    clouds = []
    for k, pose in enumerate((source, target)):
        points = render.render_lidar(scene, pose, up, AZIMUTHS, FAR).points
        points = points[np.isfinite(points[..., 0])]
        reach = np.linalg.norm(points, axis=1, keepdims=True)
        off = np.random.default_rng((seed, k)).normal(0.0, 0.02, reach.shape)
        clouds.append(PointCloud(points * (1.0 + off / reach), viewpoint=np.zeros(3)))
    dense = np.linspace(*between, DENSE * beams)
    points = render.render_lidar(scene, source, dense, AZIMUTHS, FAR).points
    area = areas(points, 0.15)
    some = np.isfinite(area)
    world = se3.transform(source, points[:-1, :-1][some])
    there = se3.transform(se3.inverse(target), world)
    reach = np.linalg.norm(there, axis=1)
    rise = np.arcsin(there[:, 2] / reach)
    half = 0.5 * (up[1] - up[0])
    seen = (rise > up[0] - half) & (rise < up[-1] + half) & (reach < FAR)
    seen[seen] = hit(scene, target[:3, 3], world[seen])
    share = of_surface(area[some], seen)
    return f"street, {beams} beams", *clouds, se3.inverse(target) @ source, share


def main() -> None:
    off = defaultdict(list)
    for cases in (views("desk"), views("tabletop"), scans(0), scans(1)):
        for name, source, target, truth, share in cases:
            one, other = prepare(source), prepare(target)
            area = one.surface.area
            distance, _ = other.tree.query(se3.transform(truth, one.points))
            near = distance < protocol.NEIGHBOUR_FACTOR * protocol.neighbour_distance(one.points)
            told = (
                overlap(one, other, truth),
                protocol.surface_overlap(one, other, truth),
                of_surface(area, near),
                near.mean(),
            )
            off[name].append(np.array(told) - share)
    columns = ("`overlap`", "`surface_overlap`", "the paper's reach, of area", "of points")
    print("| clouds | pairs | " + " | ".join(columns) + " |\n|---|---|" + "---|" * len(columns))
    for name, rows in off.items():
        each = np.array(rows)
        cells = [
            f"{mean:+.3f}, {share:.2f}"
            for mean, share in zip(each.mean(axis=0), (abs(each) <= 0.05).mean(axis=0), strict=True)
        ]
        print(f"| {name} | {len(each)} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
