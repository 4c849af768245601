"""Some hundred damaged files of every format: an answer or an InputError, and nothing else.

`benchmarks/fuzz/readers.py` reads as many as one likes; here is a small share of them.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

FUZZ = Path(__file__).resolve().parents[2] / "benchmarks" / "fuzz"

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="the memory of a process is bounded on Linux alone"
)


@pytest.fixture
def fuzz(monkeypatch):
    if not FUZZ.is_dir():
        pytest.skip(f"needs {FUZZ}, which this distribution has not got")
    monkeypatch.syspath_prepend(str(FUZZ))
    return FUZZ


def test_what_is_damaged_is_whole_to_begin_with(fuzz, tmp_path):
    import inputs
    import seeds

    from hmrf_icp.datasets import open_sequence

    whole = inputs.Inputs(0, tmp_path)
    for kind, (suffix, content) in whole.files.items():
        path = tmp_path / f"{kind}{suffix if suffix[0] == '.' else '.txt'}"
        path.write_bytes(content)
        inputs.READERS.get(suffix, inputs._read_cloud)(path)
    for layout in seeds.recordings():
        assert all(frame.load().shape for frame in open_sequence(tmp_path / layout).frames)


def test_some_hundred_damaged_files(fuzz, tmp_path):
    command = [sys.executable, str(fuzz / "readers.py"), "--state", str(tmp_path / "state.json")]
    for count in ("200", "500"):  # in two goes, the second from where the first ended
        run = subprocess.run([*command, "--count", count], capture_output=True, text=True)
        assert run.returncode == 0, run.stdout + run.stderr
    assert "| all | 500 |" in run.stdout
