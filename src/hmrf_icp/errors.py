"""What can go wrong, in types that a caller can tell apart."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


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
