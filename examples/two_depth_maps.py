"""Two depth maps of one room: files, a camera, and how far to believe the pose."""

import numpy as np
from PIL import Image

import hmrf_icp
from hmrf_icp.synthetic import render, scenes

# Yours come from a depth camera: 16-bit images in millimetres, 0 where nothing was seen.
camera = hmrf_icp.PinholeCamera(width=160, height=120, fx=146, fy=146, cx=79.5, cy=59.5)
poses = scenes.trajectory("desk", 60)
for name, pose in (("a.png", poses[16]), ("b.png", poses[0])):
    depth = render.render(scenes.desk(), camera, pose)
    Image.fromarray(np.nan_to_num(1000.0 * depth).astype(np.uint16)).save(name)

# From here on it is your program.
source = hmrf_icp.read_cloud("a.png", camera)
target = hmrf_icp.read_cloud("b.png", camera)
result = hmrf_icp.register(source, target)

print(result)
if result.believed:
    print("pose of the first camera in the second one's frame:")
    print(result.transformation.round(4))
