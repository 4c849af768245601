"""Lists of pairs: evaluated by their own criterion, with and without a start, and reported."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from evaluation_fakes import STAY, asked, rows

from hmrf_icp.errors import InputError
from hmrf_icp.evaluate import Configuration, Estimate, NamedMethod, Start, evaluate
from hmrf_icp.evaluate.plan import Plan
from hmrf_icp.evaluate.protocol import NO_START, Pair, spread
from hmrf_icp.evaluate.report import write_report
from hmrf_icp.evaluate.report.benchmark import benchmark_tables
from hmrf_icp.evaluate.report.cast import main_cast
from hmrf_icp.evaluate.report.study import Study
from pair_writers import write_fragments, write_pair, write_scene

pytest.importorskip("joblib")


def _as_given(source, target, init):
    """Whatever start it gets; where it gets none, the frames as they are, and it says so."""
    return Estimate(np.eye(4) if init is None else init, confidence=0.1 if init is None else 0.9)


AS_GIVEN = NamedMethod("as-given", _as_given)


def _only_points(source, target, init):
    for one in (source.cloud, target.cloud):
        if one.organised or one.camera is not None or one.viewpoint is not None:
            raise ValueError("more than points")
    return Estimate(np.eye(4))


ONLY_POINTS = NamedMethod("only-points", _only_points)


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scenes")
    for name in ("kitchen", "lab"):
        write_scene(folder / name, ("3DMatch", "3DLoMatch"))
    return folder


@pytest.fixture(scope="module")
def evaluated(scenes: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("evaluated")
    configuration = Configuration(
        str(scenes), methods=(), peers=(), starts=(NO_START, Start(0.01)), axes=2
    )
    evaluate(configuration, folder, workers=1, extra_methods=[AS_GIVEN])
    return folder


def test_nobody_is_given_a_start_where_there_is_none(evaluated: Path) -> None:
    found = rows(evaluated)
    assert Counter(row["angle"] for row in found) == {"none": 12, "0.01": 24}
    # Views of one table from different sides: their frames do not coincide.
    assert {row["right"] for row in found if row["angle"] == "none"} == {"False"}
    assert {row["right"] for row in found if row["angle"] == "0.01"} == {"True"}


def test_pairs_keep_the_overlap_that_their_data_say(evaluated: Path) -> None:
    found = {row["pair"]: float(row["overlap"]) for row in rows(evaluated)}
    assert found["3DLoMatch/lab-0-3"] == pytest.approx(0.7)
    assert len(found) == 12


def test_pairs_without_an_overlap_have_it_measured(tmp_path: Path) -> None:
    write_scene(tmp_path / "kitchen", overlaps=False)
    configuration = Configuration(str(tmp_path / "kitchen"), methods=(), peers=(), pairs=2)
    evaluate(configuration, tmp_path / "out", workers=1, extra_methods=[AS_GIVEN])
    found = rows(tmp_path / "out")
    assert len(found) == 2
    assert all(0.3 < float(row["overlap"]) < 1.0 for row in found)


def test_one_list_can_be_chosen(scenes: Path, tmp_path: Path) -> None:
    configuration = Configuration(str(scenes), methods=(), peers=(), benchmark="3DLoMatch", pairs=4)
    evaluate(configuration, tmp_path, workers=1, extra_methods=[AS_GIVEN])
    assert Counter(row["pair"].rpartition("-0-")[0][:17] for row in rows(tmp_path)).total() == 4
    assert {row["pair"].partition("/")[0] for row in rows(tmp_path)} == {"3DLoMatch"}


def test_what_lists_have_not_got_is_refused(scenes: Path, recording: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no reference frame"):
        evaluate(Configuration(str(scenes), targets=(3,)), tmp_path)
    with pytest.raises(InputError, match="no benchmarks"):
        evaluate(asked(recording, benchmark="3DMatch"), tmp_path)


def test_how_much_there_is_to_do_is_said_before_it_begins(scenes: Path, tmp_path: Path) -> None:
    said: list[str] = []

    def progress(stage: str, done: int, total: int | None) -> None:
        said.append(stage)

    configuration = Configuration(str(scenes), methods=(), peers=(), pairs=3)
    evaluate(
        configuration,
        tmp_path,
        workers=1,
        extra_methods=[AS_GIVEN],
        on_note=said.append,
        on_progress=progress,
    )
    first = next(place for place, words in enumerate(said) if words.startswith("3 runs: 3 pairs"))
    assert "roughly" in said[first]
    assert first < said.index("Registering")


def test_the_shift_of_a_start_is_in_the_unit_of_the_pair(tmp_path: Path) -> None:
    write_pair(tmp_path / "small", scale=0.01, size=0.008)
    configuration = Configuration(
        str(tmp_path), methods=(), peers=(), starts=(Start(0.0, 0.5),), axes=1
    )
    evaluate(configuration, tmp_path / "out", workers=1, extra_methods=[STAY])
    (row,) = rows(tmp_path / "out")
    assert float(row["error_m"]) == pytest.approx(0.5 * 0.008)
    assert row["right"] == "False"


def test_points_alone_are_points_alone(recording: Path, tmp_path: Path) -> None:
    configuration = asked(recording, methods=(), starts=(NO_START,), points_alone=True)
    evaluate(configuration, tmp_path, workers=1, extra_methods=[ONLY_POINTS])
    assert all(row["failure"] == "" for row in rows(tmp_path))


def test_fragments_have_pairs_by_overlap(tmp_path: Path) -> None:
    folder = write_fragments(tmp_path / "fragments")
    configuration = asked(folder, methods=(), targets=(1,), starts=(Start(0.1),))
    evaluate(configuration, tmp_path / "out", workers=1, extra_methods=[STAY])
    found = rows(tmp_path / "out")
    assert {row["target"] for row in found} == {"1"}
    assert {row["right"] for row in found} == {""}


def test_without_a_start_there_is_one_axis() -> None:
    plan = Plan((Pair(0, 1, 0.5), Pair(0, 2, 0.5)), (Start(0.1), NO_START), 3, ("a", "b"))
    assert len(plan) == 2 * (3 + 1) * 2
    runs = [plan.run(number) for number in range(len(plan))]
    assert {run.axis for run in runs if not run.start.given} == {0}
    numbers = [plan.number(run.pair.name, run.start, run.axis, run.method) for run in runs]
    assert numbers == list(range(len(plan)))


def test_few_pairs_are_spread_and_among_the_many() -> None:
    pairs = [Pair(0, k, k / 100, scene) for scene in "ab" for k in range(1, 100)]
    few, many = spread(pairs, 8, seed=3), spread(pairs, 30, seed=3)
    assert set(few) < set(many)
    assert Counter(pair.scene for pair in few) == {"a": 4, "b": 4}
    for scene in "ab":
        overlaps = sorted(pair.overlap for pair in few if pair.scene == scene)
        assert np.diff(overlaps).min() > 0.1
        assert max(overlaps) - min(overlaps) > 0.5
    assert spread(pairs, 1000, seed=3) == tuple(pairs)
    assert spread(pairs, 8, seed=4) != few


# The report


def test_a_report_has_the_means_over_scenes_and_what_others_published(evaluated: Path) -> None:
    study = Study.read(evaluated)
    tables = {table.name: table for table in benchmark_tables(study, main_cast(study))}
    assert set(tables) == {
        f"benchmark-{name}-{start}"
        for name in ("3dmatch", "3dlomatch")
        for start in ("none", "0.01rad")
    }
    table = tables["benchmark-3dlomatch-none"]
    cells = dict(zip(table.columns, table.row("as-given").cells, strict=True))
    assert cells["mean over scenes"].text == "0.000"
    assert cells["kitchen\n3 pairs"].text == "0.00"
    assert cells["told 0.5 or more: right / wrong"].text == "0 / 0"
    published = dict(zip(table.columns, table.row("GeoTransformer (learned)").cells, strict=True))
    assert published["mean over scenes"].text == "0.742"
    begun = tables["benchmark-3dlomatch-0.01rad"]
    cells = dict(zip(begun.columns, begun.row("as-given").cells, strict=True))
    assert cells["mean over scenes"].text == "1.000"
    assert cells["told 0.5 or more: right / wrong"].text == "12 / 0"
    assert not any("published" in group.heading for group in begun.groups)


def test_scenes_count_alike_however_many_pairs_they_have(evaluated: Path, tmp_path: Path) -> None:
    for name in ("config.json", "pairs.csv"):
        (tmp_path / name).write_bytes((evaluated / name).read_bytes())
    lines = (evaluated / "results.csv").read_text().splitlines(keepends=True)
    kept = [lines[0]]
    for line in lines[1:]:
        if line.startswith("3DMatch/") and ",none," in line:
            lab = line.startswith("3DMatch/lab")
            if not lab or "-0-2," in line:  # three pairs of the kitchen, one of the lab
                kept.append(line.replace(",False,", ",True,") if lab else line)
    (tmp_path / "results.csv").write_text("".join(kept))
    study = Study.read(tmp_path)
    table = next(t for t in benchmark_tables(study, main_cast(study)) if "3dmatch" in t.name)
    cells = dict(zip(table.columns, table.row("as-given").cells, strict=True))
    assert cells["mean over scenes"].text == "0.500"


def test_a_report_names_the_criterion_and_the_missing_start(evaluated: Path) -> None:
    pytest.importorskip("jinja2")
    assert "gt.info" in json.loads((evaluated / "config.json").read_text())["criterion"]
    files = write_report(evaluated, worst=2)
    page = files.page.read_text()
    assert "without a start" in page
    assert "from none" not in page
    assert "started none" not in page
    assert "root mean square error of the pair" in files.summary[0]


def test_the_worst_pairs_of_a_list_are_drawn_again(scenes: Path, tmp_path: Path) -> None:
    pytest.importorskip("jinja2")
    evaluate(Configuration(str(scenes), methods=("x84",), peers=(), pairs=1), tmp_path, workers=1)
    write_report(tmp_path, worst=1)
    assert (tmp_path / "figures" / "worst-1.png").is_file()
