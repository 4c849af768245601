"""The rows of `speed.py` that need a process of their own: memory, compiling, importing."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import speed_pairs
from speed_measure import Measured, Row, Setting

REGISTER = """
import sys, time
began = time.perf_counter()
import numpy as np
import hmrf_icp
imported = time.perf_counter() - began
pair = np.load(sys.argv[1])
camera = hmrf_icp.PinholeCamera(*pair["size"].tolist(), *pair["camera"].tolist())
source, target = (hmrf_icp.PointCloud(pair[name], camera) for name in ("source", "target"))
init, threads = pair["init"], int(sys.argv[2])
if sys.argv[3] == "nowhere":
    source, target, init = source.observed_points, target.observed_points, None

compiled = {}
if sys.argv[3] != "memory":
    from numba.core import event

    class Each(event.Listener):
        # What a kernel takes with those that it calls, and without them.
        def __init__(self):
            self.inner = []

        def on_start(self, event):
            self.inner.append([time.perf_counter(), 0.0])

        def on_end(self, event):
            began, within = self.inner.pop()
            took = time.perf_counter() - began
            if self.inner:
                self.inner[-1][1] += took
            name = event.data["dispatcher"].py_func
            name = f"{name.__module__.rpartition('.')[2]}.{name.__name__}"
            compiled[name] = compiled.get(name, 0.0) + took - within

    listener = Each() if sys.argv[3] == "each" else None
    if listener is not None:
        event.register("numba:compile", listener)

began = time.perf_counter()
result = hmrf_icp.register(source, target, init, num_threads=threads)
seconds = time.perf_counter() - began
try:
    status = open("/proc/self/status").read()
    peak = float(status.partition("VmHWM:")[2].split()[0]) / 1024
except OSError:
    import resource

    unit = 1 if sys.platform == "darwin" else 1024
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 2**20
import json

print(json.dumps(dict(seconds=seconds, imported=imported, peak=peak, compiled=compiled)))
"""

IMPORT = "import time; b = time.perf_counter(); import {}; print(time.perf_counter() - b)"


def python(code: str, *given: str, cache: str | None = None) -> str:
    """Run code in a process of its own; return what it prints."""
    environment = dict(os.environ)
    if cache is not None:
        environment["NUMBA_CACHE_DIR"] = cache
    command = [sys.executable, "-W", "ignore", "-c", code, *given]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=True)
    return done.stdout.splitlines()[-1]


def written(setting: Setting, folder: str) -> tuple[str, str]:
    """Write the pair to a file that NumPy alone reads; the name of the data too."""
    pair = speed_pairs.vga_pair(setting)
    camera, path = pair.source.camera, Path(folder) / "pair.npz"
    assert camera is not None
    np.savez(
        path,
        source=pair.source.points,
        target=pair.target.points,
        init=pair.init,
        camera=(camera.fx, camera.fy, camera.cx, camera.cy),
        size=(camera.width, camera.height),
    )
    return pair.name, str(path)


def register(
    setting: Setting, pair: str, how: str, count: int, cache: str | None = None
) -> list[dict]:
    """Register in so many processes, one after the other."""
    return [
        json.loads(python(REGISTER, pair, str(setting.threads), how, cache=cache))
        for _ in range(count)
    ]


def memory(setting: Setting) -> Measured:
    """Tell the peak resident memory of a process that registers one pair and does nothing else."""
    with tempfile.TemporaryDirectory() as folder:
        name, pair = written(setting, folder)
        register(setting, pair, "memory", 1)  # what is compiled takes memory of its own
        peak = np.median([run["peak"] for run in register(setting, pair, "memory", 3)])
    return Measured(float(peak), count=3, note=f"{name}, interpreter and libraries included")


def cold(setting: Setting) -> Measured:
    """Register for the first time, in an empty cache."""
    took, nowhere = [], []
    with tempfile.TemporaryDirectory() as folder:
        name, pair = written(setting, folder)
        for number in range(setting.some(3, 1)):
            cache = str(Path(folder) / f"cache-{number}")
            took.append(register(setting, pair, "near", 1, cache)[0]["seconds"])
            # The rest is compiled by what the first did not ask for.
            nowhere.append(register(setting, pair, "nowhere", 1, cache)[0]["seconds"])
        each = json.loads(python(REGISTER, pair, "1", "each", cache=str(Path(folder) / "each")))
    kernels = dict(sorted(each["compiled"].items(), key=lambda item: -item[1]))
    median = float(np.median(took))
    note = f"{name}; points from nowhere after it {np.median(nowhere):.1f} s"
    details = {"runs": took, "nowhere": nowhere, "kernels": kernels}
    return Measured(median, median, None, len(took), note, details)


def first(setting: Setting) -> Measured:
    """Register for the first time in a process; the cache is there."""
    with tempfile.TemporaryDirectory() as folder:
        name, pair = written(setting, folder)
        register(setting, pair, "near", 1)
        took = [run["seconds"] for run in register(setting, pair, "near", setting.some(7, 3))]
    median = float(np.median(took))
    return Measured(median, median, None, len(took), name, {"runs": took})


def importing(setting: Setting) -> Measured:
    """Import the package beside NumPy alone, each in processes of their own, in turn."""
    times = {"hmrf_icp": [], "numpy": []}
    for name in times:
        python(IMPORT.format(name))
    for _ in range(setting.some(15, 5)):
        for name, took in times.items():
            took.append(float(python(IMPORT.format(name))))
    ours, theirs = (np.array(took) for took in times.values())
    ratio = float(np.median(ours / theirs))
    return Measured(ratio, float(np.median(ours)), float(np.median(theirs)), len(ours))


ROWS = {
    "memory": Row("peak resident memory, 640 x 480 pair", "", 200.0, memory, "MiB"),
    "cold": Row("first register, nothing compiled", "", 5.0, cold, "s"),
    "first": Row("first register of a process, compiled before", "", 0.3, first, "s"),
    "import": Row("import hmrf_icp", "import numpy", 1.3, importing),
}
