"""What can go wrong, in types that a caller can tell apart."""

from __future__ import annotations


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
