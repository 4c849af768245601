"""Compiled loops work where their cache has no place: a read-only container without a home."""

from __future__ import annotations

import subprocess
import sys

WITHOUT_A_PLACE = """
import numba.core.caching as caching

def refuse(self):
    raise OSError("read-only file system")

for name in dir(caching):
    if name.endswith("Locator") and isinstance(getattr(caching, name), type):
        getattr(caching, name).ensure_cache_path = refuse

import numba
try:
    numba.njit(cache=True)(lambda x: x)
    raise SystemExit("this does not take the place away")
except RuntimeError:
    pass

import numpy as np
import hmrf_icp
points = np.random.default_rng(0).normal(size=(6, 7, 3))
print(hmrf_icp.register(points, points, preset="paper").converged)
"""


def test_registration_works_where_nothing_can_be_cached():
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_A_PLACE], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "True"
