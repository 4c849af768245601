"""What an evaluation showed, in a few sentences worked out from its rows."""

from __future__ import annotations

from hmrf_icp.evaluate.report.confidence import LOW_OVERLAP, SURE, confident
from hmrf_icp.evaluate.report.cost_tables import overlap_words
from hmrf_icp.evaluate.report.recall_tables import Slice, recall
from hmrf_icp.evaluate.report.runs import ReportedStart
from hmrf_icp.evaluate.report.statistics import Share, median
from hmrf_icp.evaluate.report.study import Study


def summary(study: Study) -> list[str]:
    """Return sentences for the head of a report, the most important first."""
    sentences = [_extent(study)]
    sentences += [_start(study, start) for start in study.starts]
    sentences += _paper_field(study)
    sentences += _accuracy(study)
    sentences += _confidence(study)
    return sentences


def _extent(study: Study) -> str:
    runs = study.runs
    pairs = len(set(runs["pair"].tolist()))
    low, high = (overlap_words(float(end(runs["overlap"]))) for end in (min, max))
    angles = ", ".join(start.label for start in study.starts if start.given)
    begun = [f"started {angles} from the true pose"] if angles else []
    begun += [start.begun for start in study.starts if not start.given]
    return (
        f"{_count(len(runs), 'run')} of {_count(len(runs.methods), 'method')} on "
        f"{_count(pairs, 'pair')} of {study.dataset}, overlap {low} to {high}, "
        f"{' and '.join(begun)}. A run is solved when {study.criterion}."
    )


def _start(study: Study, start: ReportedStart) -> str:
    headline = study.headline
    part = Slice(start)
    ours = recall(study, headline, part)
    sentence = f"{start.begins}, {headline.label} solves {_share(ours)}"
    hindsight = study.hindsight(start)
    if hindsight is None or headline.kind == "peer":
        return sentence + "."
    chosen = hindsight.best(study.runs.where(part.of(study.runs)), study.success)
    single = recall(study, chosen, part)
    oracle = hindsight.oracle(study.runs, study.success)
    any_peer = oracle.share(part.of(oracle.problems))
    if ours.value is None or single.value is None or any_peer.value is None:
        return sentence + "."
    verdict = (
        "at or above the oracle"
        if ours.value >= any_peer.value
        else "below the oracle"
        if ours.value >= single.value
        else "below the best single setting"
    )
    return (
        f"{sentence}; the best single peer setting ({chosen.label}) {single.value:.2f}, the oracle "
        f"over all of them {any_peer.value:.2f}: {verdict}."
    )


def _paper_field(study: Study) -> list[str]:
    paper = study.roster.of_kind("paper")
    rules = [method for method in paper if method.name != "hmrf"]
    field = [method for method in paper if method.name == "hmrf"]
    if not rules or not field:
        return []
    ours = recall(study, field[0], Slice())
    best = max(rules, key=lambda rule: recall(study, rule, Slice()).value or 0.0)
    theirs = recall(study, best, Slice())
    if ours.value is None or theirs.value is None:
        return []
    return [
        f"Among the paper's methods, over all starts, its field (HMRF) solves {ours.value:.2f} and "
        f"the best of its other rules ({best.label}) {theirs.value:.2f}."
    ]


def _accuracy(study: Study) -> list[str]:
    mask = study.solved & study.runs.of(study.headline.name)
    metres, radians = (median(study.runs[column][mask]) for column in ("error_m", "error_rad"))
    seconds = median(study.runs["seconds"][study.runs.of(study.headline.name)])
    if metres is None or radians is None or seconds is None:
        return []
    return [
        f"Where {study.headline.label} succeeds, its median error is {1e3 * metres:.2g} mm and "
        f"{1e3 * radians:.2g} mrad; half of its runs take less than {seconds:.2g} s."
    ]


def _confidence(study: Study) -> list[str]:
    for score in confident(study):
        if score.label != study.headline.label:
            continue
        area, low = score.area(), score.area(low_only=True)
        if area is None:
            continue
        below = "" if low is None else f", {low:.3f} below {LOW_OVERLAP:g} of overlap"
        sure = score.value >= SURE
        wrong = Share.of(~score.solved[sure])
        told = f" Of its runs with a confidence of 0.5 or more, {wrong.solved} of {wrong.runs} are "
        return [
            f"Its confidence tells success from failure with an area under the ROC curve of "
            f"{area:.3f}{below}." + (told + "wrong." if wrong.runs else "")
        ]
    return []


def _count(number: int, word: str) -> str:
    return f"{number:,} {word}{'' if number == 1 else 's'}".replace(",", " ")


def _share(share: Share) -> str:
    if share.value is None:
        return "nothing: it was not run"
    low, high = share.interval
    return f"{share.value:.2f} of its runs (95 % interval {low:.2f} to {high:.2f})"
