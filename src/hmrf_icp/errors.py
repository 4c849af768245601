"""What can go wrong, in types that a caller can tell apart."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


class HmrfIcpError(Exception):
    """Base of every error this package raises on purpose."""


class InputError(HmrfIcpError, ValueError):
    """An argument or a file is not what registration needs.

    The message names the argument or the file, what was found, what was
    expected and, where there is one, what to do about it.
    """


class MissingDependencyError(HmrfIcpError, ImportError):
    """An optional library is needed for what was asked and is not installed."""


class RegistrationWarning(UserWarning):
    """The registration ran, on input that looks like a mistake (units mixed up, say)."""


@contextmanager
def interruptible() -> Iterator[None]:
    """Let Ctrl-C come out as KeyboardInterrupt, also where a compiled loop met it.

    Numba looks for signals when a loop returns, and wraps what it finds, once or more often.
    """
    try:
        yield
    except SystemError as error:
        cause: BaseException | None = error
        while isinstance(cause, SystemError):
            cause = cause.__cause__
        if isinstance(cause, KeyboardInterrupt):
            raise KeyboardInterrupt from None
        raise


@contextmanager
def no_interrupt_lost() -> Iterator[None]:
    """Raise KeyboardInterrupt at the end where one was raised on the way and never arrived.

    Ctrl-C that falls into a callback of the compiler, while it loads a kernel, is printed by
    Python and forgotten. Whoever handles the signal still does: a handler that raises nothing is
    taken to have dealt with it. Outside of the main thread there is nothing to do.
    """
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return
    arrived = False

    def heard(number: int, frame: Any) -> None:
        nonlocal arrived
        try:
            before(number, frame)
        except KeyboardInterrupt:
            arrived = True
            raise

    signal.signal(signal.SIGINT, heard)
    try:
        yield
    except Exception as error:
        if arrived:
            raise KeyboardInterrupt from error
        raise
    finally:
        # Unless somebody who was called on the way has set another.
        if signal.getsignal(signal.SIGINT) is heard:
            signal.signal(signal.SIGINT, before)
    if arrived:
        raise KeyboardInterrupt
