"""A method of one's own beside the default, on one's own pairs, in a report.

Needs `pip install 'hmrf-icp[evaluate]'`.
"""

from pathlib import Path

import numpy as np

import hmrf_icp
from hmrf_icp import se3
from hmrf_icp.evaluate import Configuration, Estimate, NamedMethod, Start, evaluate
from hmrf_icp.evaluate.standings import standings
from hmrf_icp.io import write_pose
from hmrf_icp.synthetic import render, scenes

# Yours: a folder a pair, with two arrays of points and the true pose, source to target.
camera = hmrf_icp.PinholeCamera(width=80, height=60, fx=73, fy=73, cx=39.5, cy=29.5)
poses = scenes.trajectory("tabletop", 60)
for one, other in ((4, 0), (26, 22)):
    folder = Path("pairs") / f"{one}-to-{other}"
    folder.mkdir(parents=True, exist_ok=True)
    for name, pose in (("source", poses[one]), ("target", poses[other])):
        points = camera.unproject(render.render(scenes.tabletop(), camera, pose))
        np.savez(folder / f"{name}.npz", points=points.astype(np.float32))
    write_pose(folder / "gt.txt", se3.inverse(poses[other]) @ poses[one])
    (folder / "meta.json").write_text('{"room": true}')


def centroids(source, target, init):
    """Lay centroid on centroid: hardly a registration, but it has the form of one."""
    moved = np.eye(4) if init is None else init.copy()
    centre = se3.transform(moved, source.points).mean(axis=0)
    moved[:3, 3] += target.points.mean(axis=0) - centre
    return Estimate(moved)


if __name__ == "__main__":  # worker processes import this file
    asked = Configuration("pairs", peers=(), starts=(Start(np.pi / 10),), axes=1)
    mine = NamedMethod("centroids", centroids)
    done = evaluate(asked, "evaluation", workers=1, extra_methods=[mine])
    for row in standings(done.folder / "results.csv"):
        for start, tally in row.by_start.items():
            print(f"{row.method} from {start}: {tally.solved} of {tally.runs} solved")
