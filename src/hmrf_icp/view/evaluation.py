"""The runs of an evaluation: a table, the worst first, and the page of each when it is opened."""

from __future__ import annotations

import html
import math
import threading
import warnings
from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import parse_qs, quote, urlsplit

import numpy as np

import hmrf_icp
from hmrf_icp import presets
from hmrf_icp.errors import InputError, RegistrationWarning
from hmrf_icp.evaluate.methods import preset_of
from hmrf_icp.evaluate.report.replay import Problem, Replay
from hmrf_icp.evaluate.report.study import Study
from hmrf_icp.figures.states import Recording
from hmrf_icp.result import BELIEVED
from hmrf_icp.view import words
from hmrf_icp.view.page import POLICY, anchors, asset, filled, page
from hmrf_icp.view.story import Story
from hmrf_icp.view.telling import story, story_of_pose

MOST_ROWS = 1000
"""Runs in the table at the most."""

KEPT = 8
"""Pages that are kept: going back to one does not register again."""

HEADINGS = ("Run", "Pair", "Outcome", "Error", "Confidence", "Overlap", "Start")


class EvaluationPages:
    """The pages of an evaluation; give it to a :class:`~hmrf_icp.view.server.Viewer`.

    Parameters
    ----------
    folder
        The ``--output`` of ``hmrf-icp evaluate``.

    Raises
    ------
    InputError
        No results are in it.
    """

    def __init__(self, folder: Path) -> None:
        self._study = Study.read(folder)
        self._replay: Replay | None = None
        self._kept: OrderedDict[int, str] = OrderedDict()
        # One registration at a time: each uses all cores.
        self._one = threading.Lock()

    def __call__(self, path: str) -> str | None:
        """Return the table at the empty path, a run's page at ``run/LINE``."""
        asked = urlsplit(path)
        methods = self._study.runs.methods
        if asked.path == "":
            method = parse_qs(asked.query).get("method", [self._study.headline.name])[0]
            return self._table(method) if method in methods else None
        kind, _, number = asked.path.partition("/")
        lines = self._study.runs.line
        if kind != "run" or not number.isascii() or not number.isdigit():
            return None
        found = np.flatnonzero(lines == int(number[:12]))
        return None if found.size == 0 else self._run(int(found[0]))

    def worst_first(self, method: str) -> list[int]:
        """Order the runs of a method: the wrong ones first, those most sure of themselves ahead.

        Right ones follow, the least sure ahead. Where a method is never sure, the largest
        error is the worst.
        """
        study = self._study
        mine = np.flatnonzero(study.runs.of(method))
        sure = np.nan_to_num(study.runs["confidence"][mine], nan=-1.0)
        right = study.solved[mine]
        error = np.nan_to_num(study.runs["error_m"][mine], nan=math.inf)
        order = np.lexsort((-error, np.where(right, sure, -sure), right))
        return [int(index) for index in mine[order]]

    def _table(self, method: str) -> str:
        study = self._study
        order = self.worst_first(method)
        wrong = int(np.count_nonzero(~study.solved[order]))
        several = len(study.runs.methods) > 1
        links = [(f"?method={quote(name)}", name) for name in study.runs.methods if several]
        here = f"?method={quote(method)}"
        said = f"{len(order):,} runs of {method}, {wrong:,} of them wrong"
        cut = "" if len(order) <= MOST_ROWS else f" The table holds the worst {MOST_ROWS:,}."
        rows = "\n".join(self._row(index) for index in order[:MOST_ROWS])
        heads = "".join(f'<th scope="col">{name}</th>' for name in HEADINGS)
        content = (
            f"<p>{html.escape(said)}. The worst first: wrong ones by how sure they were, then the "
            f"right ones that were least sure.{cut} A run is right when "
            f"{html.escape(study.criterion)}. Open one to register the pair again and look at it; "
            "that takes as long as it took.</p>"
            f'<div class="wide"><table><thead><tr>{heads}</tr></thead>'
            f"<tbody>\n{rows}\n</tbody></table></div>"
        )
        return _plain_page(f"Runs on {study.dataset}", links, content, here)

    def _row(self, index: int) -> str:
        runs, study = self._study.runs, self._study
        line, right = int(runs.line[index]), bool(study.solved[index])
        confidence = float(runs["confidence"][index])
        told = math.isfinite(confidence)
        if runs.failed[index]:
            error, outcome = "no pose", f"gave no pose: {runs['failure'][index] or 'no reason'}"
        else:
            metres, radians = (float(runs[name][index]) for name in ("error_m", "error_rad"))
            error = f"{words.length(metres)}, {words.angle(radians)}"
            outcome = "right" if right else "wrong"
            if told and right != (confidence >= BELIEVED):
                outcome += ", and believed" if not right else ", and not believed"
        style = "good" if right else "bad"
        mark = "b" if not right and told and confidence >= BELIEVED else "span"
        cells = (
            f'<th scope="row"><a href="run/{line}">{line}</a></th>',
            f"<td>{html.escape(self._name(index))}</td>",
            f'<td><{mark} class="{style}">{html.escape(outcome)}</{mark}></td>',
            f"<td>{html.escape(error)}</td>",
            f"<td>{f'{confidence:.2f}' if told else '–'}</td>",
            f"<td>{float(runs['overlap'][index]):.2f}</td>",
            f"<td>{html.escape(self._start(index))}</td>",
        )
        return f"<tr>{''.join(cells)}</tr>"

    def _name(self, index: int) -> str:
        runs = self._study.runs
        place = self._study.scenes.get(str(runs["pair"][index]), "")
        pair = f"{runs['source'][index]} to {runs['target'][index]}"
        return f"{place}: {pair}" if place else pair

    def _start(self, index: int) -> str:
        runs = self._study.runs
        angle, translation = float(runs["angle"][index]), float(runs["translation"][index])
        for start in runs.starts:
            if (start.angle, start.translation) == (angle, translation):
                return start.label
        return ""

    def _run(self, index: int) -> str:
        links = self._links(index)
        with self._one:
            if index not in self._kept:
                try:
                    self._kept[index] = page(self.story(index), links)
                except InputError as error:
                    said = f"<p>{html.escape(str(error))}</p>"
                    return _plain_page("This run cannot be shown", links, said)
            self._kept.move_to_end(index)
            while len(self._kept) > KEPT:
                self._kept.popitem(last=False)
            return self._kept[index]

    def _links(self, index: int) -> list[tuple[str, str]]:
        method = str(self._study.runs["method"][index])
        order = self.worst_first(method)
        at = order.index(index)
        links = [(f"../?method={quote(method)}", "All runs")]
        if at > 0:
            links.append((str(self._study.runs.line[order[at - 1]]), "Worse"))
        if at + 1 < len(order):
            links.append((str(self._study.runs.line[order[at + 1]]), "Better"))
        return links

    def story(self, index: int) -> Story:
        """Register the pair of a row again, and tell what happened.

        Raises
        ------
        InputError
            The data are not there any more, or the method gives no pose.
        """
        if self._replay is None:
            self._replay = Replay.of(self._study)
        problem = self._replay.problem(self._study, index)
        method = str(self._study.runs["method"][index])
        names = tuple(f"{word} {self._study.runs[word][index]}" for word in ("source", "target"))
        own = preset_of(method)
        if own is None:
            return self._of_peer(method, problem, (names[0], names[1]))
        recording = Recording()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RegistrationWarning)
            result = hmrf_icp.register(
                problem.source.cloud,
                problem.target.cloud,
                problem.init,
                preset=presets.preset(own[0]),
                rejector=None if own[1] is None else presets.rejector(own[1]),
                on_iteration=recording,
            )
        return story(result, problem.init, recording, problem.truth, (names[0], names[1]))

    def _of_peer(self, method: str, problem: Problem, names: tuple[str, str]) -> Story:
        assert self._replay is not None
        end = self._replay.registered(method, problem.source, problem.target, problem.init)
        clouds = (
            hmrf_icp.prepare(problem.source.cloud, "source"),
            hmrf_icp.prepare(problem.target.cloud, "target"),
        )
        said = f"{method} gave this pose, and no confidence."
        return story_of_pose(*clouds, problem.init, end, said, problem.truth, names)


def _plain_page(title: str, links: Sequence[tuple[str, str]], content: str, here: str = "") -> str:
    return filled(
        "table.html",
        title=html.escape(title),
        policy=POLICY,
        style=asset("theme.css") + asset("table.css"),
        heading=html.escape(title),
        links=anchors(links, here),
        content=content,
    )
