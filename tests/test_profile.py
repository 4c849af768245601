"""Time and calls by stage: only where asked for, each second once, the same calls anywhere."""

from __future__ import annotations

import pickle
import time
from itertools import count

import numpy as np
import pytest

import hmrf_icp
import synthetic
from hmrf_icp import stages, threads
from hmrf_icp.clouds import tree


@pytest.fixture
def four_cores(monkeypatch):
    """A machine of four cores, and pieces small enough for these clouds."""
    monkeypatch.setattr(threads, "most", lambda: 4)
    monkeypatch.setattr(tree, "PIECE", 40)


@pytest.fixture
def ticking(monkeypatch):
    """A clock that goes on by a second whenever it is looked at."""
    ticks = count()
    monkeypatch.setattr(stages.time, "perf_counter", lambda: float(next(ticks)))


def test_nobody_who_does_not_ask_gets_one():
    result = hmrf_icp.register(*synthetic.pair())
    assert result.profile is None
    assert stages.current() is None


def test_a_profile_changes_nothing_else():
    plain, profiled = (hmrf_icp.register(*synthetic.pair(), profile=on) for on in (False, True))
    np.testing.assert_array_equal(profiled.transformation, plain.transformation)
    np.testing.assert_array_equal(profiled.distance, plain.distance)
    assert profiled.confidence == plain.confidence
    assert stages.current() is None
    assert pickle.loads(pickle.dumps(profiled)).profile == profiled.profile


@pytest.mark.parametrize("preset", hmrf_icp.presets.names())
def test_stages_come_the_longest_first_and_each_once(preset):
    profile = hmrf_icp.register(*synthetic.pair(), preset=preset, profile=True).profile
    assert len({stage.name for stage in profile}) == len(profile)
    seconds = [stage.seconds for stage in profile]
    assert seconds == sorted(seconds, reverse=True)
    assert min(seconds) >= 0.0
    assert min(stage.calls for stage in profile) >= 1
    assert {"checks", "match", "reject", "align", "description"} <= {s.name for s in profile}


def test_calls_are_the_same_with_any_number_of_threads(four_cores):
    one, *others = (
        {
            stage.name: stage.calls
            for stage in hmrf_icp.register(
                *synthetic.pair(), profile=True, num_threads=number
            ).profile
        }
        for number in (1, 2, 4)
    )
    assert others == [one, one]


@pytest.mark.parametrize("number", [1, 2, 4])
def test_own_times_add_up_to_no_more_than_the_threads_had(four_cores, number):
    began = time.perf_counter()
    result = hmrf_icp.register(*synthetic.pair(), profile=True, num_threads=number)
    passed = time.perf_counter() - began
    assert 0.0 < sum(stage.seconds for stage in result.profile) <= number * passed


def test_a_stage_within_another_counts_as_itself_alone(ticking):
    watch = stages.Stopwatch()
    with watch.measure("outer"):  # 0
        with watch.measure("inner"):  # 1 to 2
            pass
        with watch.measure("inner"), watch.measure("innermost"):  # 3; 4 to 5; 6
            pass
    # 7
    assert set(watch.stages) == {
        stages.Stage("outer", 1, 3.0),
        stages.Stage("inner", 2, 3.0),
        stages.Stage("innermost", 1, 1.0),
    }


def test_a_stage_that_fails_is_counted_too(ticking):
    @stages.stage("failing")
    def fail():
        raise ValueError("as it must")

    watch = stages.Stopwatch()
    with pytest.raises(ValueError, match="as it must"), stages.timed_by(watch):
        fail()
    assert watch.stages == (stages.Stage("failing", 1, 1.0),)
    assert stages.current() is None


def test_what_is_no_registration_is_measured_by_nobody(ticking):
    @stages.stage("idle")
    def idle():
        return "done"

    assert idle() == "done"
    assert stages.time.perf_counter() == 0.0, "nobody looked at the clock"
