from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import evaluation_fakes
import numpy as np
import pytest
from evaluation_fakes import (
    KILLS,
    NOT_A_NUMBER,
    RAISES,
    SLOW,
    STAY,
    asked,
    asked_at_length,
    rows,
    write_recording,
)

from hmrf_icp.errors import InputError
from hmrf_icp.evaluate import NamedMethod, Start, evaluate
from hmrf_icp.evaluate.methods import PAPER_METHODS

pytest.importorskip("joblib")


@pytest.fixture(scope="session")
def finished(recording: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An evaluation by one worker that nothing happened to."""
    folder = tmp_path_factory.mktemp("finished")
    configuration = asked(recording, methods=("hmrf", "x84"))
    evaluate(configuration, folder, workers=1, extra_methods=(STAY,))
    return folder


def test_every_pair_is_registered_from_every_start_by_every_method(finished: Path):
    found = rows(finished)
    pairs = {row["pair"] for row in found}
    assert len(pairs) >= 3
    assert len(found) == len(pairs) * 2 * 2 * 3
    assert {row["target"] for row in found} == {"3"}
    assert {(row["angle"], row["translation"]) for row in found} == {
        ("0.05", "0.0"),
        ("0.1", "0.02"),
    }
    assert {row["failure"] for row in found} == {""}


def test_a_method_that_does_nothing_ends_as_far_off_as_it_began(finished: Path):
    idle = [row for row in rows(finished) if row["method"] == "stay"]
    assert [float(row["error_rad"]) for row in idle] == pytest.approx(
        [float(row["angle"]) for row in idle], abs=1e-6
    )
    assert {row["iterations"] for row in idle} == {"0"}


def test_the_field_brings_pairs_of_high_overlap_nearer_to_the_true_pose(finished: Path):
    high = [r for r in rows(finished) if float(r["overlap"]) > 0.8 and r["angle"] == "0.05"]
    errors = {
        m: [float(r["error_rad"]) for r in high if r["method"] == m] for m in ("hmrf", "stay")
    }
    assert errors["hmrf"]
    assert np.median(errors["hmrf"]) < 0.75 * np.median(errors["stay"])


def test_rows_do_not_depend_on_the_number_of_workers(
    recording: Path, finished: Path, tmp_path: Path
):
    configuration = asked(recording, methods=("hmrf", "x84"))
    evaluate(configuration, tmp_path, workers=2, extra_methods=(STAY,))
    assert rows(tmp_path) == rows(finished)
    assert (tmp_path / "pairs.csv").read_bytes() == (finished / "pairs.csv").read_bytes()


def test_the_configuration_is_written_with_versions_and_machine(finished: Path):
    config = json.loads((finished / "config.json").read_text())
    assert config["methods"] == ["hmrf", "x84", "stay"]
    assert config["targets"] == [3]
    assert config["starts"][1] == {"angle": 0.1, "translation": 0.02}
    assert config["versions"]["numpy"] == np.__version__
    assert config["machine"]["cores"] >= 1
    assert any("no pair with an overlap" in note for note in config["notes"])


def test_what_is_done_is_not_done_again_and_what_was_torn_is(
    recording: Path, finished: Path, tmp_path: Path
):
    for name in ("results.csv", "pairs.csv", "config.json"):
        content = (finished / name).read_bytes()
        (tmp_path / name).write_bytes(content[:-20] if name == "results.csv" else content)
    seen: list[tuple[str, int, int]] = []
    evaluate(
        asked(recording, methods=("hmrf", "x84")),
        tmp_path,
        workers=1,
        extra_methods=(STAY,),
        on_progress=lambda *progress: seen.append(progress),
    )
    total = len(rows(finished))
    assert seen == [("Registering", total - 1, total), ("Registering", total, total)]
    assert rows(tmp_path) == rows(finished)
    whole = rows(finished, without=())
    assert rows(tmp_path, without=())[:-1] == whole[:-1]


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"axes": 4}, "axes was 2, is 4"),
        ({"seed": 1}, "seed was 0, is 1"),
        ({"starts": (Start(0.05),)}, "starts was"),
        ({"methods": ("x84",)}, "methods was"),
        ({"subsample": 2}, "subsample was 1, is 2"),
    ],
)
def test_results_of_another_configuration_are_refused_and_kept(
    recording: Path, finished: Path, changes: dict, named: str
):
    before = (finished / "results.csv").read_bytes()
    configuration = asked(recording, **{"methods": ("hmrf", "x84"), **changes})
    with pytest.raises(InputError, match=rf"{named}.*--fresh"):
        evaluate(configuration, finished, extra_methods=(STAY,))
    assert (finished / "results.csv").read_bytes() == before


def test_results_of_another_version_are_refused(recording: Path, finished: Path, tmp_path: Path):
    config = json.loads((finished / "config.json").read_text())
    config["versions"]["numpy"] = "1.0"
    (tmp_path / "config.json").write_text(json.dumps(config))
    configuration = asked(recording, methods=("hmrf", "x84"))
    with pytest.raises(InputError, match=r'version of numpy was "1\.0"'):
        evaluate(configuration, tmp_path, extra_methods=(STAY,))


def test_results_that_nobody_knows_are_refused(recording: Path, tmp_path: Path):
    (tmp_path / "results.csv").write_text("mine\n")
    with pytest.raises(InputError, match=r"no config\.json"):
        evaluate(asked(recording), tmp_path)
    assert (tmp_path / "results.csv").read_text() == "mine\n"


def test_a_method_that_fails_has_a_row_and_costs_no_other_method_its_own(
    recording: Path, tmp_path: Path
):
    evaluate(
        asked(recording, methods=(), axes=1, starts=(Start(0.05),), minimum_overlap=0.8),
        tmp_path,
        workers=2,
        extra_methods=(STAY, RAISES, NOT_A_NUMBER, KILLS),
    )
    found = rows(tmp_path)
    failures = {m: {r["failure"] for r in found if r["method"] == m} for m in ("stay", "raises")}
    assert failures == {"stay": {""}, "raises": {"ZeroDivisionError: no point is left"}}
    for method, word in (("not-a-number", "finite"), ("kills", "worker died")):
        mine = [row for row in found if row["method"] == method]
        assert len(mine) == len({row["pair"] for row in found})
        assert all(word in row["failure"] and row["error_m"] == "" for row in mine)


def test_fresh_begins_anew(recording: Path, tmp_path: Path):
    small = asked(recording, methods=(), axes=1, starts=(Start(0.05),))
    evaluate(small, tmp_path, workers=1, extra_methods=(STAY,))
    other = asked(recording, methods=(), axes=1, starts=(Start(0.2),))
    (tmp_path / "mine.txt").write_text("kept")
    evaluate(other, tmp_path, workers=1, extra_methods=(STAY,), fresh=True)
    assert {row["angle"] for row in rows(tmp_path)} == {"0.2"}
    assert (tmp_path / "mine.txt").read_text() == "kept"


def test_a_killed_evaluation_goes_on_and_ends_as_if_nothing_had_happened(
    recording: Path, tmp_path: Path
):
    killed = tmp_path / "killed"
    process = _started(recording, killed)
    try:
        _wait_for_rows(killed / "results.csv", process)
        with pytest.raises(InputError, match="another evaluation is writing"):
            evaluate(asked_at_length(recording), killed, extra_methods=(SLOW,))
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    done = len(rows(killed))
    resumed_at: list[int] = []
    configuration = asked_at_length(recording)
    evaluate(
        configuration,
        killed,
        workers=2,
        extra_methods=(SLOW,),
        on_progress=lambda stage, at, total: resumed_at.append(at),
    )
    assert 0 < done <= resumed_at[0] + 1
    assert resumed_at[0] < resumed_at[-1]
    whole = tmp_path / "whole"
    quick = NamedMethod("slow", evaluation_fakes.quick)
    evaluate(configuration, whole, workers=2, extra_methods=(quick,))
    assert rows(killed) == rows(whole)


def _started(recording: Path, output: Path) -> subprocess.Popen[bytes]:
    script = (
        f"import sys; sys.path.insert(0, {str(Path(evaluation_fakes.__file__).parent)!r}); "
        f"import evaluation_fakes; "
        f"evaluation_fakes.run_slowly({str(recording)!r}, {str(output)!r})"
    )
    return subprocess.Popen([sys.executable, "-c", script], stderr=subprocess.DEVNULL)


def _wait_for_rows(path: Path, process: subprocess.Popen[bytes], count: int = 10) -> None:
    until = time.monotonic() + 120
    while not (path.is_file() and path.read_bytes().count(b"\n") > count):
        assert process.poll() is None, "it ended before it could be killed"
        assert time.monotonic() < until, "it did not begin"
        time.sleep(0.05)


def test_a_sequence_without_any_overlap_is_an_error_that_says_so(tmp_path: Path):
    folder = write_recording(tmp_path / "apart")
    for k, path in enumerate(sorted(folder.glob("*.pose.txt"))):
        pose = np.loadtxt(path)
        pose[0, 3] += 100.0 * k
        np.savetxt(path, pose)
    with pytest.raises(InputError, match="no frame overlaps target frame 3"):
        evaluate(asked(folder), tmp_path / "out", workers=1)


def test_a_frame_whose_file_is_damaged_is_named(recording: Path, tmp_path: Path):
    folder = write_recording(tmp_path / "damaged")
    victim = folder / "frame-000005.depth.png"
    victim.write_bytes(victim.read_bytes()[:200])
    with pytest.raises(InputError, match=r"frame-000005\.depth\.png"):
        evaluate(asked(folder), tmp_path / "out", workers=1)


def test_a_reference_frame_that_is_not_there_is_refused(recording: Path, tmp_path: Path):
    with pytest.raises(InputError, match="no frame 77"):
        evaluate(asked(recording, targets=(77,)), tmp_path)


def test_an_unknown_method_is_refused_with_the_known_ones(recording: Path, tmp_path: Path):
    with pytest.raises(InputError, match="hmrf, all, percent, sigma, x84, dynamic"):
        evaluate(asked(recording, methods=("hrmf",)), tmp_path)


def test_two_methods_of_one_name_are_refused(recording: Path, tmp_path: Path):
    with pytest.raises(InputError, match="two are called x84"):
        evaluate(asked(recording), tmp_path, extra_methods=(NamedMethod("x84", STAY.register),))


def test_the_paper_is_evaluated_with_every_preset_unless_told_otherwise():
    from hmrf_icp import presets
    from hmrf_icp.evaluate.methods import choose

    names = [method.name for method in choose(None)]
    assert names[:6] == list(PAPER_METHODS)
    assert names[6:] == [name for name in presets.names() if name != "paper"]
    assert [method.name for method in choose(["paper"])] == ["hmrf"]


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"axes": 0}, "axes"),
        ({"frames_per_decile": 0}, "frames_per_decile"),
        ({"subsample": 0}, "subsample"),
        ({"minimum_overlap": 1.0}, "minimum_overlap"),
        ({"seed": -1}, "seed"),
        ({"starts": ()}, "starts"),
        ({"starts": (Start(0.1), Start(0.1))}, "twice"),
    ],
)
def test_numbers_out_of_range_are_refused(changes: dict, named: str):
    with pytest.raises(InputError, match=named):
        asked(Path("nowhere"), **changes)
