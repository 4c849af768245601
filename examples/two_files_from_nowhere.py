"""Two PLY files in frames of their own: no start, no camera, no viewpoint, any unit."""

import numpy as np

import hmrf_icp
from hmrf_icp import se3
from hmrf_icp.synthetic import render, scenes

# Yours come from a scanner or a reconstruction. These two are lists of points in millimetres,
# each turned and shifted into a frame that has nothing to do with the other's.
camera = hmrf_icp.PinholeCamera(width=160, height=120, fx=146, fy=146, cx=79.5, cy=59.5)
poses = scenes.trajectory("desk", 60)
frames = [
    se3.rigid(se3.rotation_exp((0.9, -1.7, 0.4)), (3000.0, -200.0, 50.0)),
    se3.rigid(se3.rotation_exp((-0.2, 0.5, 2.1)), (-800.0, 1200.0, 0.0)),
]
for name, pose, frame in zip(("a.ply", "b.ply"), (poses[14], poses[0]), frames, strict=True):
    points = camera.unproject(render.render(scenes.desk(), camera, pose)).reshape(-1, 3)
    points = 1000.0 * points[np.isfinite(points[:, 2])]
    hmrf_icp.write_cloud(name, hmrf_icp.PointCloud(se3.transform(frame, points)))

# From here on it is your program.
result = hmrf_icp.register("a.ply", "b.ply")

print(result)
print("where the source was seen from:", result.source_view)
print(result.transformation.round(3))
