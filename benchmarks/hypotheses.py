"""How often local features bring the right pose, how early, and how fast.

    OMP_NUM_THREADS=1 python benchmarks/hypotheses.py --pairs 40

Of each group of pairs: the share with a pose within reach (0.45 and 0.15 of the target's size;
0.5 and 0.2 m where the benchmark measures in metres) among all hypotheses, and among the first
few as the score orders them, as what both sensors saw does, and both together.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import hypothesis_pairs
from hmrf_icp import se3
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.search import features
from hmrf_icp.search import hypotheses as search
from hmrf_icp.search.confidence import log_odds
from hmrf_icp.search.visibility import VisibilityTest

FIRST = (1, 5, 10, 20, 50)


def groups(count, seed):
    scenes = ("kitchen", "lab", "hotel_uc")
    for benchmark in ("3DMatch", "3DLoMatch"):
        for scene in scenes:
            yield (
                f"{benchmark} {scene}",
                hypothesis_pairs.three_d_match(scene, benchmark, count, seed),
            )
    yield "fragments-exact", hypothesis_pairs.fragments(count, seed)
    yield "kitchen-exact", hypothesis_pairs.depth_pairs("kitchen-exact", count, 4, seed)
    yield "tabletop-exact", hypothesis_pairs.depth_pairs("tabletop-exact", count, 4, seed)
    yield "real", hypothesis_pairs.real_pairs()


def reach(pair):
    """Errors below which a pose is near, and right, metres."""
    return (0.5, 0.2) if pair.information is not None else (0.45 * pair.size, 0.15 * pair.size)


def seen_from(cloud, pair, bare):
    """Place a fragment of 3DMatch in front of its first camera, which stood at the origin."""
    if bare:
        return PointCloud(cloud.points.reshape(-1, 3))
    known = np.zeros(3) if pair.information is not None else cloud.viewpoint
    return PointCloud(cloud.points.reshape(-1, 3), None, known)


def ours(pair, bare, count):
    """Hypotheses with their seconds by stage, and their order by score, by view, by both."""
    source, target = (seen_from(cloud, pair, bare) for cloud in (pair.source, pair.target))
    mine, theirs = PreparedCloud(source).surface, PreparedCloud(target).surface
    oriented = mine.oriented and theirs.oriented
    watch = [time.process_time()]
    levels = []
    for places in search.PLACES:
        edge = features.common_edge(mine.points, theirs.points, places)
        described = [features.describe(s.points, s.normals, edge, oriented) for s in (mine, theirs)]
        levels.append(search.Matched.of(*described))
    watch.append(time.process_time())
    found = search.among(levels, oriented, count)
    watch.append(time.process_time())
    seconds = np.diff(watch)
    orders = {"score": np.arange(len(found.poses))}
    if oriented:
        judge = VisibilityTest(PreparedCloud(source), PreparedCloud(target), 1000)
        seen = np.array([log_odds(judge(pose)) for pose in found.poses])
        orders["view"] = np.argsort(-seen, kind="stable")
        orders["both"] = np.argsort(-(seen + found.scores), kind="stable")
    return found.poses, orders, seconds


def ransac(pair, _bare, _count):
    """Open3D's features and RANSAC at one voxel, a share of the size."""
    import open3d as o3d

    voxel = 0.05 * pair.size
    sides, described = [], []
    begun = time.process_time()
    for cloud in (pair.source, pair.target):
        side = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(cloud.observed_points.copy()))
        side = side.voxel_down_sample(voxel)
        side.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(2 * voxel, 30))
        side.orient_normals_towards_camera_location(np.zeros(3))
        sides.append(side)
        described.append(
            o3d.pipelines.registration.compute_fpfh_feature(
                side, o3d.geometry.KDTreeSearchParamHybrid(5 * voxel, 100)
            )
        )
    o3d.utility.random.seed(0)
    registration = o3d.pipelines.registration
    result = registration.registration_ransac_based_on_feature_matching(
        *sides,
        *described,
        True,
        1.5 * voxel,
        registration.TransformationEstimationPointToPoint(False),
        3,
        [
            registration.CorrespondenceCheckerBasedOnEdgeLength(0.9),
            registration.CorrespondenceCheckerBasedOnDistance(1.5 * voxel),
        ],
        registration.RANSACConvergenceCriteria(1_000_000, 0.999),
    )
    pose = np.asarray(result.transformation)[None]
    return pose, {"only": np.arange(1)}, np.array([time.process_time() - begun])


def kiss(pair, _bare, _count):
    """KISS-Matcher at one voxel, a share of the size."""
    import kiss_matcher

    begun = time.process_time()
    matcher = kiss_matcher.KISSMatcher(kiss_matcher.KISSMatcherConfig(0.05 * pair.size))
    result = matcher.estimate(pair.source.observed_points, pair.target.observed_points)
    pose = se3.rigid(np.asarray(result.rotation), np.asarray(result.translation))[None]
    return pose, {"only": np.arange(1)}, np.array([time.process_time() - begun])


METHODS = {"ours": ours, "ours, bare": ours, "RANSAC": ransac, "KISS-Matcher": kiss}


def measure(name, pairs, count):
    """One row for each order of one group's hypotheses."""
    near, right, ranks, kept, seconds = [], [], {}, [], []
    for pair in pairs:
        poses, orders, taken = METHODS[name](pair, name.endswith("bare"), count)
        kept.append(len(poses))
        seconds.append(taken)
        errors = pair.rmse(poses) if len(poses) else np.array([np.inf])
        close, closer = reach(pair)
        near.append(errors.min() < close)
        right.append(errors.min() < closer)
        for order, rows in orders.items():
            good = np.flatnonzero(errors[rows] < close) if len(poses) else []
            ranks.setdefault(order, []).append(good[0] if len(good) else 10**6)
    rows = []
    for order, places in ranks.items():
        first = [float((np.array(places) < n).mean()) for n in FIRST]
        rows.append((order, first))
    middle = np.median(seconds, axis=0)
    return np.mean(near), np.mean(right), np.mean(kept), middle, rows


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=40, help="of each group")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=200, help="hypotheses a pair")
    parser.add_argument("--only", default="", help="groups whose name contains this")
    parser.add_argument("--methods", default="ours;ours, bare;RANSAC;KISS-Matcher")
    options = parser.parse_args()
    head = " ".join(f"top{n:<3}" for n in FIRST)
    print(f"{'group':22} {'method':13} {'kept':>5} near  right | {'by':6} {head} | seconds")
    for group, pairs in groups(options.pairs, options.seed):
        if options.only not in group:
            continue
        pairs = list(pairs)
        for name in options.methods.split(";"):
            METHODS[name](pairs[0], name.endswith("bare"), options.count)
            near, right, kept, seconds, rows = measure(name, pairs, options.count)
            for order, first in rows:
                share = " ".join(f"{value:6.2f}" for value in first)
                spent = " + ".join(f"{value:.2f}" for value in seconds)
                print(
                    f"{group:22} {name:13} {kept:5.0f} {near:.2f}  {right:.2f}  | {order:6} "
                    f"{share} | {spent}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
