"""Answers of a rig that cannot be true end the run with their cause and no torque; true ones never do."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from stickslip.control.controller import Controller
from stickslip.control.linear import pd, pid
from stickslip.core.errors import InputError, LimitCrossed, MeasurementFault, RigError
from stickslip.core.record import Record
from stickslip.core.stream import Stream
from stickslip.core.stream_file import rows_since
from stickslip.rigs.files import read_rig
from stickslip.rigs.loop import Loop
from stickslip.rigs.rig import Limits, Measurement, setpoints
from support.coulomb_rig import LIMITS, CoulombRig

PD = Controller(pd(20.0, 0.2), torque_limit=0.95)
AT = 200


def sine(count: int, amplitude: float = 0.5):
    t = 1e-3 * np.arange(count)
    w = 2.0 * np.pi
    return setpoints(
        count, position=amplitude * np.sin(w * t), velocity=amplitude * w * np.cos(w * t), closed=1.0
    )


def frozen(keep: tuple[str, ...]):
    """From a sample on the old measurement is repeated, but for these fields."""
    kept: list[Measurement] = []

    def change(measured: Measurement, k: int) -> Measurement:
        if k < AT:
            return measured
        kept[:] = kept if k > AT else [measured]
        return kept[0]._replace(**{name: getattr(measured, name) for name in keep})

    return change


def clock(at):
    return lambda measured, k: measured._replace(time=at(measured.time, k))


def from_there(value):
    return lambda measured, k: value(measured) if k >= AT else measured


FAULTS = {
    "everything repeated": (frozen(()), "its time changes by 0 s in one sample"),
    "all but the time": (frozen(("time",)), "no reading has changed|position has not changed"),
    "the position": (frozen(("time", "torque", "sensor")), "position has not changed for 0.1 s .* which must move"),
    "clock stands": (clock(lambda t, k: min(t, 1e-3 * AT)), "its time changes by 0 s"),
    "clock steps back": (clock(lambda t, k: t - 0.1 * (k >= AT)), "its time changes by -0.099 s"),
    "clock jumps ahead": (clock(lambda t, k: t + 3600.0 * (k >= AT)), "its time changes by 3600 s"),
    "clock is not a number": (clock(lambda t, k: math.nan if k >= AT else t), "its time changes by nan s"),
    "clock is infinite": (clock(lambda t, k: math.inf if k >= AT else t), "its time changes by inf s .* at t = 0.2"),
    "clock is huge": (clock(lambda t, k: 1e300 if k >= AT else t), "its time changes by 1e.300 s .* at t = 0.2"),
    "clock twice as fast": (clock(lambda t, k: 2.0 * t), "its time changes by 0.002 s"),
    "clock half as fast": (clock(lambda t, k: 0.5 * t), "its time changes by 0.0005 s"),
    "measured torque inverted": (from_there(lambda y: y._replace(torque=-y.torque)), "does not follow the command"),
    "measured torque lost": (from_there(lambda y: y._replace(torque=math.nan)), "motor torque has been NaN for 0.1 s"),
    "sensor lost": (from_there(lambda y: y._replace(sensor=math.nan)), "the torque sensor has been NaN for 0.1 s"),
    "measured torque zero": (from_there(lambda y: y._replace(torque=0.0)), "does not follow the command"),
    "sensor inverted": (from_there(lambda y: y._replace(sensor=-y.sensor)), "against the torque with which"),
    "sensor frozen": (frozen(("time", "position", "torque")), "the torque sensor reads .* check whether"),
    "a turn too far": (from_there(lambda y: y._replace(position=y.position + 2 * math.pi)), "speed = "),
}  # fmt: skip


def ended(rig: CoulombRig, cause: str, path, run) -> None:
    with pytest.raises((MeasurementFault, LimitCrossed), match=cause), Loop(rig, path=path) as loop:
        run(loop)
    assert rig.torques[-1] == 0.0
    assert rig.closed
    steps = np.abs(np.diff(rig.torques[-21:]))
    assert np.all(steps <= LIMITS.torque / 20 * (1 + 1e-9))
    record = Record.load(path)
    assert len(record) == len(rig.torques), "every row can be read back"
    assert record.meta["ended"] != "as planned"


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_while_it_follows_a_sine(name, tmp_path):
    change, cause = FAULTS[name]
    rig = CoulombRig(change)
    ended(rig, cause, tmp_path / "run.stream", lambda loop: loop.run(sine(5000), PD))
    assert len(rig.torques) < AT + 2000


def test_a_limit_that_is_crossed_names_its_possible_cause(tmp_path):
    """Three times the torque, and an encoder that counts backwards, drive the axis to its speed limit at once."""
    rig = CoulombRig(acts=lambda torque: 3.0 * torque)
    ended(
        rig, "speed = .*the measured torque did not follow", tmp_path / "a.stream",
        lambda loop: loop.run(setpoints(5000, torque=0.25)),
    )  # fmt: skip
    backwards = CoulombRig(lambda y, _: y._replace(position=-y.position))
    ended(
        backwards,
        "speed = .*accelerated against the torque",
        tmp_path / "b.stream",
        lambda loop: loop.run(sine(5000), PD),
    )
    fast = CoulombRig(friction=0.05)
    ended(fast, "speed = [^;]*; the torque was ramped to zero$", tmp_path / "c.stream",
          lambda loop: loop.run(setpoints(5000, torque=0.9)))  # fmt: skip


@pytest.mark.parametrize(
    "error", [SystemExit(3), KeyboardInterrupt(), MemoryError(), GeneratorExit(), OSError("cable")]
)
@pytest.mark.parametrize("call", ["open", "exchange", "close"])
def test_whatever_a_call_of_the_rig_raises_is_its_error(call, error, tmp_path):
    """Also what would end the process without a word."""

    class Raising(CoulombRig):
        def fail(self, name: str, failing: bool = True) -> None:
            if name == call and failing:
                raise error

        def open(self) -> Measurement:
            self.fail("open")
            return super().open()

        def exchange(self, torque: float) -> Measurement:
            measured = super().exchange(torque)
            self.fail("exchange", len(self.torques) == AT)
            return measured

        def close(self) -> None:
            super().close()
            self.fail("close")

    rig = Raising()
    cause = f"coulomb: {call} raised {type(error).__name__}"
    with pytest.raises(RigError, match=cause), Loop(rig, path=tmp_path / "a.stream") as loop:
        loop.run(setpoints(2 * AT, torque=0.25))
    assert rig.closed
    assert not rig.torques or rig.torques[-1] == 0.0
    if call != "open":
        assert cause in Record.load(tmp_path / "a.stream").meta["ended"]


def test_a_rig_that_does_not_close_is_reported_after_a_limit():
    class Stuck(CoulombRig):
        def close(self) -> None:
            raise OSError("cable")

    with (
        pytest.raises(LimitCrossed, match=r"speed = .*; coulomb: close raised OSError: cable"),
        Loop(Stuck()) as loop,
    ):
        loop.run(setpoints(5000, torque=0.9))


def test_a_time_that_is_no_number_at_the_start():
    class Timeless(CoulombRig):
        def open(self) -> Measurement:
            return super().open()._replace(time=math.inf)

    with pytest.raises(MeasurementFault, match="open gave the time inf s"), Loop(Timeless()):
        pass


def test_torques_that_are_read_now_and_then_are_no_fault():
    """A slow sensor reads NaN between its readings."""
    rig = CoulombRig(lambda y, k: y if k % 50 == 0 else y._replace(torque=math.nan, sensor=math.nan))
    with Loop(rig) as loop:
        assert len(loop.run(sine(2000), PD)) == 2000


@pytest.mark.parametrize("name", ["everything repeated", "all but the time", "the position", "clock stands"])
def test_a_fault_while_a_constant_torque_drives_it(name, tmp_path):
    """0.25 N·m against 0.2 N·m of friction; the readings say that the axis stopped dead."""
    change, _ = FAULTS[name]
    rig = CoulombRig(change)
    ended(
        rig,
        "has not changed|its time",
        tmp_path / "run.stream",
        lambda loop: loop.run(setpoints(5000, torque=0.25)),
    )
    assert len(rig.torques) < AT + 150


def test_a_torque_command_that_is_ignored(tmp_path):
    """The drive measures no torque, or the axis stays where it is."""
    rig = CoulombRig(acts=lambda torque: 0.0)
    ended(rig, "does not follow", tmp_path / "a.stream", lambda loop: loop.run(setpoints(5000, torque=0.19)))
    assert len(rig.torques) < 300
    blocked = CoulombRig(friction=2.0)
    ended(
        blocked, "has not changed", tmp_path / "b.stream", lambda loop: loop.run(setpoints(5000, torque=0.85))
    )


@pytest.mark.parametrize("counts", [200.0, 4000.0, 1e6])
@pytest.mark.parametrize("friction", [0.2, 0.6])
def test_an_axis_at_rest_is_no_fault(counts, friction):
    """Its readings stay the same for seconds, whatever torque below the break-away torque is applied."""
    rig = CoulombRig(counts=counts, friction=friction)
    t = 1e-3 * np.arange(4000)
    ramp = 0.98 * friction * np.minimum(1.0, t)
    noise = 0.9 * np.random.default_rng(1).choice([-1.0, 1.0], 4000)
    with Loop(rig) as loop:
        for torque in (0.0, ramp, -ramp, ramp * np.sin(20.0 * t), noise):
            assert len(loop.run(setpoints(4000, torque=torque))) == 4000
            loop.pause(1.0)
        loop.run(setpoints(2000, closed=1.0), Controller(pid(20.0, 50.0, 0.2), torque_limit=0.95))


@pytest.mark.parametrize("counts", [200.0, 4000.0, 1e6])
def test_an_axis_that_sticks_and_slips_is_no_fault(counts):
    """Breaks away, slides, coasts and stops, fast and slowly."""
    rig = CoulombRig(counts=counts, limits=replace(LIMITS, speed=60.0))
    t = 1e-3 * np.arange(6000)
    with Loop(rig) as loop:
        loop.run(setpoints(6000, torque=0.25 * np.sign(np.sin(9.0 * t))))
        loop.run(setpoints(6000, torque=0.21 * (np.mod(t, 0.2) < 0.15)))
        rig.position = 0.0
        loop.pause(1.0)
        loop.run(sine(6000), PD)
        loop.run(setpoints(6000, position=0.02 * t, velocity=0.02, closed=1.0), PD)
        loop.run(setpoints(6000, position=0.12 + 0.05 * np.sin(20.0 * t), closed=1.0), PD)


def test_an_uneven_clock_is_no_fault():
    """A host's clock: a late sample is followed by an early one, and some are missed."""
    rng = np.random.default_rng(2)

    def change(measured: Measurement, k: int) -> Measurement:
        return measured._replace(time=measured.time + 0.4e-3 * rng.random() + 0.05 * (k // 97))

    with Loop(CoulombRig(change)) as loop:
        assert len(loop.run(sine(2000), PD)) == 2000


def test_a_rig_without_a_measured_torque():
    rig = CoulombRig(lambda y, _: y._replace(torque=math.nan, sensor=math.nan))
    with Loop(rig) as loop:
        assert len(loop.run(sine(1000), PD)) == 1000


def test_limits_of_the_answers_are_set_in_the_file(tmp_path):
    (tmp_path / "rig.toml").write_text('[rig]\nkind = "virtual"\nmachine = "ideal"\n')
    assert read_rig(tmp_path / "rig.toml").limits.answer_time == 0.1
    assert LIMITS.standstill_torque == pytest.approx(0.8)
    # A lower torque limit lowers no break-away torque.
    assert replace(LIMITS, torque=0.3).standstill_torque == pytest.approx(0.8)
    early = CoulombRig(
        frozen(("time", "torque")), limits=replace(LIMITS, standstill_torque=0.3, answer_time=0.02)
    )
    with pytest.raises(MeasurementFault, match=r"for 0.02 s .*answer_time"), Loop(early) as loop:
        loop.run(sine(5000), PD)
    with pytest.raises(InputError, match="answer_time = 1 is wider"):
        LIMITS.narrowed(replace(LIMITS, answer_time=1.0))
    for bad in ({"answer_time": 0.0}, {"answer_time": math.nan}, {"standstill_torque": -1.0}):
        with pytest.raises(InputError, match=next(iter(bad))):
            Limits(torque=1.0, speed=1.0, **bad)


def test_a_clock_that_goes_back_in_a_pause():
    class Back(CoulombRig):
        def pause(self, seconds: float) -> Measurement:
            self.time -= 1.0
            return self.measured()

    def work(loop: Loop) -> None:
        loop.run(setpoints(2000, torque=0.1))
        loop.pause(1.0)

    rig = Back()
    with pytest.raises(MeasurementFault, match="during a pause"), Loop(rig) as loop:
        work(loop)
    assert rig.torques[-1] == 0.0


def test_a_pause_that_fails_is_in_the_record(tmp_path):
    class Deaf(CoulombRig):
        def pause(self, seconds: float) -> Measurement:
            raise OSError("cable")

    def work(loop: Loop) -> None:
        loop.run(setpoints(50, torque=0.1))
        loop.pause(1.0)

    rig = Deaf()
    with (
        pytest.raises(RigError, match="pause raised OSError: cable"),
        Loop(rig, path=tmp_path / "a.stream") as loop,
    ):
        work(loop)
    assert "cable" in Record.load(tmp_path / "a.stream").meta["ended"]
    assert rig.torques[-1] == 0.0


def test_what_goes_wrong_while_the_torque_is_taken_away_is_reported(tmp_path):
    """Nothing is wrong until the loop is left."""
    rig = CoulombRig(lambda y, k: y._replace(status=5.0) if k == 105 else y)
    with pytest.raises(RigError, match="fault 0x0005"), Loop(rig, path=tmp_path / "a.stream") as loop:
        loop.run(setpoints(100, torque=0.5))
    assert "0x0005" in Record.load(tmp_path / "a.stream").meta["ended"]

    def refuse(measured: Measurement, k: int) -> Measurement:
        if k > 100:
            raise OSError("cable")
        return measured

    rig = CoulombRig(refuse)
    with (
        pytest.raises(
            RigError, match=r"cable.* has not answered .* watchdog .* within 0.05 s \(its own timer\)"
        ),
        Loop(rig) as loop,
    ):
        loop.run(setpoints(100, torque=0.5))
    assert rig.closed


# ---- records whose times do not increase ---------------------------------------------------------------------------


def stream(path, time):
    kept = Stream({"time": "s", "position": "rad"}, path)
    for t in time:
        kept.room(1)[0] = (t, 0.5)
        kept.commit()
    kept.close()
    return path


def test_a_stream_whose_time_steps_back_names_the_row(tmp_path):
    t = 1e-3 * np.arange(300.0)
    t[190:] -= 0.05
    with pytest.raises(InputError, match=r"time goes from 0.189 to 0.14 s after row 190 of 300"):
        Record.load(stream(tmp_path / "a.stream", t))


@pytest.mark.parametrize(("row", "value"), [(0, -math.inf), (299, math.inf), (150, math.nan)])
def test_a_stream_with_a_time_that_is_no_number_is_refused(row, value, tmp_path):
    t = 1e-3 * np.arange(300.0)
    t[row] = value
    with pytest.raises(InputError, match=f"{value}.* and must increase"):
        Record.load(stream(tmp_path / "a.stream", t))


@pytest.mark.parametrize("place", [8, 16, 24, 32])
def test_sizes_in_a_damaged_stream_reserve_no_memory(place, tmp_path):
    """Its header says how many rows and bytes follow: more than any memory."""
    path = stream(tmp_path / "a.stream", 1e-3 * np.arange(300.0))
    data = bytearray(path.read_bytes())
    data[place : place + 8] = (1 << 50).to_bytes(8, "little")
    path.write_bytes(data)
    for read in (Record.load, lambda p: rows_since(p, 0)):
        try:
            read(path)
        except InputError as error:
            assert "a.stream is no" in str(error)  # noqa: PT017


def test_a_sample_time_of_years_is_refused():
    rig = CoulombRig()
    rig.sample_time = 1e300
    with pytest.raises(InputError, match=r"sample_time = 1e.300 s must be a number from 1e-07 to 100000"):
        Loop(rig)
