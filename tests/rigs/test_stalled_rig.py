"""A rig whose calls do not return: the torque is taken away meanwhile, and where that fails its watchdog is named."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable

import numpy as np
import pytest

from stickslip.core.errors import Interrupted, MessageLost
from stickslip.core.record import Record
from stickslip.rigs import loop as looping
from stickslip.rigs.loop import Loop
from stickslip.rigs.rig import Measurement, setpoints
from support.coulomb_rig import CoulombRig


class Stalled(CoulombRig):
    """Real clock; at its 100th sample `exchange` sleeps, after it has applied the torque."""

    def __init__(self, seconds: float, *, closes: bool = True) -> None:
        super().__init__(real=True)
        self._seconds, self._closes = seconds, closes
        self.zero_after = float("inf")
        self.began = 0.0

    def exchange(self, torque: float) -> Measurement:
        if len(self.torques) == 100:
            self.torque, self.began = torque, time.monotonic()
            time.sleep(self._seconds)
        return super().exchange(torque)

    def close(self) -> None:
        if not self._closes and threading.current_thread() is not threading.main_thread():
            time.sleep(20.0)
        if self.began and not self.closed:
            self.zero_after = time.monotonic() - self.began
        super().close()


def run(rig: CoulombRig, path) -> None:
    with Loop(rig, path=path) as loop:
        loop.run(setpoints(2000, torque=0.19))


@pytest.mark.parametrize("seconds", [3.0, 3600.0])
def test_the_torque_is_gone_while_exchange_stalls(seconds, tmp_path):
    rig, begin = Stalled(seconds), time.monotonic()
    with pytest.raises(
        MessageLost, match=r"exchange took .* at a command of 0.19 N·m.* closed meanwhile.*watchdog"
    ):
        run(rig, tmp_path / "run.stream")
    assert rig.zero_after < 1.0
    assert time.monotonic() - begin < 20.0
    assert "answer_time" in Record.load(tmp_path / "run.stream").meta["ended"]
    assert len(rig.torques) == 100, "nothing is sent to a rig that was closed"


def test_off_the_main_thread_as_well(tmp_path, capfd):
    rig, errors = Stalled(2.0), []

    def work() -> None:
        try:
            run(rig, tmp_path / "run.stream")
        except MessageLost as error:
            errors.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert len(errors) == 1
    assert rig.zero_after < 1.0
    assert "exchange took" in capfd.readouterr().err, "reported while it still stalls"


def test_a_rig_that_cannot_be_closed_meanwhile_names_its_watchdog(tmp_path):
    with pytest.raises(MessageLost, match=r"close has not returned either.*within 0.05 s \(its own timer\)"):
        run(Stalled(3600.0, closes=False), tmp_path / "run.stream")


def test_a_little_late_in_every_sample(tmp_path):
    class Slow(CoulombRig):
        def exchange(self, torque: float) -> Measurement:
            time.sleep(6e-3)
            return super().exchange(torque)

    rig = Slow(real=True)
    with pytest.raises(MessageLost, match="behind the clock"):
        run(rig, tmp_path / "run.stream")
    assert len(rig.torques) < 80
    assert rig.torques[-1] == 0.0
    assert np.max(np.abs(np.diff(rig.torques[-20:]))) <= 0.05 * (1 + 1e-9), "it still answers: by the ramp"


def test_a_close_that_does_not_return(tmp_path, monkeypatch):
    class Open(CoulombRig):
        def close(self) -> None:
            time.sleep(3600.0)

    monkeypatch.setattr(looping, "CLOSING", 0.3)
    rig = Open()
    with pytest.raises(MessageLost, match=r"close has not returned .* torque command was zero.* watchdog"):
        run(rig, tmp_path / "run.stream")
    assert rig.torques[-1] == 0.0
    assert Record.load(tmp_path / "run.stream").meta["complete"] is True


# ---- signals in each phase -----------------------------------------------------------------------------------------


def soon(act: Callable[[], None]) -> None:
    timer = threading.Timer(0.2, act)
    timer.daemon = True
    timer.start()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_the_rig_opens(number, tmp_path):
    """No torque acts: it need not wait for a rig that may never open."""

    class Opening(CoulombRig):
        def open(self) -> Measurement:
            soon(lambda: os.kill(os.getpid(), number))
            time.sleep(3600.0)
            return super().open()

    rig = Opening()
    with pytest.raises(Interrupted, match=number.name):
        run(rig, tmp_path / "run.stream")
    assert rig.closed
    assert not rig.torques
    assert list(tmp_path.iterdir()) == []


def test_the_second_signal_while_the_rig_closes(tmp_path):
    class Closing(CoulombRig):
        heard = 0

        def close(self) -> None:
            soon(lambda: os.kill(os.getpid(), signal.SIGINT))
            time.sleep(0.4)
            Closing.heard += 1
            soon(lambda: os.kill(os.getpid(), signal.SIGINT))
            time.sleep(3600.0)

    with pytest.raises(Interrupted, match="SIGINT"):
        run(Closing(), tmp_path / "run.stream")
    assert Closing.heard == 1, "the first lets it finish"


def test_one_interrupt_after_the_other_does_not_break_the_ramp(tmp_path):
    class Pressed(CoulombRig):
        def exchange(self, torque: float) -> Measurement:
            if len(self.torques) >= 50:
                os.kill(os.getpid(), signal.SIGINT)
            return super().exchange(torque)

    rig = Pressed()
    with pytest.raises(Interrupted, match="SIGINT"):
        run(rig, tmp_path / "run.stream")
    assert rig.torques[-1] == 0.0
    assert np.max(np.abs(np.diff(rig.torques[50:]))) <= 0.05 * (1 + 1e-9)
