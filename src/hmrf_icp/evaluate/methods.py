"""What is compared: a name, and a function from two clouds and a start to an outcome."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.errors import InputError
from hmrf_icp.evaluate.prepared import Prepared

PAPER_METHODS = ("hmrf", "all", "percent", "sigma", "x84", "dynamic")
"""The six of the paper's plots: its field, and the five rules that it compares with."""


@dataclass(frozen=True)
class Estimate:
    """What a registration says of itself.

    Parameters
    ----------
    transformation
        (4, 4) source to target.
    iterations, em_iterations
        Of the outer loop, and of EM in all; None where there is no such thing.
    converged
        None where the method does not tell.
    confidence
        In [0, 1], where the method says how sure it is.
    fitness
        In [0, 1]: the share of the source that it believes to have matched.
    """

    transformation: NDArray[np.float64]
    iterations: int | None = None
    em_iterations: int | None = None
    converged: bool | None = None
    confidence: float | None = None
    fitness: float | None = None


@dataclass(frozen=True)
class NamedMethod:
    """A registration method under a name.

    Parameters
    ----------
    name
        As in results; a peer that was given a threshold has it in metres behind
        an ``@``: ``gicp@0.1``.
    register
        ``register(source, target, init)`` with ``init`` (4, 4), source to target; None where the
        evaluation has it begin without a start, and then the frames say nothing.
    """

    name: str
    register: Callable[[Prepared, Prepared, NDArray[np.float64] | None], Estimate]

    @property
    def family(self) -> str:
        """Its name without the threshold."""
        return self.name.partition("@")[0]


COLOUR = "colour"
"""The default with colours as evidence: only where it is asked for, since most data has none."""


def _own(name: str, preset: str, rejector: str | None, aligner: str | None = None) -> NamedMethod:
    def register(source: Prepared, target: Prepared, init: NDArray[np.float64] | None) -> Estimate:
        import hmrf_icp
        from hmrf_icp import presets

        result = hmrf_icp.register(
            source.cloud,
            target.cloud,
            init,
            preset=presets.preset(preset),
            rejector=None if rejector is None else presets.rejector(rejector),
            aligner=None if aligner is None else presets.aligner(aligner),
        )
        return Estimate(
            transformation=result.transformation,
            iterations=result.iterations,
            em_iterations=result.em_iterations,
            converged=result.converged,
            confidence=result.confidence,
            fitness=result.overlap,
        )

    return NamedMethod(name, register)


def preset_of(name: str) -> tuple[str, str | None] | None:
    """Return preset and rejector of a method of the package's own; None of any other."""
    from hmrf_icp import presets

    if name in PAPER_METHODS:
        return "paper", name
    return (name, None) if name in presets.names() else None


def own_methods() -> dict[str, NamedMethod]:
    """Return the package's own by name: the paper's six, other presets, the default with colour."""
    from hmrf_icp import presets

    methods = {name: _own(name, "paper", name) for name in PAPER_METHODS}
    # The paper's preset is the paper's method with its field: "hmrf" already.
    for preset in presets.names():
        if preset != "paper":
            methods[preset] = _own(preset, preset, None)
    methods[COLOUR] = _own(COLOUR, presets.DEFAULT, None, "colour")
    return methods


NEED_A_GRID = ("hmrf",)
"""Methods that are not for (N, 3): the paper's neighbours are pixels."""


def usual(listed: bool, points_alone: bool) -> tuple[str, ...]:
    """Return the methods that are compared where nobody chose.

    Parameters
    ----------
    listed
        Whether the data set lists its pairs, which are no image sequences: then the default alone.
    points_alone
        Whether the clouds are handed over without their grid.
    """
    from hmrf_icp import presets

    if listed:
        return (presets.DEFAULT,)
    unasked = (COLOUR, *(NEED_A_GRID if points_alone else ()))
    return tuple(name for name in own_methods() if name not in unasked)


def choose(names: Iterable[str] | None) -> tuple[NamedMethod, ...]:
    """Find the package's methods of these names, in the order of the catalogue.

    Parameters
    ----------
    names
        None means every one but ``colour``; ``paper`` is another name of ``hmrf``.

    Raises
    ------
    InputError
        An unknown name; the message lists the known ones.
    """
    known = own_methods()
    if names is None:
        return tuple(method for name, method in known.items() if name != COLOUR)
    wanted = {"hmrf" if name == "paper" else name for name in names}
    unknown = sorted(wanted - set(known))
    if unknown:
        raise InputError(
            f"methods: no method is called {', '.join(unknown)}; known are {', '.join(known)}"
        )
    return tuple(method for name, method in known.items() if name in wanted)
