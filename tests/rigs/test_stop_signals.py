"""Signals end a loop by its ramp, whatever thread it runs in; what cannot be heard is left to the drive's watchdog."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from test_loop import sine

from stickslip.control.controller import Controller
from stickslip.control.linear import pd
from stickslip.core.errors import Interrupted
from stickslip.core.record import Record
from stickslip.rigs.loop import Loop
from stickslip.rigs.rig import Measurement, setpoints
from support.axis_rig import LIMITS, AxisRig

PD = Controller(pd(19.7612, 0.1747), torque_limit=0.95)
NAMES = [
    "SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGTSTP", "SIGUSR1", "SIGALRM", "SIGXCPU", "SIGTTIN", "SIGTTOU",
    "SIGSTKFLT", "SIGRTMIN", "SIGRTMAX",
]  # fmt: skip


class Signalled(AxisRig):
    def __init__(self, number: int, at: int) -> None:
        super().__init__(blocks=False)
        self._number, self._at = number, at

    def exchange(self, torque: float) -> Measurement:
        if len(self.torques) == self._at:
            os.kill(os.getpid(), self._number)
        return super().exchange(torque)


def ramped(torques: list[float]) -> None:
    """The last torques fall to zero within the declared time."""
    samples = round(LIMITS.stop_time / 1e-3)
    last = np.array(torques[-samples - 1 :])
    assert last[-1] == 0.0
    assert np.max(np.abs(last)) > 0.0
    assert np.all(np.abs(np.diff(last)) <= LIMITS.torque / samples * (1 + 1e-9))


@pytest.mark.parametrize("name", NAMES)
def test_a_signal_in_the_main_thread(name, tmp_path):
    number = getattr(signal, name)
    before = signal.getsignal(number)
    rig = Signalled(number, 100)
    with pytest.raises(Interrupted, match=name), Loop(rig, path=tmp_path / "a.stream") as loop:
        loop.run(sine(600), PD)
    ramped(rig.torques)
    assert Record.load(tmp_path / "a.stream").meta["ended"].startswith(name)
    assert signal.getsignal(number) == before


CHILD = """
    import signal, sys, threading
    sys.path[:0] = [{here!r}, {tests!r}]
    from support.axis_rig import AxisRig
    from test_loop import sine
    from test_stop_signals import PD
    from stickslip.rigs.loop import Loop

    class Told(AxisRig):
        def exchange(self, torque):
            if len(self.torques) == 50:
                print("runs", flush=True)
            return super().exchange(torque)

        def close(self):
            super().close()
            print(*self.torques[-25:], flush=True)

    def work():
        with Loop(Told(blocks=False), path={path!r}, realtime=True) as loop:
            loop.run(sine(60_000), PD)

    {before}
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    {after}
"""


def child(path: Path, before: str = "", after: str = "") -> subprocess.Popen[str]:
    here = str(Path(__file__).parent)
    text = textwrap.dedent(CHILD).format(
        here=here, tests=str(Path(here).parent), path=str(path), before=before, after=after
    )
    return subprocess.Popen(
        [sys.executable, "-c", text], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


@pytest.mark.parametrize("name", ["SIGTERM", "SIGQUIT", "SIGSTKFLT", "SIGRTMIN"])
def test_a_signal_to_a_program_whose_loop_runs_in_another_thread(name, tmp_path):
    process = child(tmp_path / "a.stream")
    assert process.stdout
    assert process.stdout.readline() == "runs\n"
    process.send_signal(getattr(signal, name))
    out, _ = process.communicate(timeout=120)
    ramped([float(x) for x in out.split()])
    # Then the signal goes to whom it would have gone: it ends the program.
    assert process.returncode == -getattr(signal, name)
    record = Record.load(tmp_path / "a.stream")
    assert record.meta["complete"] is True
    assert record.meta["ended"].startswith(name)
    assert record["torque_command"][-1] == 0.0


MAIN = """
    import os, signal, sys
    sys.path.insert(0, {tests!r})
    from support.coulomb_rig import CoulombRig
    from stickslip.core.errors import Interrupted
    from stickslip.rigs.loop import Loop
    from stickslip.rigs.rig import setpoints

    class Told(CoulombRig):
        def exchange(self, torque):
            if len(self.torques) == 50:
                print("runs", flush=True)
            return super().exchange(torque)

    for _ in range({count}):
        rig = Told(real=True)
        try:
            with Loop(rig) as loop:
                loop.run(setpoints(60_000, torque=0.1))
        except Interrupted as error:
            print(rig.torques[-1], rig.closed, error, flush=True)
"""
LEFT = {"SIGKILL", "SIGSTOP", "SIGSEGV", "SIGBUS", "SIGILL", "SIGFPE"}
"""Cannot be heard: docs/howto/loop.md names the drive's watchdog."""
HARMLESS = {"SIGCHLD", "SIGCONT", "SIGURG", "SIGWINCH", "SIGPIPE", "SIGXFSZ"}
"""Ignored by the system or by Python"""


def test_every_signal_that_would_end_or_halt_the_process_ends_the_run():
    numbers = sorted(n for n in signal.valid_signals() if getattr(n, "name", "") not in LEFT | HARMLESS)
    assert {signal.SIGTTIN, signal.SIGTTOU, signal.SIGRTMIN, signal.SIGRTMAX, signal.SIGABRT} <= set(numbers)
    text = textwrap.dedent(MAIN).format(tests=str(Path(__file__).parents[1]), count=len(numbers))
    process = subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE, text=True)
    assert process.stdout
    for number in numbers:
        assert process.stdout.readline() == "runs\n", number
        process.send_signal(number)
        said = process.stdout.readline()
        assert said.startswith("0.0 1 SIG"), number
        assert said.endswith("requested the end\n")
    assert process.wait(timeout=60) == 0


def test_a_handler_of_the_program_is_called_after_the_ramp(tmp_path):
    """One of Python's own, which only the main thread runs."""
    path = tmp_path / "a.stream"
    load = f"__import__('stickslip').Record.load({str(path)!r})"
    note = f"lambda *_: print('heard', {load}.meta['complete'])"
    process = child(path, f"signal.signal(signal.SIGTERM, {note})", "print('goes on')")
    assert process.stdout
    assert process.stdout.readline() == "runs\n"
    process.send_signal(signal.SIGTERM)
    out, _ = process.communicate(timeout=120)
    torques, *rest = out.splitlines()
    ramped([float(x) for x in torques.split()])
    assert rest == ["heard True", "goes on"]
    assert process.returncode == 0
    assert Record.load(path).meta["ended"].startswith("SIGTERM")


def test_two_loops_in_two_threads_hear_one_signal(tmp_path):
    """The one that ends first must not give the signals back; the last one sends it once more."""
    heard: list[int] = []
    rigs = [AxisRig(blocks=False) for _ in range(2)]
    errors: list[BaseException] = []
    started = threading.Barrier(3)

    def work(rig: AxisRig, longer: float) -> None:
        try:
            with Loop(rig, realtime=True) as loop:
                started.wait()
                # Below break-away: the axis stays within its limits until a busy machine sends the signal.
                loop.run(setpoints(60_000, torque=0.1))
        except Interrupted as error:
            time.sleep(longer)
            errors.append(error)

    before = signal.signal(signal.SIGTERM, lambda number, _: heard.append(number))
    try:
        threads = [threading.Thread(target=work, args=(rig, 0.05 * i)) for i, rig in enumerate(rigs)]
        for thread in threads:
            thread.start()
        started.wait()
        time.sleep(0.03)
        os.kill(os.getpid(), signal.SIGTERM)
        for thread in threads:
            thread.join()
    finally:
        signal.signal(signal.SIGTERM, before)
    assert len(errors) == 2
    assert heard == [signal.SIGTERM]
    for rig in rigs:
        assert rig.torques[-1] == 0.0


def test_what_the_program_ignores_or_uses_is_left_to_it():
    """`nohup` ignores SIGHUP; a program may use SIGUSR1."""
    used: list[int] = []
    hup = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    usr = signal.signal(signal.SIGUSR1, lambda number, _: used.append(number))
    try:
        for number in (signal.SIGHUP, signal.SIGUSR1):
            with Loop(Signalled(number, 20)) as loop:
                assert len(loop.run(sine(100), PD)) == 100
    finally:
        signal.signal(signal.SIGHUP, hup)
        signal.signal(signal.SIGUSR1, usr)
    assert used == [signal.SIGUSR1]
