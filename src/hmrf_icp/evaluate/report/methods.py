"""What a method's name in ``results.csv`` stands for: one of the paper's, a preset, a peer."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from hmrf_icp.evaluate.methods import COLOUR
from hmrf_icp.evaluate.peers import START_FREE
from hmrf_icp.evaluate.report.published import PAPER_ORDER
from hmrf_icp.evaluate.report.runs import Runs, Success

Kind = Literal["paper", "preset", "peer"]

THRESHOLD = re.compile(r"^(?P<family>.+)@(?P<threshold>\d+(?:\.\d+)?)(?P<percent>%?)$")
"""A peer at a distance threshold: ``gicp@0.05``, or a share of the clouds' size: ``gicp@8%``."""

LABELS = {
    "all": "All",
    "percent": "Percent",
    "sigma": "Sigma",
    "x84": "X84",
    "dynamic": "Dynamic",
    "hmrf": "HMRF",
    "o3d-point": "Open3D point-to-point",
    "o3d-plane": "Open3D point-to-plane",
    "o3d-tukey": "Open3D point-to-plane, Tukey",
    "o3d-multiscale": "Open3D multi-scale",
    "gicp": "GICP",
    "gicp-chain": "GICP, thresholds in turn",
    "fricp": "Fast and Robust ICP",
    "fricp-plane": "Fast and Robust ICP, point-to-plane",
    "kiss-gicp": "KISS-Matcher, then GICP",
    "fpfh": "FPFH and RANSAC",
    "fpfh-gicp": "FPFH and RANSAC, then GICP",
    "fgr": "Fast Global Registration",
    "fgr-gicp": "Fast Global Registration, then GICP",
    "ndt": "Open3D NDT",
    "cpd": "Coherent Point Drift",
    "o3d-colour": "Open3D coloured",
    "colour": "Default with colour",
}
"""The paper's legend, and the peers in words; other names are shown as they are."""


@dataclass(frozen=True)
class ReportedMethod:
    """A method of the evaluation.

    Attributes
    ----------
    name
        As in ``results.csv``.
    kind
        One of the paper's six, another preset of this package, or a peer.
    family
        A peer's name without its threshold; the name itself otherwise.
    threshold
        A peer's distance threshold, metres; None where it takes none.
    percent
        Whether that is in percent of the clouds' size instead.
    """

    name: str
    kind: Kind
    family: str
    threshold: float | None = None
    percent: bool = False

    @property
    def label(self) -> str:
        """For people."""
        label = family_label(self.family)
        if self.threshold is None:
            return label
        unit = "% of size" if self.percent else "m"
        return f"{label}, {self.threshold:g}\N{NO-BREAK SPACE}{unit}"

    @property
    def needs_start(self) -> bool:
        """Whether the start makes a difference to it."""
        return self.family not in START_FREE


@dataclass(frozen=True)
class Roster:
    """The methods of an evaluation, in three kinds."""

    methods: tuple[ReportedMethod, ...]

    @classmethod
    def of(cls, runs: Runs, config: Mapping[str, Any]) -> Roster:
        """Tell the methods of some runs apart, with the lists in ``config.json`` where it has them.

        A name that neither list has is one of the paper's, a preset of the
        installed package, or else a peer.
        """
        from hmrf_icp import presets

        own = {*PAPER_ORDER, *presets.names(), COLOUR, *_names(config.get("methods"))}
        found = (describe(name, own) for name in runs.methods)
        rank = {name: place for place, name in enumerate(PAPER_ORDER)}
        kinds: tuple[Kind, ...] = ("paper", "preset", "peer")
        ordered = sorted(
            found,
            key=lambda m: (kinds.index(m.kind), rank.get(m.name, 0), m.family, m.threshold or 0.0),
        )
        return cls(tuple(ordered))

    def of_kind(self, *kinds: Kind) -> tuple[ReportedMethod, ...]:
        """Return the methods of some kinds."""
        return tuple(method for method in self.methods if method.kind in kinds)

    @property
    def own(self) -> tuple[ReportedMethod, ...]:
        """The paper's methods and the presets."""
        return self.of_kind("paper", "preset")

    @property
    def peers(self) -> tuple[ReportedMethod, ...]:
        """What other people have written."""
        return self.of_kind("peer")

    @property
    def families(self) -> Mapping[str, tuple[ReportedMethod, ...]]:
        """Peers by family, each in the order of its thresholds."""
        families: dict[str, tuple[ReportedMethod, ...]] = {}
        for peer in self.peers:
            families[peer.family] = (*families.get(peer.family, ()), peer)
        return families

    def headline(self, runs: Runs, success: Success) -> ReportedMethod:
        """Return the method that the report is about.

        The preset that solves most; without one the paper's field, HMRF; without
        that whatever solves most.
        """
        presets = self.of_kind("preset")
        field = tuple(method for method in self.of_kind("paper") if method.name == "hmrf")
        return best(runs, presets or field or self.own or self.methods, success)


def family_label(family: str) -> str:
    """Write a family of methods in words."""
    return LABELS.get(family, family)


def describe(name: str, own: Iterable[str]) -> ReportedMethod:
    """Tell what a name stands for, given the names of this package's own methods."""
    if name in PAPER_ORDER:
        return ReportedMethod(name, "paper", name)
    if name in own:
        return ReportedMethod(name, "preset", name)
    match = THRESHOLD.match(name)
    if match is None:
        return ReportedMethod(name, "peer", name)
    percent = bool(match["percent"])
    return ReportedMethod(name, "peer", match["family"], float(match["threshold"]), percent)


def best(runs: Runs, methods: Sequence[ReportedMethod], success: Success) -> ReportedMethod:
    """Return the method of the highest recall over some runs, the first of equals."""
    solved = runs.solved(success)

    def recall(method: ReportedMethod) -> float:
        mask = runs.of(method.name)
        return float(solved[mask].mean()) if mask.any() else -1.0

    return max(methods, key=recall)


def _names(value: Any) -> tuple[str, ...]:
    if isinstance(value, Sequence) and not isinstance(value, str):
        return tuple(item for item in value if isinstance(item, str))
    return ()
