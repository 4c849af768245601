"""Threads: as many as are asked for, the same digits with any number, none left behind."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import textwrap
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import hmrf_icp
import synthetic
from hmrf_icp import threads
from hmrf_icp.clouds import tree
from hmrf_icp.clouds.tree import Tree
from hmrf_icp.errors import InputError


@pytest.fixture
def four_cores(monkeypatch):
    """A machine of four cores, and pieces small enough for these clouds."""
    monkeypatch.setattr(threads, "most", lambda: 4)
    monkeypatch.setattr(tree, "PIECE", 40)


def test_the_digits_are_the_same_with_any_number_of_threads(four_cores):
    source, target = synthetic.pair()
    one, *others = (
        hmrf_icp.register(source, target, num_threads=count) for count in (1, 2, 4, None)
    )
    for other in others:
        np.testing.assert_array_equal(other.transformation, one.transformation)
        np.testing.assert_array_equal(other.distance, one.distance)
        assert other.confidence == one.confidence


def test_work_is_shared_among_threads_that_end_with_the_call(four_cores):
    rng = np.random.default_rng(0)
    points, asked = rng.normal(size=(500, 3)), rng.normal(size=(1000, 3))
    seen = set()

    plain = Tree(points)
    expected = plain.query(asked, k=3)
    inner = plain._tree

    class Inner:
        def query(self, *given, **named):
            seen.add(threading.get_ident())
            return inner.query(*given, **named)

    plain._tree = Inner()
    before = threading.active_count()
    with threads.using(3):
        shared = plain.query(asked, k=3)
    assert threading.active_count() == before
    assert seen
    assert threading.get_ident() not in seen
    for mine, theirs in zip(shared, expected, strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_no_setting_is_left_changed():
    openmp = threads._openmp()
    if openmp is None:
        pytest.skip("the search trees come without OpenMP")
    before = openmp.omp_get_max_threads()
    try:
        openmp.omp_set_num_threads(3)
        hmrf_icp.register(*synthetic.pair(), num_threads=1)
        assert openmp.omp_get_max_threads() == 3
    finally:
        openmp.omp_set_num_threads(before)


@pytest.mark.parametrize("wrong", [0, -1, 1.5, "all", np.nan])
def test_a_number_of_threads_that_is_none_is_refused(wrong):
    with pytest.raises(InputError, match="num_threads"):
        hmrf_icp.register(*synthetic.pair(), num_threads=wrong)


def test_there_are_never_more_threads_than_cores(four_cores):
    assert threads.checked(1000) == 4
    assert threads.checked(np.int64(2)) == 2


@pytest.mark.skipif(
    "fork" not in multiprocessing.get_all_start_methods(), reason="nothing forks here"
)
def test_a_process_may_fork_after_it_has_registered():
    code = textwrap.dedent(
        """
        import multiprocessing, sys, warnings
        import numpy as np
        import hmrf_icp
        warnings.simplefilter("ignore")
        points = np.random.default_rng(0).uniform(size=(6000, 3)) * (1, 1, 0.1)
        def work(i):
            return hmrf_icp.register(points[:3000 + i], points).transformation[0, 3]
        if __name__ == "__main__":
            here = work(7)
            with multiprocessing.get_context("fork").Pool(1) as pool:
                there = pool.map_async(work, [7]).get(timeout=240)
            sys.exit(0 if there == [here] else 3)
        """
    )
    environment = {k: v for k, v in os.environ.items() if k != "OMP_NUM_THREADS"}
    environment["OMP_NUM_THREADS"] = "2"
    ran = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=300
    )
    assert ran.returncode == 0, ran.stderr


@pytest.mark.skipif(not hasattr(os, "fork"), reason="nothing forks here")
def test_a_fork_in_the_middle_of_a_call_asks_without_its_threads(four_cores):
    points = np.random.default_rng(0).normal(size=(500, 3))
    plain = Tree(points)
    with threads.using(3):
        expected, _ = plain.query(points, k=2)
        child = os.fork()
        if child == 0:
            found, _ = plain.query(points, k=2)
            os._exit(0 if np.array_equal(found, expected) else 1)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


BUSY = """
import os, sys
import numpy as np
import hmrf_icp
sys.path.insert(0, sys.argv[1])
import synthetic

def others():
    own, ticks = str(os.getpid()), 0
    for thread in os.listdir("/proc/self/task"):
        if thread != own:
            fields = open(f"/proc/self/task/{thread}/stat").read().rsplit(")", 1)[1].split()
            ticks += int(fields[11]) + int(fields[12])
    return ticks

source, target = synthetic.pair(height=130, width=180)
for preset in ("robust", "paper"):
    hmrf_icp.register(source, target, preset=preset, num_threads=1)
before = others()
for preset in ("robust", "paper"):
    for _ in range(3):
        hmrf_icp.register(source, target, preset=preset, num_threads=1)
print(others() - before)
"""
"""Ticks that threads other than the one that calls have run for; linear algebra brings some."""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="threads are looked at in /proc")
def test_one_thread_keeps_no_other_busy():
    # What the libraries would do if nobody told them otherwise.
    free = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}
    here = str(Path(__file__).parent)
    run = [sys.executable, "-W", "ignore", "-c", textwrap.dedent(BUSY), here]
    done = subprocess.run(run, env=free, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) <= 1


def test_two_clouds_are_fitted_at_the_same_time(monkeypatch):
    from hmrf_icp.clouds import prepared

    both = threading.Barrier(2, timeout=20)
    fit = prepared.surface

    def fitted(*given):
        both.wait()  # who comes alone waits in vain
        return fit(*given)

    monkeypatch.setattr(prepared, "surface", fitted)
    clouds = [hmrf_icp.prepare(np.random.default_rng(k).normal(size=(200, 3))) for k in (0, 1)]
    with ThreadPoolExecutor(2) as pool:
        surfaces = list(pool.map(lambda cloud: cloud.surface, clouds))
    assert [len(one.points) for one in surfaces] == [200, 200]
