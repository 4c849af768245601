"""Attributes that are worked out when they are first asked for, without a lock.

Up to Python 3.11, ``functools.cached_property`` holds one lock for all instances of a class
while it works one out: the surfaces of two clouds, each asked for by a thread of its own, are
then fitted one after the other. Later versions have no lock, and neither has this one: where two
threads ask for the same attribute of the same object, it is worked out twice, to the same digits.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from functools import cached_property
else:

    class cached_property:  # noqa: N801 - the name that everybody knows
        """As ``functools.cached_property`` of Python 3.12."""

        def __init__(self, function: Any) -> None:
            self.func = function
            self.__doc__ = function.__doc__

        def __set_name__(self, owner: type, name: str) -> None:
            self._name = name

        def __get__(self, instance: Any, owner: type | None = None) -> Any:
            if instance is None:
                return self
            value = instance.__dict__[self._name] = self.func(instance)
            return value


__all__ = ["cached_property"]
