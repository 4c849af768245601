"""Two scans of a spinning LiDAR, 1.3 m and 20 degrees apart, without odometry."""

import numpy as np

import hmrf_icp
from hmrf_icp import se3
from hmrf_icp.synthetic import render, scenes

# Yours come from a file or a driver: (N, 3), metres, in the sensor's own frame. A ROS message
# is read with sensor_msgs_py.point_cloud2.read_points, whose array is taken as it is.
beams = np.radians(np.linspace(22.5, -22.5, 32))
first = se3.rigid(np.eye(3), (0.6, -1.6, 1.0))
second = se3.rigid(se3.rotation_exp((0.0, 0.0, np.radians(20.0))), (1.6, -0.8, 1.1))
rng = np.random.default_rng(0)
scans = []
for pose in (second, first):
    points = render.render_lidar(scenes.desk(), pose, beams, azimuths=512).observed_points
    scans.append(points * (1.0 + rng.normal(0.0, 0.002, (len(points), 1))))

# From here on it is your program. The sensor stood at the origin of both scans: said, it is
# used at once; unsaid, it would be found out. A scan that was moved has its place elsewhere.
source, target = scans
result = hmrf_icp.register(source, target, viewpoint=(0.0, 0.0, 0.0))

print(result)
print(f"standard deviation of the place: {np.sqrt(np.diag(np.linalg.inv(result.information)))[3:]}")
