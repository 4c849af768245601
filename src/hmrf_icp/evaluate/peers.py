"""Today's alternatives, each as a :class:`NamedMethod`, at its thresholds.

A library that is not installed is left out with a sentence saying so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib.metadata import version
from importlib.util import find_spec
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.errors import InputError
from hmrf_icp.evaluate import more_peer_calls, peer_calls
from hmrf_icp.evaluate.methods import Estimate, NamedMethod
from hmrf_icp.evaluate.prepared import Prepared

Array = NDArray[np.float64]
Register: TypeAlias = Callable[[Prepared, Prepared, "Array | None"], Estimate]

THRESHOLDS = (0.05, 0.1, 0.2, 0.4, 0.8)
"""Distances in metres that a peer which wants one is run at, each as a method of its own."""

VOXELS_MATCHED = (0.1, 0.2)
"""Those of them for FPFH with RANSAC, which takes seconds on the voxels of a smaller one."""

SHARE = 8
"""In percent of the clouds' size, where these are not in metres.

For methods that thin clouds these are voxels of 4 %: of a fragment of a room 0.05 m, which is what
benchmarks of fragments are usually run with.
"""


@dataclass(frozen=True)
class Family:
    """A peer before its threshold is chosen.

    Parameters
    ----------
    name, libraries
        Its name in results, and the modules that it needs.
    build
        Makes the method for a threshold in metres (0 where it wants none).
    thresholds
        Empty where it wants none.
    usual
        Whether it is among all: what needs colours is run where it is asked for by name.
    since
        A library and the first version, major and minor, that has it.
    """

    name: str
    libraries: tuple[str, ...]
    build: Callable[[float], Register]
    thresholds: tuple[float, ...] = THRESHOLDS
    usual: bool = True
    since: tuple[str, int, int] | None = None

    def shares(self) -> tuple[NamedMethod, ...]:
        """Return the method at a share of the clouds' size, in place of metres."""
        if not self.thresholds:
            return self.methods()

        def register(source: Prepared, target: Prepared, init: Array | None) -> Estimate:
            reach = SHARE / 100 * 0.5 * (peer_calls.size(source) + peer_calls.size(target))
            return self.build(reach)(source, target, init)

        return (NamedMethod(f"{self.name}@{SHARE}%", register),)

    @property
    def missing(self) -> tuple[str, ...]:
        """What it needs and is not installed."""
        lacking = tuple(library for library in self.libraries if find_spec(library) is None)
        if lacking or self.since is None:
            return lacking
        library, *least = self.since
        major, minor = (int(word) for word in version(library).split(".")[:2])
        newer = f"{library} {least[0]}.{least[1]} or newer"
        return () if [major, minor] >= least else (newer,)

    def methods(self) -> tuple[NamedMethod, ...]:
        """Return one method a threshold."""
        if not self.thresholds:
            return (NamedMethod(self.name, self.build(0.0)),)
        return tuple(
            NamedMethod(f"{self.name}@{metres:g}", self.build(metres)) for metres in self.thresholds
        )


FAMILIES = (
    Family("o3d-point", ("open3d",), lambda reach: _bind(peer_calls.open3d, reach, "point")),
    Family("o3d-plane", ("open3d",), lambda reach: _bind(peer_calls.open3d, reach, "plane")),
    Family("o3d-tukey", ("open3d",), lambda reach: _bind(peer_calls.open3d, reach, "tukey")),
    Family("o3d-multiscale", ("open3d",), lambda reach: _bind(peer_calls.open3d_multiscale, reach)),
    Family("gicp", ("small_gicp",), lambda reach: _bind(peer_calls.gicp, (reach,))),
    Family("gicp-chain", ("small_gicp",), lambda _: _bind(peer_calls.gicp, THRESHOLDS[::-1]), ()),
    Family("fricp", ("fricp_cpp",), lambda _: _bind(peer_calls.fricp, "point_to_point"), ()),
    Family(
        "fricp-plane",
        ("fricp_cpp", "open3d"),
        lambda _: _bind(peer_calls.fricp, "point_to_plane"),
        (),
    ),
    Family("kiss-gicp", ("kiss_matcher", "small_gicp"), lambda reach: _kiss(reach)),
    Family("fpfh", ("open3d",), lambda reach: _fpfh_of(reach, False), VOXELS_MATCHED),
    Family(
        "fpfh-gicp",
        ("open3d", "small_gicp"),
        lambda reach: _fpfh_of(reach, True),
        VOXELS_MATCHED,
    ),
    Family("fgr", ("open3d",), lambda reach: _fgr_of(reach, False), VOXELS_MATCHED),
    Family(
        "fgr-gicp", ("open3d", "small_gicp"), lambda reach: _fgr_of(reach, True), VOXELS_MATCHED
    ),
    Family(
        "ndt",
        ("open3d",),
        lambda reach: _bind(more_peer_calls.ndt, reach),
        since=("open3d", 0, 20),
    ),
    Family("cpd", ("pycpd",), lambda _: _bind(more_peer_calls.cpd), ()),
    Family(
        "o3d-colour",
        ("open3d",),
        lambda reach: _bind(more_peer_calls.coloured, reach),
        usual=False,
    ),
)

FOR_PAIRS = ("gicp", "kiss-gicp", "fpfh", "fpfh-gicp")
"""Families that are compared on lists of pairs, where nobody chose."""

FOR_PAIRS_METRES = tuple(f"{name}@0.1" for name in FOR_PAIRS)
"""The same on fragments in metres, at the benchmarks' usual voxels of 0.05 m."""


def _bind(function: Callable[..., Estimate], *settings: Any) -> Register:
    def register(source: Prepared, target: Prepared, init: Array | None) -> Estimate:
        # What is local has to begin somewhere: with the frames as they are.
        return function(source, target, np.eye(4) if init is None else init, *settings)

    return register


def _kiss(reach: float) -> Register:
    def register(source: Prepared, target: Prepared, init: Array | None) -> Estimate:  # noqa: ARG001
        return peer_calls.kiss_gicp(source, target, reach)

    return register


def _fpfh_of(reach: float, refined: bool) -> Register:
    def register(source: Prepared, target: Prepared, init: Array | None) -> Estimate:  # noqa: ARG001
        return peer_calls.fpfh(source, target, reach, refined)

    return register


def _fgr_of(reach: float, refined: bool) -> Register:
    def register(source: Prepared, target: Prepared, init: Array | None) -> Estimate:  # noqa: ARG001
        return more_peer_calls.fgr(source, target, reach, refined)

    return register


START_FREE = ("kiss-gicp", "fpfh", "fpfh-gicp", "fgr", "fgr-gicp")
"""Families that do not look at the start."""


def catalogue() -> dict[str, NamedMethod]:
    """Return every peer at every threshold by name, installed or not."""
    return {
        method.name: method
        for family in FAMILIES
        for method in (*family.methods(), *family.shares())
    }


@dataclass(frozen=True)
class Choice:
    """The peers to run, and a sentence for each that is not installed."""

    methods: tuple[NamedMethod, ...]
    skipped: tuple[str, ...]


def choose(names: Iterable[str] | None, metres: bool = True) -> Choice:
    """Find peers by name.

    Parameters
    ----------
    names
        A family (``gicp``: at every threshold) or one setting (``gicp@0.1``, ``gicp@8%``);
        None means all that need
        no colours.
    metres
        Whether the clouds are in metres; a family's thresholds are shares of their size if not.

    Raises
    ------
    InputError
        An unknown name; the message lists the known ones.
    """
    families = {family.name: family for family in FAMILIES}
    every_usual = {name for name, family in families.items() if family.usual}
    wanted = every_usual if names is None else set(names)
    unknown = sorted(wanted - set(families) - set(catalogue()))
    if unknown:
        raise InputError(
            f"peers: no peer is called {', '.join(unknown)}; known are {', '.join(families)}, "
            f"and one threshold of those that want one, as in gicp@{THRESHOLDS[0]:g}"
        )
    chosen: list[NamedMethod] = []
    skipped = []
    for family in FAMILIES:
        usual = family.methods() if metres else family.shares()
        every = {m.name: m for m in (*family.methods(), *family.shares())}
        mine = [
            m
            for m in every.values()
            if m.name in wanted or (family.name in wanted and m.name in {u.name for u in usual})
        ]
        if mine and family.missing:
            skipped.append(
                f"{family.name}: skipped, {' and '.join(family.missing)} not installed "
                "(pip install 'hmrf-icp[peers]')"
            )
        elif mine:
            chosen.extend(mine)
    return Choice(tuple(chosen), tuple(skipped))
