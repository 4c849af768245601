"""Benchmarks by their own rules: recall a scene and its mean, beside what others published."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from hmrf_icp.evaluate.report.cast import Band
from hmrf_icp.evaluate.report.confidence import SURE
from hmrf_icp.evaluate.report.cost_tables import three_digits
from hmrf_icp.evaluate.report.hindsight import oracle
from hmrf_icp.evaluate.report.recall_tables import share_cell
from hmrf_icp.evaluate.report.runs import Mask, ReportedStart
from hmrf_icp.evaluate.report.statistics import Share, area_under_roc, median
from hmrf_icp.evaluate.report.study import Study
from hmrf_icp.evaluate.report.tables import NOTHING, Cell, Group, Row, Table

MOST_SCENES = 10
"""More have no columns of their own."""


@dataclass(frozen=True)
class PublishedRecall:
    """What a paper reports for a method, without a start, over all scenes and pairs.

    Attributes
    ----------
    method, source
        Its name, and where the figures stand.
    recall
        By the benchmark's name.
    """

    method: str
    source: str
    recall: dict[str, float]


PUBLISHED = (
    PublishedRecall(
        "FPFH, MAC (no learning)",
        "Zhang et al., CVPR 2023",
        {"3DMatch": 0.841, "3DLoMatch": 0.409},
    ),
    PublishedRecall(
        "Predator (learned)",
        "Huang et al., CVPR 2021",
        {"3DMatch": 0.89, "3DLoMatch": 0.60},
    ),
    PublishedRecall(
        "GeoTransformer (learned)",
        "Qin et al., CVPR 2022",
        {"3DMatch": 0.925, "3DLoMatch": 0.742},
    ),
    PublishedRecall(
        "MAC on GeoTransformer (learned)",
        "Zhang et al., CVPR 2023",
        {"3DMatch": 0.957, "3DLoMatch": 0.789},
    ),
)


def benchmark_tables(study: Study, bands: Sequence[Band]) -> list[Table]:
    """Return one table a benchmark and start; none where the data set lists no pairs."""
    names = dict.fromkeys(scene.rpartition("/")[0] for scene in study.scenes.values())
    return [_table(study, bands, name, start) for name in names for start in study.starts]


def scene_mean(solved: Mask, scenes: np.ndarray) -> float | None:
    """Mean over scenes of the share that was solved; None where nothing was run."""
    names = np.unique(scenes)
    if not names.size:
        return None
    return float(np.mean([solved[scenes == name].mean() for name in names]))


def _table(study: Study, bands: Sequence[Band], name: str, start: ReportedStart) -> Table:
    runs = study.runs
    places = np.array([study.scenes.get(pair, "") for pair in runs["pair"].tolist()])
    here = runs.begun_at(start) & np.array([p.rpartition("/")[0] == name for p in places.tolist()])
    scenes = sorted(set(places[here].tolist()))
    shown = scenes if len(scenes) <= MOST_SCENES else []
    columns = [_heading(study, scene) for scene in shown]
    columns += ["mean over scenes", f"told {SURE:g} or more: right / wrong", "right ones told"]
    columns += ["ROC area of confidence", "time, median (s)", "time, 95 % below (s)"]
    means = {
        method.name: scene_mean(study.solved[mask], places[mask])
        for band in bands
        for method in band.methods
        for mask in [here & runs.of(method.name)]
    }
    top = max((mean for mean in means.values() if mean is not None), default=0.0)
    groups = []
    for band in bands:
        rows = []
        for method in band.methods:
            mask = here & runs.of(method.name)
            cells = [share_cell(Share.of(study.solved[mask & (places == s)]), False) for s in shown]
            cells.append(_mean_cell(means[method.name], strong=means[method.name] == top > 0))
            cells += [*_told(study, mask), *_times(study, mask)]
            rows.append(Row(method.label, cells, strong=method == study.headline))
        groups.append(Group(band.heading, rows))
    groups += _oracle(study, here, shown)
    if not start.given:
        groups += _published(name, len(columns), len(shown))
    return Table(
        name=f"benchmark-{name.lower() or 'pairs'}-{start.slug}",
        caption=f"{name or study.dataset}, {start.begun}: recall by scene, and its mean",
        corner="Method",
        columns=columns,
        groups=groups,
        notes=list(_notes(name, start, bool(shown), len(scenes))),
    )


def _heading(study: Study, place: str) -> str:
    pairs = sum(scene == place for scene in study.scenes.values())
    return f"{place.rpartition('/')[2]}\n{pairs} {'pair' if pairs == 1 else 'pairs'}"


def _mean_cell(mean: float | None, strong: bool = False) -> Cell:
    return NOTHING if mean is None else Cell(f"{mean:.3f}", mean, strong=strong)


def _told(study: Study, mask: Mask) -> list[Cell]:
    """Count who was told, right and wrong, of methods that say how sure they are."""
    mask = mask & np.isfinite(study.runs["confidence"])
    if not mask.any():
        return [NOTHING, NOTHING, NOTHING]
    solved, confidence = study.solved[mask], study.runs["confidence"][mask]
    sure = confidence >= SURE
    area = area_under_roc(confidence, solved)
    counts = f"{np.count_nonzero(sure & solved)} / {np.count_nonzero(sure & ~solved)}"
    told = NOTHING if not solved.any() else Cell(f"{sure[solved].mean():.2f}")
    return [Cell(counts), told, NOTHING if area is None else Cell(f"{area:.3f}")]


def _times(study: Study, mask: Mask) -> list[Cell]:
    seconds = study.runs["seconds"][mask]
    slow = float(np.quantile(seconds, 0.95)) if seconds.size else None
    return [Cell(three_digits(median(seconds))), Cell(three_digits(slow))]


def _oracle(study: Study, here: Mask, shown: Sequence[str]) -> list[Group]:
    """Any of the peers, known only afterwards."""
    if len(study.roster.peers) < 2:
        return []
    found = oracle(study.runs.where(here), study.roster.peers, study.success)
    if not len(found.problems):
        return []
    there = np.array([study.scenes.get(pair, "") for pair in found.problems["pair"].tolist()])
    cells = [share_cell(found.share(there == scene), False) for scene in shown]
    cells += [_mean_cell(scene_mean(found.solved, there)), *[NOTHING] * 5]
    return [Group("In hindsight", [Row("oracle: any of the peers", cells)])]


def _published(name: str, columns: int, scenes: int) -> list[Group]:
    """Rows of those who published a figure for this benchmark."""
    rows = []
    for published in PUBLISHED:
        if name in published.recall:
            cells = [NOTHING] * columns
            mean = published.recall[name]
            cells[scenes] = Cell(f"{mean:g}", mean, published.source)
            rows.append(Row(published.method, cells))
    return [Group("As published, all scenes and pairs", rows)] if rows else []


def _notes(name: str, start: ReportedStart, shown: bool, scenes: int) -> Iterator[str]:
    if not shown:
        yield f"{scenes} scenes, too many for columns of their own."
    if not start.given and any(name in published.recall for published in PUBLISHED):
        yield (
            "Published figures are over all eight scenes of the test set and all its pairs; those "
            "here are over the scenes and pairs that were run, so read them as a scale."
        )
