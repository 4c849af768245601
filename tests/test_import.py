"""Importing the package loads what a call needs, and nothing that it may not need."""

from __future__ import annotations

import subprocess
import sys

HEAVY = ("numba", "scipy", "matplotlib", "PIL", "pykdtree", "rich", "typer", "joblib")


def test_import_leaves_heavy_libraries_alone():
    code = f"import sys, hmrf_icp; print(*[name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_every_public_name_is_there_and_has_a_docstring():
    import hmrf_icp

    assert hmrf_icp.__version__
    for name in hmrf_icp.__all__:
        assert getattr(hmrf_icp, name).__doc__
