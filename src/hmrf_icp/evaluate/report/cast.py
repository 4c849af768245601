"""Which methods stand in a table, under which headings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hmrf_icp.evaluate.report.methods import ReportedMethod, best, family_label
from hmrf_icp.evaluate.report.study import Study


@dataclass(frozen=True)
class Band:
    """Methods under one heading."""

    heading: str
    methods: tuple[ReportedMethod, ...]


def main_cast(study: Study) -> list[Band]:
    """Every method of this package, and each peer at the setting that solves most over all."""
    roster = study.roster
    families = roster.families.values()
    chosen = tuple(best(study.runs, settings, study.success) for settings in families)
    several = any(len(settings) > 1 for settings in families)
    bands = [
        Band("Methods of the paper", roster.of_kind("paper")),
        Band("Presets of this package", roster.of_kind("preset")),
        Band("Peers, each at its best setting over all starts" if several else "Peers", chosen),
    ]
    return [band for band in bands if band.methods]


def settings_cast(study: Study) -> list[Band]:
    """Every setting of the peers that were run at several; empty where none was."""
    return [
        Band(family_label(family), settings)
        for family, settings in study.roster.families.items()
        if len(settings) > 1
    ]


def everybody(bands: Sequence[Band]) -> list[ReportedMethod]:
    """Return the methods of all bands."""
    return [method for band in bands for method in band.methods]
