"""What several tests share."""

from __future__ import annotations

import contextlib
import os
import signal
from pathlib import Path

import pytest
from hypothesis import settings

# How long one example takes says how busy the machine is, and nothing of registration.
settings.register_profile("unhurried", deadline=None)
settings.load_profile("unhurried")

# The clouds here are small: threads of the neighbour search would mostly wait for each other, and
# on a busy machine for long. Read when the library is loaded, which no import above does.
os.environ.setdefault("OMP_NUM_THREADS", "1")

# A shell that runs a command in the background has it ignore Ctrl-C, and all that it starts too.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    with contextlib.suppress(ValueError):  # not the main thread
        signal.signal(signal.SIGINT, signal.default_int_handler)

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of real and rendered depth maps beside the checkout; skips without it."""
    if not (SHARED / "data").is_dir():
        pytest.skip(f"needs the depth maps of {SHARED}, which is not there")
    return SHARED
