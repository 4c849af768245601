"""Names, words and numbers of others in what an evaluation writes and reads."""

from __future__ import annotations

import csv
import socket
from pathlib import Path

import pytest
from evaluation_fakes import STAY, asked, rows, write_recording

from hmrf_icp import InputError
from hmrf_icp.evaluate import NamedMethod, evaluate
from hmrf_icp.evaluate.configuration import require_same
from hmrf_icp.evaluate.evaluation import _read_pairs
from hmrf_icp.evaluate.plain import cell, plain
from hmrf_icp.evaluate.plan import Plan
from hmrf_icp.evaluate.protocol import Pair, Start
from hmrf_icp.evaluate.results import HEADER, Results, Row, read_rows

PLAN = Plan((Pair(0, 1, 0.5), Pair(0, 2, 0.25)), (Start(0.1),), 2, ("mine", 'a, "b" <i> $x$'))


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return write_recording(tmp_path_factory.mktemp("names") / "recording")


@pytest.mark.parametrize(
    "name",
    ["", " a", "two\nlines", "a\rb", "tab\there", "\udcff", "\0", "=1+1", "-x", "@a", "a" * 101],
)
def test_a_name_that_results_cannot_hold_is_refused_before_any_work(recording, tmp_path, name):
    with pytest.raises(InputError, match="cannot be a name in results"):
        evaluate(
            asked(recording), tmp_path / "out", extra_methods=[NamedMethod(name, STAY.register)]
        )
    assert not (tmp_path / "out").exists()


def _fail(source, target, init):
    raise ValueError("cannot open scan_\udcff.ply\n\0 =<b>$")


def test_odd_names_and_failures_are_evaluated_stopped_and_gone_on_with(recording, tmp_path):
    odd = [NamedMethod('mine, "<b>" $a_{b$ [/red] μ|x', _fail), NamedMethod("stay", STAY.register)]
    for _ in range(2):
        evaluate(asked(recording, methods=()), tmp_path, workers=1, extra_methods=odd)
    found = rows(tmp_path)
    assert {row["method"] for row in found} == {method.name for method in odd}
    failures = {row["failure"] for row in found if row["method"].startswith("mine")}
    assert failures == {"ValueError: cannot open scan_\\udcff.ply \N{REPLACEMENT CHARACTER} =<b>$"}


@pytest.mark.parametrize("words", ["=cmd", "+1", "-1", "@x"])
def test_a_failure_is_never_a_formula(tmp_path, words):
    with Results(tmp_path / "results.csv", PLAN) as results:
        results.append([Row(PLAN.run(0), 0.1, failure=words)])
    assert [found for (found,) in read_rows(tmp_path / "results.csv", ("failure",))] == [
        f"'{words}"
    ]
    assert plain(words) == words != cell(words)


# ---- Rows that cannot be read --------------------------------------------------------------------


def written(path: Path) -> list[bytes]:
    with Results(path, PLAN) as results:
        results.append(Row(PLAN.run(n), 0.1, 0.01, 0.02) for n in range(len(PLAN)))
    return path.read_bytes().splitlines(keepends=True)


@pytest.mark.parametrize(
    "broken",
    [
        b"000000-000001,0,1\n",
        b"\xff\xfe\n",
        b"\n",
        b'000000-000001,0,1,0.5,0.1,0.0,0,"mine,0.01,0.02,,,0.1,,,,\n',
        b"000000-000001,0,1,0.5,tenth,0.0,0,mine,0.01,0.02,,,0.1,,,,\n",
        b"000000-000001,0,1,0.5,0.1,0.0,0,mine,0.01,0.02,,,soon,,,,\n",
        b"a" * 200_000 + b"\n",
    ],
)
def test_a_line_that_cannot_be_read_is_named_and_its_run_done_again(tmp_path, broken):
    path = tmp_path / "results.csv"
    lines = written(path)
    path.write_bytes(b"".join([*lines[:2], broken, *lines[3:]]))
    with Results(path, PLAN) as results:
        assert [place for place, _ in results.unreadable] == [3]
        assert [n for n in range(len(PLAN)) if not results.done[n]] == [1]
        results.append([Row(PLAN.run(1), 0.1, 0.01, 0.02)])
        results.sort()
    assert path.read_bytes() == b"".join(lines)


def test_what_was_taken_out_is_said(recording, tmp_path):
    notes: list[str] = []
    configuration = asked(recording, methods=())
    for attempt in range(2):
        evaluate(configuration, tmp_path, workers=1, extra_methods=[STAY], on_note=notes.append)
        if not attempt:
            whole = (tmp_path / "results.csv").read_bytes()
            lines = whole.splitlines(keepends=True)
            (tmp_path / "results.csv").write_bytes(b"".join([HEADER, b"half a row\n", *lines[2:]]))
    assert any("results.csv, line 2: cannot be read: 'half a row'" in note for note in notes)
    assert len(rows(tmp_path)) == len(lines) - 1


# ---- Pairs and configuration -------------------------------------------------------------------


@pytest.mark.parametrize(
    "row",
    [
        *(f"45,3,{overlap}" for overlap in ("nan", "7", "-1", "0", "inf", "half")),
        "x,3,0.5",
        "45,3,0.5\n000045-000003,45,3,0.5",
        '45,3,"0.5',
        "45,3," + "9" * 200_000,
    ],
)
def test_pairs_that_nothing_can_be_registered_by(tmp_path, row):
    (tmp_path / "pairs.csv").write_text(f"pair,target,source,overlap\n000045-000003,{row}\n")
    with pytest.raises(InputError, match=r"pairs\.csv: not a list of pairs"):
        _read_pairs(tmp_path / "pairs.csv")


def test_a_pair_of_frames_that_the_recording_has_not_got(recording, tmp_path):
    configuration = asked(recording, methods=())
    evaluate(configuration, tmp_path, workers=1, extra_methods=[STAY])
    with (tmp_path / "pairs.csv").open("a") as stream:
        stream.write("000003-000099,3,99,0.5\n")
    with pytest.raises(InputError, match="000003-000099 is not one of the recording's frames"):
        evaluate(configuration, tmp_path, workers=1, extra_methods=[STAY])


def test_a_configuration_nested_without_end(tmp_path):
    (tmp_path / "config.json").write_text("[" * 100_000)
    with pytest.raises(InputError, match=r"config\.json: cannot be read"):
        require_same(tmp_path / "config.json", asked(tmp_path))


def test_a_field_too_long_for_the_csv_reader(tmp_path):
    with (tmp_path / "results.csv").open("w", newline="") as stream:
        csv.writer(stream).writerows([["method"], ["a" * 200_000]])
    with pytest.raises(InputError, match=r"results\.csv: cannot be read"):
        list(read_rows(tmp_path / "results.csv", ("method",)))


def test_a_scheduler_that_accepts_and_says_nothing(recording, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    from hmrf_icp.evaluate import workers

    monkeypatch.setattr(workers, "CONNECTION_SECONDS", 0.3)
    with socket.socket() as mute:
        mute.bind(("127.0.0.1", 0))
        mute.listen()
        address = f"tcp://127.0.0.1:{mute.getsockname()[1]}"
        with pytest.raises(InputError, match=rf"no Dask scheduler answers at {address} .*within"):
            evaluate(asked(recording), tmp_path, scheduler=address)
