"""What several tests share."""

from __future__ import annotations

from pathlib import Path

import pytest

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of real and rendered depth maps beside the checkout; skips without it."""
    if not (SHARED / "data").is_dir():
        pytest.skip(f"needs the depth maps of {SHARED}, which is not there")
    return SHARED
