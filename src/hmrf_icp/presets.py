"""Methods, rejectors and metrics by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.errors import InputError
from hmrf_icp.field.general import MarkovField
from hmrf_icp.field.paper import HiddenMarkovRandomField
from hmrf_icp.loop.align import Aligner, PointToPoint
from hmrf_icp.loop.colour import Coloured
from hmrf_icp.loop.criteria import Criteria, RelativeCriteria, StoppingRule
from hmrf_icp.loop.icp import Iteration, LoopResult, Method
from hmrf_icp.loop.match import NearestNeighbour
from hmrf_icp.loop.reject import X84, Dynamic, KeepAll, KeepPercent, KeepSigma, Rejector
from hmrf_icp.loop.surface_metrics import PlaneToPlane, PointToPlane, SurfaceMetric, Symmetric
from hmrf_icp.search.coarse_to_fine import CoarseToFine, SearchResult
from hmrf_icp.search.visible_match import VisibleMatch


@runtime_checkable
class Registrar(Protocol):
    """Anything that registers: Algorithm 1 alone, or something round it."""

    def run(
        self,
        source: PreparedCloud,
        target: PreparedCloud,
        init: NDArray[np.float64],
        near: bool = True,
        on_iteration: Callable[[Iteration], None] | None = None,
    ) -> LoopResult | SearchResult:
        """Register from ``init`` (4, 4)."""

    def with_parts(
        self,
        reject: Rejector | None = None,
        align: Aligner | None = None,
        criteria: StoppingRule | None = None,
    ) -> Registrar:
        """Return the same with some of its parts replaced."""


PresetName: TypeAlias = Literal["robust", "paper"]
RejectorName: TypeAlias = Literal["hmrf", "all", "percent", "sigma", "x84", "dynamic", "field"]
AlignerName: TypeAlias = Literal[
    "point-to-point", "point-to-plane", "symmetric", "plane-to-plane", "colour"
]

DEFAULT: PresetName = "robust"

PAPER = Method(NearestNeighbour(), HiddenMarkovRandomField(), PointToPoint(), Criteria())
"""HMRF-ICP as published (Stechschulte and Heckman 2017, Algorithm 1)."""

FIELD = MarkovField(beta=0.5, share=0.5, first_steps=20, steps=5)
"""The field of the default: half-normal inliers, uniform outliers."""

ROBUST = CoarseToFine(
    Method(
        VisibleMatch(NearestNeighbour(tolerance=0.1)),
        FIELD,
        Symmetric(),
        RelativeCriteria(),
    )
)
"""The default: no threshold, many starts, what the sensors saw as evidence."""

_METHODS: dict[str, Registrar] = {"robust": ROBUST, "paper": PAPER}

_REJECTORS: dict[str, Callable[[], Rejector]] = {
    "hmrf": HiddenMarkovRandomField,
    "all": KeepAll,
    "percent": KeepPercent,
    "sigma": KeepSigma,
    "x84": X84,
    "dynamic": Dynamic,
    "field": lambda: FIELD,
}

_ALIGNERS: dict[str, Callable[[], Aligner]] = {
    "point-to-point": PointToPoint,
    "point-to-plane": PointToPlane,
    "symmetric": Symmetric,
    "plane-to-plane": PlaneToPlane,
    "colour": Coloured,
}


def names() -> tuple[str, ...]:
    """Names that ``preset`` may have."""
    return tuple(_METHODS)


def rejector_names() -> tuple[str, ...]:
    """Names that ``rejector`` may have, the paper's own first."""
    return tuple(_REJECTORS)


def aligner_names() -> tuple[str, ...]:
    """Names that ``aligner`` may have, the paper's own first."""
    return tuple(_ALIGNERS)


def preset(name: str) -> Registrar:
    """Look a method up by name.

    Raises
    ------
    InputError
        There is none of that name.
    """
    if name not in _METHODS:
        raise InputError(f"preset: unknown {name!r}, expected one of {', '.join(names())}")
    return _METHODS[name]


def rejector(name: str) -> Rejector:
    """Look a rejector up by name, with the paper's settings (``"field"``: with the default's).

    Raises
    ------
    InputError
        There is none of that name.
    """
    if name not in _REJECTORS:
        raise InputError(
            f"rejector: unknown {name!r}, expected one of {', '.join(rejector_names())}"
        )
    return _REJECTORS[name]()


def aligner(name: str) -> Aligner:
    """Look a metric up by name, with its own settings.

    Raises
    ------
    InputError
        There is none of that name.
    """
    if name not in _ALIGNERS:
        raise InputError(f"aligner: unknown {name!r}, expected one of {', '.join(aligner_names())}")
    return _ALIGNERS[name]()


def coloured(name: str | None) -> Aligner:
    """Put colour beside a metric of this name; beside the usual one where it is None.

    Raises
    ------
    InputError
        There is none of that name, or it does not look at surfaces.
    """
    beside = Coloured() if name is None else aligner(name)
    if isinstance(beside, Coloured):
        return beside
    if not isinstance(beside, SurfaceMetric):
        raise InputError(
            f"aligner: colour needs a metric that looks at surfaces, got {name!r}; expected "
            "point-to-plane, symmetric or plane-to-plane"
        )
    return Coloured(geometric=beside)


def method(
    chosen: str | Registrar,
    reject: str | Rejector | None = None,
    align: str | Aligner | None = None,
    criteria: StoppingRule | None = None,
) -> Registrar:
    """Put a method together from names, or from parts of one's own.

    Raises
    ------
    InputError
        There is none of that name, or what was chosen is no method.
    """
    one = preset(chosen) if isinstance(chosen, str) else chosen
    if not isinstance(one, Registrar):
        raise InputError(
            f"preset: unknown {chosen!r}, expected a method or one of {', '.join(names())}"
        )
    return one.with_parts(
        reject=rejector(reject) if isinstance(reject, str) else reject,
        align=aligner(align) if isinstance(align, str) else align,
        criteria=criteria,
    )
