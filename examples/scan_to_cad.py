"""A scan of a part onto its CAD model, and a map of where it deviates."""

import numpy as np
from matplotlib.figure import Figure

import hmrf_icp
from hmrf_icp import plot, se3
from hmrf_icp.synthetic import render, scenes
from hmrf_icp.synthetic.primitives import Box

# Centre and size of three boxes, metres.
PARTS = [((0, 0, 10), (120, 80, 20)), ((-35, 15, 40), (30, 40, 40)), ((40, -20, 32), (25, 25, 25))]
PARTS = 0.001 * np.array(PARTS)


def faces(centre, size, step=0.0015):
    """Points (N, 3) all over a box, and their normals outwards."""
    points, normals = [], []
    for axis in range(3):
        a, b = (np.arange(step / 2, n, step) - n / 2 for n in np.delete(size, axis))
        grid = np.stack(np.meshgrid(a, b), axis=-1).reshape(-1, 2)
        for side in (-1.0, 1.0):
            points.append(np.insert(grid, axis, side * size[axis] / 2, axis=1) + centre)
            normals.append(np.tile(side * np.eye(3)[axis], (len(grid), 1)))
    return np.concatenate(points), np.concatenate(normals)


# Yours: points on the model's mesh, evenly by area, with the normals of its faces; and a file.
points, normals = map(np.concatenate, zip(*(faces(*part) for part in PARTS), strict=True))
model = hmrf_icp.PointCloud(points, normals=normals)
made = [Box(se3.rigid(np.eye(3), centre), size) for centre, size in PARTS]
made[1] = Box(se3.rigid(np.eye(3), PARTS[1, 0] + (0, 0, 0.0015)), PARTS[1, 1])  # too high
camera = hmrf_icp.PinholeCamera(200, 150, 200, 200, 99.5, 74.5)
view = scenes.look_at((0.15, -0.16, 0.19), (0.0, 0.0, 0.015))
depth = render.render(scenes.Scene("part", tuple(made)), camera, view)
depth += np.random.default_rng(0).normal(0.0, 0.00005, depth.shape)
scan = hmrf_icp.PointCloud.from_depth(depth, camera)

# From here on it is your program.
result = hmrf_icp.register(scan, model)
print(result)

found = plot.deviations(result, tolerance=0.0003)
print(f"{found.share_within:.0%} within 0.3 mm")
figure = Figure(figsize=(6.4, 5.6))
plot.deviation(result, ax=figure.add_subplot(), tolerance=0.0003)
figure.savefig("deviation.png", dpi=150, bbox_inches="tight")
