"""Registration from nowhere, and as points alone, beside the peers: one command, one table.

    python benchmarks/nowhere.py ../shared/data --output nowhere.csv
    python benchmarks/nowhere.py ../shared/data --judges 3dmatch,3dlomatch --methods robust

Every judge (see `judges.py`) is registered without a start with all that is known of its clouds,
and as points alone, (N, 3) without camera, viewpoint or grid, without a start and from pi/30,
pi/10 and pi/6 + 0.3 m (a share of the size where there are no metres). A peer that looks at no
start runs once a pair. One thread a run, so that its CPU time, which the table shows, is its time
on an idle machine. The CSV grows row by row, and the same command goes on from what is there. Give
each version of the code a CSV of its own; ``--beside OTHER.csv`` lays the rows of others (peers
among them) into the table.

``--methods`` takes presets, peers, and ``module:function`` for a function of (source, target, init)
that returns what `hmrf_icp.register` does.
"""

from __future__ import annotations

import argparse
import csv
import ctypes
import gc
import importlib
import multiprocessing
import os
import time
import warnings
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import hmrf_icp
import judges
from hmrf_icp import PointCloud, presets, se3
from hmrf_icp.evaluate.angles import parse_start
from hmrf_icp.evaluate.work import ONE_THREAD, one_core

COLUMNS = (
    "judge", "group", "pair", "overlap", "given", "start", "method", "right", "error_m",
    "error_rad", "confidence", "seconds", "cpu_seconds", "peak_mib", "failure",
)  # fmt: skip

KEY = ("judge", "pair", "given", "start", "method")

KNOWN, ORIGIN, POINTS = "known", "origin", "points"
"""What is given: all that is known; the points and the origin as a viewpoint; points alone."""

STARTS = ("none", "pi/30", "pi/10", "pi/6+0.3")

START_FREE = ("fpfh-ransac", "fpfh-gicp", "kiss-gicp")
PEERS = (*START_FREE, "gicp")

TOLD = 0.5

# --- methods --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Answer:
    """A pose (4, 4) and how sure the method is of it."""

    transformation: np.ndarray
    confidence: float | None = None


def gicp(source: np.ndarray, target: np.ndarray, init: np.ndarray, voxel: float) -> np.ndarray:
    """Refine with GICP on the points, matches up to two voxels away."""
    import small_gicp

    clouds = [small_gicp.PointCloud(points) for points in (target, source)]
    trees = [small_gicp.KdTree(cloud, num_threads=1) for cloud in clouds]
    for cloud, tree in zip(clouds, trees, strict=True):
        small_gicp.estimate_covariances(cloud, tree, num_neighbors=20, num_threads=1)
    result = small_gicp.align(
        *clouds,
        trees[0],
        init,
        registration_type="GICP",
        max_correspondence_distance=2 * voxel,
        max_iterations=50,
        num_threads=1,
    )
    return np.array(result.T_target_source)


def fpfh_ransac(source: np.ndarray, target: np.ndarray, voxel: float) -> np.ndarray:
    """Match FPFH by RANSAC, with the settings of Open3D's tutorial."""
    import open3d as o3d

    pipeline = o3d.pipelines.registration
    o3d.utility.random.seed(0)
    thinned, features = [], []
    for points in (source, target):
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.array(points)))
        cloud = cloud.voxel_down_sample(voxel)
        cloud.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(radius=2 * voxel, max_nn=30))
        around = o3d.geometry.KDTreeSearchParamHybrid(radius=5 * voxel, max_nn=100)
        thinned.append(cloud)
        features.append(pipeline.compute_fpfh_feature(cloud, around))
    reach = 1.5 * voxel
    result = pipeline.registration_ransac_based_on_feature_matching(
        *thinned,
        *features,
        True,
        reach,
        pipeline.TransformationEstimationPointToPoint(False),
        3,
        [
            pipeline.CorrespondenceCheckerBasedOnEdgeLength(0.9),
            pipeline.CorrespondenceCheckerBasedOnDistance(reach),
        ],
        pipeline.RANSACConvergenceCriteria(100_000, 0.999),
    )
    return np.array(result.transformation)


def kiss(source: np.ndarray, target: np.ndarray, voxel: float) -> np.ndarray:
    """Match with KISS-Matcher."""
    import kiss_matcher

    matcher = kiss_matcher.KISSMatcher(kiss_matcher.KISSMatcherConfig(voxel_size=voxel))
    found = matcher.estimate(list(source.astype(np.float32)), list(target.astype(np.float32)))
    if not found.valid:
        raise RuntimeError("KISS-Matcher found no consistent matches")
    rotation = se3.nearest_rotation(np.asarray(found.rotation, dtype=float))
    return se3.rigid(rotation, found.translation)


def answer(
    method: str, source: PointCloud, target: PointCloud, init: np.ndarray | None, voxel: float
) -> Answer:
    """Register by the method of this name."""
    if method in PEERS:
        moving, fixed = source.observed_points, target.observed_points
        if method == "gicp":
            return Answer(gicp(moving, fixed, np.eye(4) if init is None else init, voxel))
        pose = (kiss if method == "kiss-gicp" else fpfh_ransac)(moving, fixed, voxel)
        return Answer(pose if method == "fpfh-ransac" else gicp(moving, fixed, pose, voxel))
    if ":" in method:
        module, _, name = method.partition(":")
        result = getattr(importlib.import_module(module), name)(source, target, init)
    else:
        result = hmrf_icp.register(source, target, init, preset=method)
    return Answer(result.transformation, result.confidence)


# --- one run --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Run:
    """One registration."""

    judge: str
    pair: judges.JudgedPair
    given: str
    start: str
    method: str

    @property
    def key(self) -> tuple[str, ...]:
        """What the CSV knows it by."""
        return self.judge, self.pair.name, self.given, self.start, self.method


_clouds: dict[str, tuple[PointCloud, PointCloud]] = {}
_warm: set[tuple[str, str, str]] = set()


def do(run: Run) -> dict[str, object]:
    """Do a run; return its row."""
    pair = run.pair
    name = f"{run.judge} {pair.name}"
    if name not in _clouds:  # runs come pair by pair
        _clouds.clear()
        _clouds[name] = pair.source(), pair.target()
    source, target = (given_as(cloud, run.given) for cloud in _clouds[name])
    init = None if run.start == "none" else pair.start(parse_start(run.start))
    row: dict[str, object] = dict.fromkeys(COLUMNS, "")
    row |= dict(zip(KEY, run.key, strict=True), group=pair.group, overlap=f"{pair.overlap:.4f}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            kind = (run.method, run.judge, run.given)
            if kind not in _warm:  # what is compiled and imported is nobody's time
                _warm.add(kind)
                with one_core():  # TBB counts the cores the first time
                    answer(run.method, source, target, init, pair.voxel)
            before = reset_peak()
            begun, used = time.perf_counter(), time.process_time()
            found = answer(run.method, source, target, init, pair.voxel)
        except Exception as error:  # an answer like any other
            return row | {"right": 0, "failure": f"{type(error).__name__}: {error}"[:200]}
        seconds, used = time.perf_counter() - begun, time.process_time() - used
        right, metres, radians = pair.outcome(found.transformation)
    told = "" if found.confidence is None else f"{found.confidence:.4f}"
    return row | {
        "right": int(right),
        "error_m": f"{metres:.6g}",
        "error_rad": f"{radians:.6g}",
        "confidence": told,
        "seconds": f"{seconds:.4f}",
        "cpu_seconds": f"{used:.4f}",
        "peak_mib": "" if before is None else f"{peak() - before:.1f}",
    }


def given_as(cloud: PointCloud, given: str) -> PointCloud:
    """Leave of a cloud what is to be given."""
    if given == KNOWN:
        return cloud
    return PointCloud(cloud.observed_points, None, np.zeros(3) if given == ORIGIN else None)


def reset_peak() -> float | None:
    """Forget the highest memory so far; return what is held now, MiB (None off Linux)."""
    gc.collect()
    try:
        ctypes.CDLL("libc.so.6").malloc_trim(0)
        Path("/proc/self/clear_refs").write_text("5")
        return peak()
    except OSError:
        return None


def peak() -> float:
    """Highest resident memory since it was forgotten, MiB."""
    status = Path("/proc/self/status").read_text()
    return float(status.partition("VmHWM:")[2].split()[0]) / 1024


# --- all runs -------------------------------------------------------------------------------------


def planned(asked: argparse.Namespace) -> list[Run]:
    """All runs in the order of pairs."""
    runs = []
    for judge in asked.judges:
        pairs = judges.spread(list(judges.JUDGES[judge](asked.data)), asked.pairs, asked.seed)
        if not pairs:
            print(f"{judge}: no data in {asked.data}, skipped")
        for pair in pairs:
            for given in asked.given:
                for start in asked.starts:
                    if given == KNOWN and (pair.bare or start not in asked.known_starts):
                        continue  # points are all that is known: the same run
                    for method in asked.methods:
                        peer_repeats = (method in START_FREE and start != "none") or (
                            method in PEERS and given != POINTS
                        )
                        if not peer_repeats:
                            runs.append(Run(judge, pair, given, start, method))
    return runs


def rows_of(path: Path) -> list[dict[str, str]]:
    """Read the rows that are whole, and cut off one that is not."""
    if not path.is_file():
        return []
    text = path.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        path.write_text(whole, encoding="utf-8")
    return list(csv.DictReader(whole.splitlines()))


def work(asked: argparse.Namespace, runs: list[Run]) -> None:
    """Do what is not done, writing each row as it comes."""
    done = {tuple(row[name] for name in KEY) for row in rows_of(asked.output)}
    left = [run for run in runs if run.key not in done]
    print(f"{len(runs)} runs, {len(runs) - len(left)} of them done", flush=True)
    begun, context = time.monotonic(), multiprocessing.get_context("spawn")
    new = not done
    with (
        asked.output.open("a", encoding="utf-8", newline="") as stream,
        ProcessPoolExecutor(asked.jobs, context) as pool,
    ):
        writer = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
        if new:
            stream.truncate(0)
            writer.writeheader()
        # Pair by pair within a worker, so that each reads a pair's clouds about once.
        futures = [pool.submit(do, run) for run in left]
        for count, future in enumerate(as_completed(futures), 1):
            row = future.result()
            writer.writerow(row)
            stream.flush()
            if count % 25 == 0 or count == len(left):
                minutes = (time.monotonic() - begun) / 60
                rest = minutes * (len(left) - count) / count
                print(f"{count} of {len(left)}, {minutes:.1f} min, {rest:.1f} to go", flush=True)


# --- the table ------------------------------------------------------------------------------------


def recall(rows: list[dict[str, str]]) -> float:
    """Mean over scenes of the share of right ones (one scene: the share)."""
    scenes = defaultdict(list)
    for row in rows:
        scenes[row["group"] if row["judge"].startswith("3d") else ""].append(int(row["right"]))
    return float(np.mean([np.mean(right) for right in scenes.values()]))


def roc_area(confidence: np.ndarray, right: np.ndarray) -> float:
    """Chance that a right one is told more than a wrong one; NaN without both."""
    good, bad = confidence[right], confidence[~right]
    if not (len(good) and len(bad)):
        return float("nan")
    difference = good[:, None] - bad
    return float(((difference > 0) + 0.5 * (difference == 0)).mean())


def line(rows: list[dict[str, str]]) -> list[str]:
    """Cells of one line of the table."""
    right = np.array([row["right"] == "1" for row in rows])
    confidence = np.array([float(row["confidence"] or "nan") for row in rows])
    seconds = np.array([float(row["cpu_seconds"]) for row in rows if row["cpu_seconds"]])
    memory = [float(row["peak_mib"]) for row in rows if row["peak_mib"]]
    told = confidence >= TOLD
    sure = ["", "", ""]
    if np.isfinite(confidence).any():
        share = f"{told[right].mean():.2f}" if right.any() else "-"
        says = np.isfinite(confidence)
        area = roc_area(confidence[says], right[says])
        sure = [f"{(told & right).sum()}/{(told & ~right).sum()}", share, f"{area:.3f}"]
    times = (
        [f"{np.median(seconds):.2f}", f"{np.percentile(seconds, 95):.2f}"]
        if len(seconds)
        else ["", ""]
    )
    return [str(len(rows)), f"{recall(rows):.3f}", *sure, *times, f"{max(memory, default=0):.0f}"]


def table(rows: list[dict[str, str]], runs: list[Run]) -> str:
    """Lay out all rows that belong to the runs, as Markdown."""
    wanted = {run.key[:4] for run in runs}
    cells: dict[tuple[str, str, str], dict[str, list[dict[str, str]]]] = {}
    for row in rows:
        if (row["judge"], row["pair"], row["given"], row["start"]) in wanted:
            place = row["judge"], row["given"], row["start"]
            cells.setdefault(place, defaultdict(list))[row["method"]].append(row)
    order = {name: place for place, name in enumerate(judges.JUDGES)}
    starts = list(dict.fromkeys(run.start for run in runs))
    head = (
        "judge", "given", "start", "method", "pairs", "recall", "told right/wrong",
        "right ones told", "ROC area", "median CPU s", "95 % CPU s", "peak MiB",
    )  # fmt: skip
    lines = ["| " + " | ".join(head) + " |", "|---" * 4 + "|---:" * 8 + "|"]
    for place in sorted(cells, key=lambda p: (order[p[0]], p[1], starts.index(p[2]))):
        judge, given, _ = place
        methods = cells[place]
        for method, found in methods.items():
            lines.append("| " + " | ".join((*place, method, *line(found))) + " |")
        if given != POINTS:
            continue
        free = cells.get((judge, POINTS, "none"), {})
        peers = [methods.get(name) or free.get(name, []) for name in PEERS]
        together = oracle([rows for rows in peers if rows])
        if together:
            lines.append("| " + " | ".join((*place, "oracle of peers", *together)) + " |")
    return "\n".join(lines)


def oracle(peers: list[list[dict[str, str]]]) -> list[str]:
    """Count a pair as right that any of the peers has right; needs two peers or more."""
    if len(peers) < 2:
        return []
    best: dict[str, dict[str, str]] = {}
    for rows in peers:
        for row in rows:
            if row["pair"] not in best or row["right"] == "1":
                best[row["pair"]] = row
    found = list(best.values())
    return [str(len(found)), f"{recall(found):.3f}", *[""] * 6]


def words(text: str) -> list[str]:
    """Split at commas."""
    return [word.strip() for word in text.split(",") if word.strip()]


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", type=Path, help="folder with the judges' data")
    parser.add_argument("--output", type=Path, default=Path("nowhere.csv"))
    parser.add_argument("--judges", type=words, default=list(judges.JUDGES))
    parser.add_argument(
        "--methods", type=words, default=[presets.DEFAULT, *PEERS], help="default: all"
    )
    parser.add_argument(
        "--given", type=words, default=[KNOWN, POINTS], help="known, points, origin"
    )
    parser.add_argument("--starts", type=words, default=list(STARTS))
    parser.add_argument(
        "--known-starts", type=words, default=["none"], help="starts with all that is known given"
    )
    parser.add_argument("--pairs", type=int, default=40, help="of a judge, 0 = all; default 40")
    parser.add_argument("--seed", type=int, default=0, help="of the choice of pairs")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument(
        "--beside", type=Path, nargs="*", default=[], help="CSVs of other versions, for the table"
    )
    parser.add_argument("--table-only", action="store_true", help="print what is in the CSV")
    asked = parser.parse_args()
    unknown = set(asked.judges) - set(judges.JUDGES)
    if unknown:
        parser.error(
            f"no judge is called {', '.join(sorted(unknown))}; known: {list(judges.JUDGES)}"
        )
    asked.known_starts = [start for start in asked.known_starts if start in asked.starts]
    return asked


def main() -> None:
    """Run, then print the table."""
    asked = arguments()
    os.environ.update(ONE_THREAD)  # of the workers, which load their libraries anew
    runs = planned(asked)
    if not asked.table_only:
        work(asked, runs)
    rows = rows_of(asked.output)
    for other in asked.beside:
        for row in rows_of(other):
            peer = row["method"] in PEERS
            if not (peer and row["method"] in asked.methods):
                named = row["method"] if peer else f"{row['method']} ({other.stem})"
                rows.append(row | {"method": named})
    print(table(rows, runs))


if __name__ == "__main__":
    main()
