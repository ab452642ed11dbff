"""The loop on an axis: segments, blocks, records, stops."""

from __future__ import annotations

import os
import signal
import time
from dataclasses import replace

import numpy as np
import pytest

from stickslip.control.compensator import Feedback, Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import pd, pid
from stickslip.core.errors import InputError, Interrupted, LimitCrossed, RigError
from stickslip.core.record import Record
from stickslip.readers import read
from stickslip.rigs.loop import Loop
from stickslip.rigs.loop_sample import COLUMNS
from stickslip.rigs.narrower_limits import limited
from stickslip.rigs.rig import Limits, Measurement, Setpoint, setpoints
from support.axis_rig import FRICTION, LIMITS, AxisRig

PD = Controller(pd(19.7612, 0.1747), Feedforward(FRICTION), torque_limit=1.0)
PID = Controller(pid(59.28, 4469.9, 0.2621), torque_limit=1.0)
HOLDER = Controller(pid(30.0, 2000.0, 0.15), torque_limit=0.9)
COMMAND, T = COLUMNS.index("torque_command"), 1e-3


def sine(count: int, amplitude: float = 0.5, hz: float = 1.0, offset: float = 0.0):
    t = 1e-3 * np.arange(count)
    w = 2 * np.pi * hz
    return setpoints(
        count, position=offset + amplitude * np.sin(w * t), velocity=amplitude * w * np.cos(w * t), closed=1.0
    )


def campaign(loop: Loop) -> None:
    """Open loop, two controllers, a pause, an early end."""
    loop.run(setpoints(300, torque=0.4 * np.sin(0.02 * np.arange(300))))
    position = loop.record()["position"][-1]
    loop.run(sine(700, offset=position), PD)
    loop.pause(60.0)
    loop.run(setpoints(400, torque=np.linspace(0.0, 0.6, 400)), travel=0.2)
    position = loop.record()["position"][-1]
    loop.run(setpoints(200, position=position, closed=1.0), PID)


def test_blocks_and_samples_give_the_same_record(tmp_path):
    records = []
    for blocks in (True, False):
        rig = AxisRig(blocks=blocks)
        with Loop(rig, path=tmp_path / f"{blocks}.stream") as loop:
            campaign(loop)
        records.append(Record.load(tmp_path / f"{blocks}.stream"))
        assert not rig.open_now
    a, b = records
    assert len(a) > 1400
    assert np.array_equal(a.time, b.time)
    for name in a.channels:
        assert np.array_equal(a[name], b[name]), name
    assert np.isclose(np.diff(a.time).max(), 60.0, atol=0.1), "the pause advanced the clock"
    assert a.meta["complete"] is True
    assert a.meta["ended"] == "as planned"
    assert a.units["motor_torque"] == "N·m"


@pytest.mark.parametrize("blocks", [True, False])
@pytest.mark.parametrize("controller", [PD, PID, Controller(pd(5.0, 0.05), Feedback(FRICTION), 1.0)])
def test_the_torque_does_not_jump_where_a_controller_takes_over(blocks, controller):
    """From a torque that drives the axis, from another controller, and after a pause; 5 mrad beside the reference."""
    with Loop(AxisRig(blocks=blocks)) as loop:
        rows = loop.run(setpoints(200, torque=np.minimum(np.linspace(0.0, 0.6, 200), 0.2)))
        for other in (controller, HOLDER, controller):
            position, speed = (rows[-1, COLUMNS.index(n)] for n in ("position", "velocity"))
            last = rows[-1, COMMAND]
            beside = setpoints(
                300, position=position + 5e-3 + speed * T * np.arange(300), velocity=speed, closed=1.0
            )
            rows = loop.run(beside, other)
            assert rows[0, COMMAND] == pytest.approx(last, abs=1e-12)
        loop.pause(0.5)
        rows = loop.run(
            setpoints(100, position=rows[-1, COLUMNS.index("position")] + 5e-3, closed=1.0), controller
        )
        assert rows[0, COMMAND] == 0.0


def test_the_loop_tracks(tmp_path):
    with Loop(AxisRig()) as loop:
        rows = loop.run(sine(3000), PD)
    error = rows[1000:, COLUMNS.index("position_reference")] - rows[1000:, COLUMNS.index("position")]
    assert np.sqrt(np.mean(error**2)) < 2e-3


def test_a_record_is_read_as_any_log(tmp_path):
    with Loop(AxisRig(), path=tmp_path / "run.stream", meta={"operator": "A. Name"}) as loop:
        loop.run(sine(500), PD)
    record = read(tmp_path / "run.stream")
    own = Record.load(tmp_path / "run.stream")
    for name in ("position", "motor_torque", "position_reference"):
        assert np.array_equal(record[name], own[name])
    assert own.meta["operator"] == "A. Name"
    assert own.meta["loop"]["samples"] == 0 or own.meta["loop"]["missed"] == 0


def test_a_python_controller_runs_under_the_same_safety():
    def bang(y: Measurement, w: Setpoint) -> float:
        return 0.6 if w.position > y.position else -0.6

    with Loop(AxisRig()) as loop:
        rows = loop.run(sine(500), bang)
    assert set(np.abs(rows[:, COLUMNS.index("torque_command")])) == {0.6}
    with pytest.raises(LimitCrossed, match=r"torque = .* beyond its limit 1"), Loop(AxisRig()) as loop:
        loop.run(sine(500), lambda y, w: 3.0 * bang(y, w))


def test_a_stopped_loop_stays_stopped():
    with Loop(AxisRig()) as loop:
        with pytest.raises(LimitCrossed):
            loop.run(setpoints(10, torque=2.0))
        with pytest.raises(LimitCrossed):
            loop.run(setpoints(10, torque=0.1))


def test_leaving_the_loop_ramps_the_torque_down():
    rig = AxisRig()
    with Loop(rig) as loop:
        loop.run(setpoints(50, torque=0.8))
    tail = np.array(rig.torques[50:])
    assert tail[-1] == 0.0
    assert len(tail) * 1e-3 <= LIMITS.stop_time
    assert np.all(np.diff([0.8, *tail]) < 0)


def test_an_exception_outside_the_loop_ramps_the_torque_down():
    rig = AxisRig()

    def work(loop: Loop) -> None:
        loop.run(setpoints(50, torque=0.8))
        _ = 1 / 0

    with pytest.raises(ZeroDivisionError), Loop(rig) as loop:
        work(loop)
    assert rig.torques[-1] == 0.0
    assert not rig.open_now


class Signalled(AxisRig):
    """The axis; a signal comes at its 300th sample, however busy the machine is."""

    def __init__(self, number: int, *, blocks: bool) -> None:
        super().__init__(blocks=blocks)
        self._number, self._sent = number, False

    def exchange(self, torque: float):
        measured = super().exchange(torque)
        self._signal()
        return measured

    def exchange_block(self, control, setpoints, rows):
        count = super().exchange_block(control, setpoints, rows)
        self._signal()
        return count

    def _signal(self) -> None:
        if len(self.torques) >= 300 and not self._sent:
            self._sent = True
            os.kill(os.getpid(), self._number)


@pytest.mark.parametrize("blocks", [True, False])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_run_by_its_ramp(blocks, number, tmp_path):
    rig = Signalled(number, blocks=blocks)
    before = signal.getsignal(number)
    with pytest.raises(Interrupted, match=number.name), Loop(rig, path=tmp_path / "run.stream") as loop:
        loop.run(sine(20_000), PD)
    assert 300 <= len(rig.torques) < 1000
    assert rig.torques[-1] == 0.0
    assert not rig.open_now
    assert signal.getsignal(number) == before
    assert len(Record.load(tmp_path / "run.stream")) == len(rig.torques)


def test_a_signal_between_two_runs_is_not_lost(tmp_path):
    def work(loop: Loop) -> None:
        loop.run(setpoints(50, torque=0.3))
        os.kill(os.getpid(), signal.SIGTERM)

    rig = AxisRig()
    with pytest.raises(Interrupted, match="SIGTERM"), Loop(rig, path=tmp_path / "run.stream") as loop:
        work(loop)
    assert rig.torques[-1] == 0.0
    assert Record.load(tmp_path / "run.stream").meta["ended"] == "SIGTERM requested the end"


@pytest.mark.flaky(reruns=2)  # measures the loop's own time
def test_real_time_is_kept_and_accounted_for(tmp_path):
    with Loop(AxisRig(), realtime=True, path=tmp_path / "run.stream") as loop:
        loop.run(sine(10), PD)
        begin = time.monotonic()
        loop.run(sine(500), PD)
        took = time.monotonic() - begin
        account = loop.account()
    assert took >= 0.499
    assert account.samples >= 510
    assert account.own[0] < 1e-3
    assert len(account.lines()) == 6
    assert 0.0 < account.empty[0] <= account.control[0]
    assert account.faults < 100
    # The samples of the last ramp count as well.
    assert Record.load(tmp_path / "run.stream").meta["loop"]["missed"] == loop.account().missed


def test_what_is_refused():
    with pytest.raises(InputError, match="no watchdog is declared"):
        Loop(AxisRig(watchdog=False))
    with Loop(AxisRig(watchdog=False), without_watchdog=True) as loop:
        loop.run(setpoints(5))
    with pytest.raises(InputError, match=r"speed = 61 is wider than the rig's 60"):
        Loop(AxisRig(), limits=Limits(torque=1.0, speed=61.0))
    with pytest.raises(InputError, match="not armed"):
        Loop(AxisRig()).run(setpoints(5))
    with pytest.raises(InputError, match="give the rig's"), Loop(AxisRig()) as loop:
        loop.run(setpoints(5), Controller(pd(1.0, 0.1), sample_time=2e-3))
    with pytest.raises(InputError, match="shape"), Loop(AxisRig()) as loop:
        loop.run(np.zeros((5, 3)))


def test_a_rig_under_narrower_limits():
    rig = limited(AxisRig(), {"torque": 0.5, "lowest_position": -0.2, "stop_time": 0.01})
    assert rig.limits == replace(LIMITS, torque=0.5, position=(-0.2, 20.0), stop_time=0.01)
    assert rig.machine.name == "ideal"
    with pytest.raises(LimitCrossed, match=r"position = -0.2.* limit -0.2 to 20"), Loop(rig) as loop:
        loop.run(sine(1000), replace(PD, torque_limit=0.45))
    same = AxisRig()
    assert limited(same, {}) is same
    for values, message in (
        ({"torque": 1.5}, "wider than the rig's 1"),
        ({"colour": 1.0}, "no limit 'colour'"),
        ({"speed": -1.0}, "greater than 0"),
        ({"lowest_position": -21.0}, "wider"),
    ):
        with pytest.raises(InputError, match=message):
            limited(AxisRig(), values)


def test_an_existing_record_is_not_overwritten(tmp_path):
    path = tmp_path / "run.stream"
    with Loop(AxisRig(), path=path) as loop:
        loop.run(setpoints(5))
    with pytest.raises(InputError, match="exists; remove it"), Loop(AxisRig(), path=path):
        pass
    assert len(Record.load(path)) == 5


def test_a_rig_that_does_not_open_leaves_nothing_behind(tmp_path):
    class Dead(AxisRig):
        def open(self) -> Measurement:
            raise RigError("axis: no power")

    rig = Dead()
    with pytest.raises(RigError, match="no power"), Loop(rig, path=tmp_path / "run.stream"):
        pass
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("column", Setpoint._fields)
def test_setpoints_that_are_no_numbers_are_refused_before_any_torque(column):
    rig = AxisRig()
    wanted = setpoints(100, torque=0.1)
    wanted[50, Setpoint._fields.index(column)] = np.nan
    with (
        pytest.raises(InputError, match=f"setpoint 50 has {column} = nan, which must be a finite number"),
        Loop(rig) as loop,
    ):
        loop.run(wanted)
    assert not any(rig.torques)


def test_a_clock_that_counts_from_1970_runs_a_controller():
    """Its times are beyond what a position or a torque may be."""

    class Unix(AxisRig):
        def exchange(self, torque: float) -> Measurement:
            found = super().exchange(torque)
            return found._replace(time=1.76e9 + found.time)

        def open(self) -> Measurement:
            found = super().open()
            return found._replace(time=1.76e9 + found.time)

    t = 1e-3 * np.arange(1, 501)
    with Loop(Unix(blocks=False)) as loop:
        wanted = setpoints(500, position=0.1 * t, velocity=0.1, closed=1.0)
        rows = loop.run(wanted, Controller(pd(2.0, 0.05)))
    assert len(rows) == 500
    assert not rows[:, COLUMNS.index("reason")].any()
