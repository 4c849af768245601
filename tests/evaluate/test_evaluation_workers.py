"""Worker processes of this machine."""

from __future__ import annotations

import os
import time
import warnings
from dataclasses import dataclass

import pytest

from hmrf_icp.evaluate.workers import LocalWorkers, outcomes

pytest.importorskip("joblib")

LOKYS_LIMIT = 300_000_000
LOKYS_PATIENCE = 1.0  # seconds from one look at a worker's memory to the next

kept: list[bytes] = []


@dataclass(frozen=True)
class Keep:
    """Keep so many bytes, as a worker does with clouds and what peers derive from them."""

    size: int
    wait: float = 0.0

    def split(self) -> tuple[Keep, ...]:
        return (self,)


def keep(task: Keep) -> int:
    time.sleep(task.wait)
    kept.append(b"x" * task.size)
    return os.getpid()


def test_a_worker_that_keeps_full_size_clouds_stays_and_nobody_is_warned():
    pytest.importorskip("psutil", reason="without it loky does not look at a worker's memory")
    large = Keep(LOKYS_LIMIT * 11 // 10, wait=1.1 * LOKYS_PATIENCE)
    tasks = [Keep(1), large, Keep(1), Keep(1)]
    with LocalWorkers(1) as workers, warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        done = list(outcomes(workers, keep, tasks))
    assert [task for task, _ in done] == tasks
    assert len({process for _, process in done}) == 1
    assert [str(warning.message) for warning in said] == []
