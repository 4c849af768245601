from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import evaluation_fakes
import pytest
from evaluation_fakes import SLOW, asked, rows

from hmrf_icp.errors import InputError
from hmrf_icp.evaluate import NamedMethod, evaluate

distributed = pytest.importorskip("distributed")
pytest.importorskip("joblib")


@contextlib.contextmanager
def dask(command: str, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run a Dask program as an operator would, on loopback."""
    paths = [str(Path(evaluation_fakes.__file__).parent), os.environ.get("PYTHONPATH", "")]
    process = subprocess.Popen(
        [sys.executable, "-m", "distributed.cli." + command, *arguments],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@contextlib.contextmanager
def cluster(folder: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A scheduler and two worker processes of one thread each."""
    where = folder / "scheduler.json"
    listen = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    with dask("dask_scheduler", *listen, "--scheduler-file", str(where)):
        until = time.monotonic() + 60
        while not where.exists():
            assert time.monotonic() < until, "the scheduler did not start"
            time.sleep(0.05)
        import json

        address = json.loads(where.read_text())["address"]
        options = (
            address,
            "--nthreads",
            "1",
            "--no-nanny",
            "--no-dashboard",
            "--host",
            "127.0.0.1",
        )
        options += ("--local-directory", str(folder))
        with dask("dask_worker", *options) as one, dask("dask_worker", *options) as other:
            yield address, [one, other]


def test_a_cluster_that_loses_a_worker_finds_what_this_machine_finds(
    recording: Path, tmp_path: Path
):
    configuration = asked(recording, methods=("hmrf",), axes=8)
    local, remote = tmp_path / "local", tmp_path / "remote"
    quick = NamedMethod("slow", evaluation_fakes.quick)
    evaluate(configuration, local, workers=2, extra_methods=(quick,))

    with cluster(tmp_path) as (address, workers):
        killed = threading.Event()

        def kill_one_in_the_middle(stage: str, done: int, total: int) -> None:
            if stage == "Registering" and done > total // 4 and not killed.is_set():
                workers[0].kill()
                killed.set()

        evaluate(
            configuration,
            remote,
            scheduler=address,
            extra_methods=(SLOW,),
            on_progress=kill_one_in_the_middle,
        )
        assert killed.is_set()
        assert workers[0].wait() != 0
        assert workers[1].poll() is None

    assert rows(remote) == rows(local)


def test_a_scheduler_that_does_not_answer_is_named(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    from hmrf_icp.evaluate import workers

    monkeypatch.setattr(workers, "CONNECTION_SECONDS", 1.0)
    with pytest.raises(InputError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"):
        evaluate(asked(recording), tmp_path, scheduler="tcp://127.0.0.1:9")
