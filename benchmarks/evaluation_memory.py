"""Peak memory of an evaluation at a hundred runs or so, and at ten times as many.

python benchmarks/evaluation_memory.py [DATASET]
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time

from hmrf_icp.evaluate import Configuration, evaluate


def measure(dataset: str, frames_per_decile: int, axes: int, at_most: int | None) -> None:
    """Evaluate in this process, and print what it took as JSON."""
    configuration = Configuration(
        dataset,
        methods=("x84",),
        peers=("gicp@0.1",),
        targets=None,
        frames_per_decile=frames_per_decile,
        axes=axes,
        subsample=8,
    )
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        done = evaluate(configuration, folder, workers=at_most)
    mib = 1 << (10 if sys.platform != "darwin" else 20)
    print(
        json.dumps(
            {
                "runs": done.runs,
                "seconds": time.perf_counter() - begun,
                "parent": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / mib,
                "worker": resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / mib,
            }
        )
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("dataset", nargs="?", default="synthetic")
    parser.add_argument("--workers", type=int)
    parser.add_argument("--measure", nargs=2, type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.measure:
        measure(options.dataset, *options.measure, options.workers)
        return
    print("| runs | this process, MiB | largest worker, MiB | seconds |")
    print("|---|---|---|---|")
    for frames_per_decile, axes in ((1, 4), (3, 15)):
        command = [sys.executable, __file__, options.dataset]
        command += ["--measure", str(frames_per_decile), str(axes)]
        if options.workers:
            command += ["--workers", str(options.workers)]
        # A process of its own each: peaks are remembered for as long as a process lives.
        out = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        took = json.loads(out.splitlines()[-1])
        print(
            f"| {took['runs']:,} | {took['parent']:.0f} | {took['worker']:.0f} "
            f"| {took['seconds']:.0f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
