"""A controller in Python that takes too long stops the loop within its budget, even where it never comes back."""

from __future__ import annotations

import math
import os
import signal
import threading
import time

import numpy as np
import pytest
from test_loop import sine

from stickslip.core.errors import InputError, Overrun
from stickslip.rigs.loop import Loop
from support.axis_rig import LIMITS, AxisRig

SAMPLES = round(LIMITS.stop_time / 1e-3)


def slow(after: int, seconds: float):
    calls = 0

    def controller(y, w) -> float:
        nonlocal calls
        calls += 1
        if calls > after:
            time.sleep(seconds)
        return 0.3

    return controller


def stopped(rig: AxisRig) -> None:
    last = np.array(rig.torques[-SAMPLES - 1 :])
    assert rig.torques[-1] == 0.0
    assert 0.3 in rig.torques
    assert np.all(np.abs(np.diff(last)) <= LIMITS.torque / SAMPLES * (1 + 1e-9))
    assert not rig.open_now


def test_the_torque_is_gone_while_the_controller_still_computes():
    rig, seen, calls = AxisRig(blocks=False), [], 0

    def controller(y, w) -> float:
        nonlocal calls
        calls += 1
        until = time.monotonic() + 60.0
        while calls > 50 and rig.torques[-1] != 0.0 and time.monotonic() < until:
            time.sleep(0.01)
        seen.append(calls > 50 and rig.torques[-1] == 0.0)
        return 0.3

    with pytest.raises(Overrun, match="budget of 100 ms"), Loop(rig, realtime=True) as loop:
        loop.run(sine(2000), controller)
    stopped(rig)
    assert seen[-1]
    assert len(rig.torques) < 100


def test_a_little_late_in_every_sample():
    rig = AxisRig(blocks=False)
    with pytest.raises(Overrun, match="behind the clock"), Loop(rig, realtime=True) as loop:
        loop.run(sine(2000), slow(10, 6e-3))
    stopped(rig)
    assert len(rig.torques) < 60


def test_a_controller_that_never_comes_back_can_be_interrupted():
    """Its torque is ramped down, and then Ctrl-C is heard again."""
    rig, stuck, heard = AxisRig(blocks=False), threading.Event(), threading.Event()

    def controller(y, w) -> float:
        try:
            while len(rig.torques) > 30:
                stuck.set()
        except KeyboardInterrupt:
            heard.set()
            raise
        return 0.3

    def interrupt() -> None:
        assert stuck.wait(60.0)
        while rig.torques[-1] != 0.0:
            time.sleep(0.01)
        # The first may come while the loop still holds the signals.
        while not heard.wait(2.0):
            os.kill(os.getpid(), signal.SIGINT)

    # Python hears no Ctrl-C where whoever started the tests ignores it (`nohup ... &`).
    before, outer = signal.default_int_handler, signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, before)
    other = threading.Thread(target=interrupt)
    other.start()
    # A greater budget: a machine that stands still must not stop the loop before the controller does.
    with pytest.raises(Overrun), Loop(rig, realtime=True, budget=1.0) as loop:
        loop.run(sine(2000), controller)
    other.join()
    stopped(rig)
    assert signal.getsignal(signal.SIGINT) is before
    signal.signal(signal.SIGINT, outer)


def test_a_pause_within_the_budget_does_no_harm():
    rig, calls = AxisRig(blocks=False), 0

    def controller(y, w) -> float:
        nonlocal calls
        calls += 1
        # The first call compiles, with no torque standing, which the budget does not count.
        if calls in (1, 20):
            time.sleep(4.0 / calls)
        return 0.1

    with Loop(rig, realtime=True, budget=3.0) as loop:
        assert len(loop.run(sine(60), controller)) == 60


def test_nothing_is_late_where_no_clock_runs():
    with Loop(AxisRig()) as loop:
        assert len(loop.run(sine(12), slow(2, 0.02))) == 12
    with pytest.raises(InputError, match="budget = -1"):
        Loop(AxisRig(), budget=-1.0)
    with Loop(AxisRig(), realtime=True, budget=math.inf) as loop:
        assert len(loop.run(sine(3), slow(1, 0.15))) == 3
