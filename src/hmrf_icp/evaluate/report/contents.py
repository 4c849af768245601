"""What stands in a report, in the order in which a person would ask for it."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from hmrf_icp.evaluate.plain import plain
from hmrf_icp.evaluate.progress import Progress, silent
from hmrf_icp.evaluate.report.benchmark import benchmark_tables
from hmrf_icp.evaluate.report.cast import Band, main_cast, settings_cast
from hmrf_icp.evaluate.report.comparison import (
    comparable_starts,
    maxima_table,
    medians_table,
)
from hmrf_icp.evaluate.report.confidence import confidence_table
from hmrf_icp.evaluate.report.confidence_figures import reliability_figure, roc_figure
from hmrf_icp.evaluate.report.cost_tables import (
    accuracy_table,
    effort_table,
    failure_table,
    pairs_table,
)
from hmrf_icp.evaluate.report.median_figures import medians_figure
from hmrf_icp.evaluate.report.page import Section, ShownRun
from hmrf_icp.evaluate.report.paper_panels import paper_panels
from hmrf_icp.evaluate.report.published import PAPER_ANGLE, PaperRows
from hmrf_icp.evaluate.report.recall_figures import (
    recall_by_overlap,
    recall_by_start,
    time_against_recall,
)
from hmrf_icp.evaluate.report.recall_tables import recall_by_decile_table, recall_table
from hmrf_icp.evaluate.report.runs import ReportedStart
from hmrf_icp.evaluate.report.study import Study
from hmrf_icp.evaluate.report.style import Drawing
from hmrf_icp.evaluate.report.tables import Table

MOST_VALUES = 40
"""Longer lists of the configuration are cut in the page; config.json has them whole."""

FACTS = (
    "dataset",
    "benchmark",
    "pairs",
    "targets",
    "frames_per_decile",
    "minimum_overlap",
    "subsample",
    "points_alone",
    "starts",
    "axes",
    "seed",
    "methods",
    "peers",
)
"""What the configuration is said in the order of; what else there is comes after."""

DEEPEST = 4
"""What is nested more than this is left to config.json as well."""


def sections(
    study: Study,
    papers: Sequence[PaperRows],
    worst: Sequence[ShownRun],
    no_picture: str,
    report: Progress = silent,
) -> list[Section]:
    """Compute every figure and table of the report.

    Parameters
    ----------
    study
        The evaluation.
    papers
        Released rows of the paper to hold it against.
    worst
        The worst runs.
    no_picture
        Why they have no pictures; empty where they have.
    report
        Told how many sections are done.
    """
    cast = main_cast(study)
    makers: tuple[Callable[[], Section | None], ...] = (
        lambda: _benchmark(study, cast),
        lambda: _recall(study, cast),
        lambda: _accuracy(study, cast),
        lambda: _confidence(study, cast),
        lambda: _paper(study, papers),
        lambda: _worst(study, worst, no_picture),
        lambda: _settings(study),
        lambda: _run(study),
    )
    made = []
    for done, make in enumerate(makers):
        report("Computing figures and tables", done, len(makers))
        made.append(make())
    return [section for section in made if section is not None]


def _benchmark(study: Study, cast: Sequence[Band]) -> Section | None:
    tables = benchmark_tables(study, cast)
    if not tables:
        return None
    return Section(
        "benchmark-section",
        "By the benchmark's own rules",
        paragraphs=[f"A pair is right when {study.criterion}; recall is the mean over scenes."],
        items=tables,
    )


def _recall(study: Study, cast: Sequence[Band]) -> Section:
    items: list[Drawing | Table] = [recall_table(study, cast), recall_by_overlap(study)]
    items += [recall_by_decile_table(study, cast, start) for start in study.starts]
    items.append(recall_by_start(study))
    return Section("recall-section", "Who finds the pose", items=items)


def _accuracy(study: Study, cast: Sequence[Band]) -> Section:
    return Section(
        "accuracy-section",
        "How exactly, and at what cost",
        items=_some(
            time_against_recall(study),
            accuracy_table(study, cast),
            effort_table(study, cast),
            failure_table(study),
        ),
    )


def _confidence(study: Study, cast: Sequence[Band]) -> Section | None:
    items = _some(confidence_table(study, cast), roc_figure(study), reliability_figure(study))
    return Section("confidence-section", "Who knows when it failed", items=items) if items else None


def _worst(study: Study, worst: Sequence[ShownRun], no_picture: str) -> Section | None:
    title = f"The worst runs of {study.headline.label}"
    mine = study.runs.of(study.headline.name)
    if mine.any() and study.solved[mine].all():
        return Section("worst-section", title, paragraphs=["None failed."])
    if not worst:
        return None
    return Section(
        "worst-section",
        title,
        paragraphs=_some(
            "Failures where the overlap gives no excuse, and those with the largest errors; of one "
            "pair only the first. Blue is the source, orange the target.",
            no_picture,
        ),
        worst=worst,
    )


def _settings(study: Study) -> Section | None:
    cast = settings_cast(study)
    if not cast:
        return None
    return Section(
        "settings-section",
        "Every setting of every peer",
        items=_some(
            recall_table(study, cast, "settings-recall"),
            *(
                recall_by_decile_table(study, cast, start, "settings-recall-by-overlap")
                for start in study.starts
            ),
            accuracy_table(study, cast, "settings-accuracy"),
            effort_table(study, cast, "settings-effort"),
            confidence_table(study, cast, "settings-confidence"),
        ),
    )


def _paper(study: Study, papers: Sequence[PaperRows]) -> Section | None:
    if study.scenes and not papers and not study.roster.of_kind("paper"):
        return None
    items: list[Drawing | Table] = [paper_panels(study, start) for start in study.starts]
    items += _some(maxima_table(study))
    paragraphs = [
        "The same four panels as in Stechschulte and Heckman, Hidden Markov Random Field Iterative "
        "Closest Point (2017), drawn from this evaluation, and the numbers of its text beside ours."
    ]
    if not papers:
        paragraphs.append(
            "The authors' released rows can be held against these with --paper-csv FILE."
        )
    for paper in papers:
        compared: list[tuple[ReportedStart | None, float]] = [*comparable_starts(study, paper)]
        compared = compared or [(None, PAPER_ANGLE)]
        for start, angle in compared:
            items.append(medians_figure(study, paper, start, angle))
            items += [
                medians_table(study, paper, start, angle, column)
                for column in ("error_m", "error_rad")
            ]
    return Section("paper-section", "The paper's numbers beside ours", paragraphs, items=items)


def _run(study: Study) -> Section:
    config = dict(study.config)
    config.pop("starts", None)  # As labels, they are read more easily.
    command = config.pop("command", "")
    if isinstance(command, list | tuple):
        command = shlex.join(_words(word) for word in command)
    remarks: list[str] = []
    for key in ("notes", "skipped", "left_out", "warnings"):
        found = config.pop(key, ())
        listed = found if isinstance(found, list | tuple) else [] if found is None else [found]
        remarks += [_words(item) for item in listed]
    paragraphs = [] if study.config else ["There is no config.json beside results.csv."]
    return Section(
        "run-section",
        "What was run",
        paragraphs=paragraphs,
        command=_words(command),
        remarks=remarks,
        items=[pairs_table(study)],
        facts=[
            *_facts(config, ", ".join(start.label for start in study.starts)),
        ],
    )


def _facts(config: Mapping[str, Any], starts: str) -> list[tuple[str, str]]:
    """Say the configuration: what was registered, from where, by what, on what."""
    all_of_it = {**config, "starts": starts}
    if "pairs" in config and config["pairs"] is None:
        all_of_it["pairs"] = "all"
    order = {name: place for place, name in enumerate(FACTS)}
    names = sorted(all_of_it, key=lambda name: order.get(name, len(order)))
    return [(plain(name.replace("_", " ")), _words(all_of_it[name])) for name in names]


def _words(value: Any, depth: int = 0) -> str:
    """Write a value of the configuration out, on one line; what is inside another is named."""
    if depth > DEEPEST and isinstance(value, Mapping | list | tuple):
        return "..."
    if isinstance(value, Mapping):
        inside = (f"{plain(name)} {_words(inner, depth + 1)}" for name, inner in value.items())
        return ", ".join(inside) or "none"
    if isinstance(value, list | tuple):
        more = len(value) - MOST_VALUES
        shown = ", ".join(_words(item, depth + 1) for item in value[:MOST_VALUES])
        return (f"{shown} and {more} more" if more > 0 else shown) or "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "not known" if value is None else plain(str(value)) or "none"


def _some(*items: Any) -> list[Any]:
    return [item for item in items if item]
