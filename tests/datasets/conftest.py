"""A recording on a server of this machine, and an empty cache to fetch it into."""

from __future__ import annotations

import io
import tarfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from dataset_writers import recording, write_tum
from loopback import FOLDER, PATH, Host, serving

from hmrf_icp.datasets import tum_download


@pytest.fixture(scope="session")
def tgz(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    folder = write_tum(tmp_path_factory.mktemp("made") / FOLDER, recording(), intrinsics=True)
    (folder / "rgb").mkdir()
    noise = np.random.default_rng(0).bytes(200_000)  # bytes that gzip cannot make small
    (folder / "rgb" / "1.png").write_bytes(noise)
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w:gz") as tar:
        tar.add(folder, FOLDER)
    return packed.getvalue()


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    monkeypatch.setenv(tum_download.CACHE_VARIABLE, str(tmp_path / "cache"))
    return tmp_path / "cache" / "tum"


@pytest.fixture
def host(tgz: bytes, cache: Path) -> Iterator[Host]:
    with serving(Host({PATH: tgz})) as running:
        yield running


@pytest.fixture
def named(host: Host, monkeypatch: pytest.MonkeyPatch) -> str:
    """Name of the recording; ``tum:`` looks for it at the host."""
    monkeypatch.setattr(tum_download.open_tum_name, "__defaults__", (None, host.url))
    return "tum:freiburg1_desk2"
