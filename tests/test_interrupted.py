"""Ctrl-C: KeyboardInterrupt wherever it falls, and nothing half done after it."""

from __future__ import annotations

import ctypes
import signal
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from typer.testing import CliRunner

import hmrf_icp
import synthetic
from hmrf_icp import cli


def compiled_loop_interrupted(_):
    """What Numba raises where a signal arrived while a compiled loop ran."""
    try:
        raise KeyboardInterrupt
    except KeyboardInterrupt as interrupt:
        raise SystemError("returned a result with an exception set") from interrupt


def test_an_interrupted_loop_is_an_interrupt():
    with pytest.raises(KeyboardInterrupt):
        hmrf_icp.register(*synthetic.pair(), on_iteration=compiled_loop_interrupted)


def test_an_interrupt_that_was_wrapped_twice_is_one():
    def wrapped_again(_):
        try:
            compiled_loop_interrupted(_)
        except SystemError as inner:
            raise SystemError("returned a result with an exception set") from inner

    with pytest.raises(KeyboardInterrupt):
        hmrf_icp.register(*synthetic.pair(), on_iteration=wrapped_again)


def test_another_system_error_stays_one():
    def broken(_):
        raise SystemError("of another kind")

    with pytest.raises(SystemError, match="another kind"):
        hmrf_icp.register(*synthetic.pair(), on_iteration=broken)


def swallowed(monkeypatch):
    """Ctrl-C within a callback from C, as when Numba loads a kernel: Python only prints it."""
    printed = []
    monkeypatch.setattr(sys, "unraisablehook", printed.append)

    @ctypes.CFUNCTYPE(None)
    def callback():
        signal.raise_signal(signal.SIGINT)
        for _ in range(1000):
            pass

    return callback, printed


def test_an_interrupt_that_a_callback_swallows_is_one_in_the_end(monkeypatch):
    callback, printed = swallowed(monkeypatch)
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        hmrf_icp.register(*synthetic.pair(), on_iteration=lambda _: callback())
    assert printed[0].exc_type is KeyboardInterrupt
    assert signal.getsignal(signal.SIGINT) is before


def test_an_interrupt_before_an_error_comes_first(monkeypatch):
    callback, _ = swallowed(monkeypatch)

    def broken(_):
        callback()
        raise ValueError("what is left of an interrupted import")

    with pytest.raises(KeyboardInterrupt) as raised:
        hmrf_icp.register(*synthetic.pair(), on_iteration=broken)
    assert isinstance(raised.value.__cause__, ValueError)


def test_whoever_deals_with_the_signal_himself_gets_his_result(monkeypatch):
    callback, printed = swallowed(monkeypatch)
    heard = []
    before = signal.signal(signal.SIGINT, lambda *_: heard.append(1))
    try:
        result = hmrf_icp.register(*synthetic.pair(), on_iteration=lambda _: callback())
    finally:
        signal.signal(signal.SIGINT, before)
    assert result.iterations > 0
    assert heard
    assert not printed


def test_another_thread_registers_as_well():
    with ThreadPoolExecutor(1) as pool:
        result = pool.submit(hmrf_icp.register, *synthetic.pair()).result()
    assert result == hmrf_icp.register(*synthetic.pair())


def test_the_command_line_says_that_it_was_interrupted(tmp_path, monkeypatch):
    source, target = synthetic.pair()
    for name, points in (("a.npy", source), ("b.npy", target)):
        np.save(tmp_path / name, points)
    output = tmp_path / "moved.ply"
    monkeypatch.setattr(
        hmrf_icp, "register", lambda *given, **named: compiled_loop_interrupted(None)
    )
    ran = CliRunner().invoke(
        cli.app,
        ["register", str(tmp_path / "a.npy"), str(tmp_path / "b.npy"), "--output", str(output)],
    )
    assert ran.exit_code == 130
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.npy", "b.npy"]


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timers here")
def test_wherever_it_falls_the_same_clouds_register_alike_afterwards():
    source, target = (hmrf_icp.prepare(points) for points in synthetic.pair())
    expected = hmrf_icp.register(*synthetic.pair()).transformation

    def interrupt(*_):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        for milliseconds in (0.5, 1, 2, 4, 8, 16, 32):
            try:
                signal.setitimer(signal.ITIMER_REAL, milliseconds / 1000.0)
                hmrf_icp.register(source, target)
            except KeyboardInterrupt:
                pass
            finally:
                signal.setitimer(signal.ITIMER_REAL, 0.0)
        found = hmrf_icp.register(source, target).transformation
    finally:
        signal.signal(signal.SIGALRM, before)
    np.testing.assert_array_equal(found, expected)
