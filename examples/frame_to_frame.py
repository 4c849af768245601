"""A sequence of depth maps, frame to frame: each cloud prepared once, the last motion as start."""

import numpy as np

import hmrf_icp
from hmrf_icp import se3
from hmrf_icp.synthetic import render, scenes

# Yours come from a folder: hmrf_icp.read_cloud("frame-000000.depth.png", camera), and so on.
camera = hmrf_icp.PinholeCamera(width=160, height=120, fx=146, fy=146, cx=79.5, cy=59.5)
walk = scenes.trajectory("desk", 60)[:24:3]
rng = np.random.default_rng(0)
exact = [render.render(scenes.desk(), camera, pose) for pose in walk]
maps = [render.sensor_noise(depth, camera, rng) for depth in exact]  # 16 bits, millimetres
frames = [hmrf_icp.prepare(hmrf_icp.PointCloud.from_depth(depth, camera)) for depth in maps]

# From here on it is your program. `world[i]` takes frame i to the first frame.
world, motion, breaks = [np.eye(4)], np.eye(4), []
for i in range(1, len(frames)):
    result = hmrf_icp.register(frames[i], frames[i - 1], motion)
    if not result.believed:  # the walk was not that steady: look everywhere
        result = hmrf_icp.register(frames[i], frames[i - 1])
    if not result.believed:
        breaks.append(i)
    motion = result.transformation
    world.append(world[-1] @ motion)
    print(f"{i}: confidence {result.confidence:.2f}, overlap {result.overlap:.2f}")

truth = [se3.inverse(walk[0]) @ pose for pose in walk]
metres, radians = se3.error(world[-1], truth[-1])
print(
    f"after {len(walk) - 1} steps {1000 * metres:.1f} mm and {np.degrees(radians):.2f} degrees off"
)
print(f"not to be believed: {breaks or 'none'}")
