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


def test_a_name_is_loaded_when_it_is_asked_for_and_others_are_refused():
    code = (
        "import sys, hmrf_icp; before = 'hmrf_icp.registration' in sys.modules; "
        "hmrf_icp.register; print(before, 'hmrf_icp.registration' in sys.modules, "
        "hmrf_icp.se3.exp.__name__, hasattr(hmrf_icp, 'nothing_of_that_name'))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True", "exp", "False"]
