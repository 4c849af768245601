"""A full VGA pair: time and peak memory beside small_gicp and Open3D, and nearest neighbours.

    python benchmarks/vga_pair.py

Every row runs in a process of its own, so that its peak memory is its own; it
is run once on a small pair first (compilation, loading) and then timed. Needs
`pip install '.[peers]'` for Open3D and small_gicp; rows without their library
are left out.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import threading
import time
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version

import hmrf_icp
from depth_pairs import error_text, machine, vga_pair
from hmrf_icp import presets, se3

OPEN3D_DISTANCES = (0.05, 0.1, 0.2)
OPEN3D_ITERATIONS = 50


# Registrations -----------------------------------------------------------------------------------


def hmrf(precision, rejector=None):
    """Register with the paper's preset."""
    field = replace(presets.PAPER.reject, precision=precision)

    def run(source, target, init):
        result = hmrf_icp.register(source, target, init, preset="paper", rejector=rejector or field)
        return result.transformation, result.iterations

    return run


def robust(source, target, init):
    """Register with the default preset, from clouds that nothing was worked out of yet."""
    fresh = (
        hmrf_icp.PointCloud(cloud.points, cloud.camera, cloud.viewpoint)
        for cloud in (source, target)
    )
    result = hmrf_icp.register(*fresh, init)
    return result.transformation, result.iterations


def gicp(distance, threads):
    """Register with small_gicp's GICP and one maximum correspondence distance, metres."""

    def run(source, target, init):
        import small_gicp as library

        clouds = [
            library.preprocess_points(
                cloud.observed_points, downsampling_resolution=1e-4, num_threads=threads
            )
            for cloud in (target, source)
        ]
        (onto, tree), (free, _) = clouds
        result = library.align(
            onto,
            free,
            tree,
            init,
            registration_type="GICP",
            max_correspondence_distance=distance,
            num_threads=threads,
        )
        return result.T_target_source, result.iterations

    return run


def open3d(distance):
    """Register with Open3D's point-to-point ICP and one maximum correspondence distance, metres."""

    def run(source, target, init):
        from open3d import geometry, pipelines, utility

        clouds = [
            geometry.PointCloud(utility.Vector3dVector(cloud.observed_points.copy()))
            for cloud in (source, target)
        ]
        registration = pipelines.registration
        result = registration.registration_icp(
            *clouds,
            distance,
            init,
            registration.TransformationEstimationPointToPoint(),
            registration.ICPConvergenceCriteria(max_iteration=OPEN3D_ITERATIONS),
        )
        return result.transformation, None

    return run


METHODS = {
    "hmrf-icp, robust": robust,
    "small_gicp GICP, 0.05 m, 2 threads": gicp(0.05, 2),
    "hmrf-icp, paper": hmrf("double"),
    "hmrf-icp, paper, single precision": hmrf("single"),
    "hmrf-icp, paper's loop with X84": hmrf("double", "x84"),
    **{f"Open3D point-to-point, {d:g} m": open3d(d) for d in OPEN3D_DISTANCES},
}


# Nearest neighbours ------------------------------------------------------------------------------


def pykdtree(target, queries):
    from pykdtree.kdtree import KDTree

    return KDTree(target).query(queries)[0]


def scipy(workers):
    def search(target, queries):
        from scipy.spatial import cKDTree

        return cKDTree(target).query(queries, workers=workers)[0]

    return search


def small_gicp(threads):
    def search(target, queries):
        import numpy as np
        from small_gicp import KdTree

        tree = KdTree(target, num_threads=threads)
        _, squared = tree.batch_nearest_neighbor_search(queries, num_threads=threads)
        return np.sqrt(squared)

    return search


SEARCHES = {
    "pykdtree": pykdtree,
    "scipy cKDTree, 1 worker": scipy(1),
    "scipy cKDTree, 2 workers": scipy(2),
    "small_gicp KdTree, 1 thread": small_gicp(1),
    "small_gicp KdTree, 2 threads": small_gicp(2),
}


# Measuring ---------------------------------------------------------------------------------------


def resident(field="VmRSS"):
    """Resident memory of this process, MiB (Linux)."""
    with open("/proc/self/status") as status:  # noqa: PTH123
        line = next(line for line in status if line.startswith(field))
    return int(line.split()[1]) / 1024


class PeakMemory:
    """Highest resident memory while the block runs, MiB above what it was before."""

    def __enter__(self):
        self.before = self.peak = resident()
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._watch)
        self._thread.start()
        return self

    def _watch(self):
        while not self._done.wait(0.005):
            self.peak = max(self.peak, resident())

    def __exit__(self, *_):
        self._done.set()
        self._thread.join()


def measure(run, repeats):
    """Wall and CPU seconds; memory in one run more, so that watching it costs no time."""
    import statistics

    wall, cpu = [], []
    for _ in range(repeats):
        began, began_cpu = time.perf_counter(), time.process_time()
        outcome = run()
        wall.append(time.perf_counter() - began)
        cpu.append(time.process_time() - began_cpu)
    with PeakMemory() as memory:
        run()
    return outcome, {
        "wall": min(wall),
        "wall_median": statistics.median(wall),
        "cpu": min(cpu),
        "cpu_median": statistics.median(cpu),
        "before": memory.before,
        "grown": memory.peak - memory.before,
    }


def one(kind, name, repeats):
    """Measure one row in this process; prints it as JSON."""
    _, source, target, truth, init = vga_pair()
    if kind == "method":
        run = METHODS[name]
        run(source.subsample(8), target.subsample(8), init)
        (pose, iterations), row = measure(lambda: run(source, target, init), repeats)
        row.update(error=error_text(pose, truth), iterations=iterations)
    else:
        queries = se3.transform(init, source.observed_points)
        points = target.observed_points
        search = SEARCHES[name]
        search(points[:1000], queries[:1000])
        distance, row = measure(lambda: search(points, queries), repeats)
        row["mean"] = float(distance.mean())
    print(json.dumps(row))


def rows(kind, names, repeats):
    """Measure every row in its own process; those whose library is missing say so."""
    for name in names:
        command = [sys.executable, __file__, "--one", kind, name, "--repeats", str(repeats)]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            print(f"{name}: {done.stderr.strip().splitlines()[-1]}", file=sys.stderr)
            continue
        yield name, json.loads(done.stdout.splitlines()[-1])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--one", nargs=2, metavar=("KIND", "NAME"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        one(*options.one, options.repeats)
        return
    name, source, target, truth, init = vga_pair()
    print(machine(), end="")
    for library in ("numba", "pykdtree", "scipy", "open3d", "small_gicp"):
        try:
            print(f", {library} {version(library)}", end="")
        except PackageNotFoundError:
            continue
    print(f"\n{name}: {len(source)} to {len(target)} points; start {error_text(init, truth)}\n")
    print("| registration | CPU s: least | median | wall s: least | median | memory | error |")
    print("|---|---|---|---|---|---|---|")
    for label, row in rows("method", METHODS, options.repeats):
        steps = f" ({row['iterations']} iterations)" if row["iterations"] else ""
        print(
            f"| {label}{steps} | {row['cpu']:.2f} | {row['cpu_median']:.2f} | {row['wall']:.2f} "
            f"| {row['wall_median']:.2f} | {row['before']:.0f} + {row['grown']:.0f} MiB "
            f"| {row['error']} |",
            flush=True,
        )
    print(
        "\n| tree built and queried once | CPU s: least | wall s: least | median | mean distance |"
    )
    print("|---|---|---|---|---|")
    for label, row in rows("search", SEARCHES, options.repeats):
        print(
            f"| {label} | {row['cpu']:.2f} | {row['wall']:.2f} | {row['wall_median']:.2f} "
            f"| {row['mean']:.6f} m |",
            flush=True,
        )


if __name__ == "__main__":
    main()
