"""An Open3D program, and the three lines that change: no voxel size, no distance, no start."""

import numpy as np
import open3d as o3d

import hmrf_icp  # 1: the import
from hmrf_icp.synthetic import render, scenes


def view(pose):
    """Render a desk as Open3D's cloud; yours comes from o3d.io.read_point_cloud."""
    intrinsics = o3d.camera.PinholeCameraIntrinsic(160, 120, 146, 146, 79.5, 59.5)
    camera = hmrf_icp.PinholeCamera(160, 120, 146, 146, 79.5, 59.5)
    depth = np.nan_to_num(render.render(scenes.desk(), camera, pose)).astype(np.float32)
    image = o3d.geometry.Image(depth)
    return o3d.geometry.PointCloud.create_from_depth_image(image, intrinsics, depth_scale=1.0)


poses = scenes.trajectory("desk", 60)
source, target = view(poses[16]), view(poses[0])

# It was:
#   result = o3d.pipelines.registration.registration_icp(
#       source, target, max_correspondence_distance=0.05, init=np.eye(4))
result = hmrf_icp.register(source, target)  # 2: the call

if not result.believed:  # 3: whether to go on, which fitness could not tell
    raise SystemExit(str(result))

source.transform(result.transformation)  # all else stays as it was
print(f"fitness {result.fitness:.3f}, inlier_rmse {result.inlier_rmse:.4f}")
print(f"{len(result.correspondence_set)} correspondences")
