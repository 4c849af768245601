"""How long compiling takes: a registration's time is not to count it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

from numba.core import event

LOCK, COMPILE = "numba:compiler_lock", "numba:compile"
"""Numba's events: the lock that it holds while it compiles or reads what it kept on
disk; and compiling alone."""


class Compilation(event.Listener):
    """Measures what this thread spends on compiling kernels, or on loading them, in a block.

    Parameters
    ----------
    on_compile
        Called once, when the first kernel is compiled that is not on disk.

    Attributes
    ----------
    seconds
        That time so far.
    """

    def __init__(self, on_compile: Callable[[], None] | None = None) -> None:
        self.seconds = 0.0
        self._on_compile = on_compile
        self._thread = threading.get_ident()
        self._depth = 0
        self._since = 0.0
        self._installed = ExitStack()

    def __enter__(self) -> Compilation:
        kinds = (LOCK,) if self._on_compile is None else (LOCK, COMPILE)
        for kind in kinds:
            self._installed.enter_context(event.install_listener(kind, self))
        return self

    def __exit__(self, *_: object) -> None:
        self._installed.close()

    def on_start(self, event: Any) -> None:
        """Numba begins: one kernel compiles those that it calls, so only the outermost counts."""
        if threading.get_ident() != self._thread:
            return
        if event.kind == COMPILE:
            if self._on_compile is not None:
                self._on_compile()
                self._on_compile = None
            return
        if self._depth == 0:
            self._since = time.perf_counter()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        """Numba ends."""
        if threading.get_ident() != self._thread or event.kind == COMPILE:
            return
        self._depth -= 1
        if self._depth == 0:
            self.seconds += time.perf_counter() - self._since
