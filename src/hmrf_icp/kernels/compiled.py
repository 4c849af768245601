"""Numba's decorator, for machines where there is no place to keep what it compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np

Array = TypeVar("Array", bound=np.ndarray[Any, Any])
Function = TypeVar("Function", bound=Callable[..., Any])

ANY_ORDER = {"reassoc", "contract", "arcp", "nsz"}
"""Sums may be added in any order; NaN and infinity keep their meaning."""


def njit(**options: Any) -> Callable[[Function], Function]:
    """Compile at the first call, and keep the result on disk where that can be done.

    With ``cache=True`` Numba refuses to compile at all where neither the package's
    folder nor the user's is writable (a read-only container without a home). Here
    such a place costs the compilation in every process, and nothing else.
    """
    # Nothing calls a kernel from C: a wrapper less to compile for each. And none touches what
    # belongs to the interpreter: several threads may be in kernels at a time.
    options |= {"no_cfunc_wrapper": True, "nogil": True}

    def decorate(function: Function) -> Function:
        try:
            return cast(Function, numba.njit(cache=True, **options)(function))
        except RuntimeError:
            return cast(Function, numba.njit(**options)(function))

    return decorate


def read_only(array: Array) -> Array:
    """Return a view that cannot be written through.

    Numba compiles a kernel once more for arrays of the other kind: what may come as
    either is handed over as this one.
    """
    view = array.view()
    view.flags.writeable = False
    return view
