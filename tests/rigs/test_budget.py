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

from stickslip.errors import InputError, Overrun
from stickslip.rigs.loop import Loop
from stickslip.rigs.rig import Measurement
from support.axis_rig import LIMITS, AxisRig

SAMPLES = round(LIMITS.stop_time / 1e-3)


class Clocked(AxisRig):
    """Remembers when it was given which torque."""

    def __init__(self) -> None:
        super().__init__(blocks=False)
        self.times: list[float] = []

    def exchange(self, torque: float) -> Measurement:
        self.times.append(time.monotonic())
        return super().exchange(torque)

    def held(self) -> float:
        """The longest time for which a torque other than zero stood, s."""
        gaps = [b - a for a, b, torque in zip(self.times, self.times[1:], self.torques) if torque != 0.0]
        return max(gaps)


def slow(after: int, seconds: float):
    calls = 0

    def controller(y, w) -> float:
        nonlocal calls
        calls += 1
        if calls > after:
            time.sleep(seconds)
        return 0.3

    return controller


def stopped(rig: Clocked) -> None:
    last = np.array(rig.torques[-SAMPLES - 1 :])
    assert rig.torques[-1] == 0.0
    assert 0.3 in rig.torques
    assert np.all(np.abs(np.diff(last)) <= LIMITS.torque / SAMPLES * (1 + 1e-9))
    assert not rig.open_now


def test_half_a_second_a_sample():
    """The torque is gone while the controller still computes."""
    rig = Clocked()
    with pytest.raises(Overrun, match="budget of 100 ms"), Loop(rig, realtime=True) as loop:
        loop.run(sine(2000), slow(50, 0.5))
    stopped(rig)
    assert rig.held() < 0.4
    assert len(rig.torques) < 100


def test_a_little_late_in_every_sample():
    rig = Clocked()
    with pytest.raises(Overrun, match="behind the clock"), Loop(rig, realtime=True) as loop:
        loop.run(sine(2000), slow(10, 6e-3))
    stopped(rig)
    assert len(rig.torques) < 60


def test_a_controller_that_never_comes_back_can_be_interrupted():
    """Its torque is ramped down, and then Ctrl-C is heard again."""
    rig = Clocked()

    def controller(y, w) -> float:
        while len(rig.torques) > 30:
            pass
        return 0.3

    def interrupt() -> None:
        while not rig.torques or rig.torques[-1] != 0.0 or len(rig.torques) < 31:
            time.sleep(0.01)
        time.sleep(0.05)
        os.kill(os.getpid(), signal.SIGINT)

    before = signal.getsignal(signal.SIGINT)
    helper = threading.Thread(target=interrupt)
    helper.start()
    with pytest.raises(Overrun), Loop(rig, realtime=True) as loop:
        loop.run(sine(2000), controller)
    helper.join()
    stopped(rig)
    assert signal.getsignal(signal.SIGINT) is before


def test_a_pause_within_the_budget_does_no_harm():
    rig, calls = Clocked(), 0

    def controller(y, w) -> float:
        nonlocal calls
        calls += 1
        # The first call compiles, with no torque standing; later ones may be late now and then.
        if calls in (1, 20):
            time.sleep(0.4 / calls)
        return 0.1

    with Loop(rig, realtime=True) as loop:
        assert len(loop.run(sine(60), controller)) == 60


def test_nothing_is_late_where_no_clock_runs():
    with Loop(Clocked()) as loop:
        assert len(loop.run(sine(12), slow(2, 0.02))) == 12
    with pytest.raises(InputError, match="budget = -1"):
        Loop(Clocked(), budget=-1.0)
    with Loop(Clocked(), realtime=True, budget=math.inf) as loop:
        assert len(loop.run(sine(3), slow(1, 0.15))) == 3
