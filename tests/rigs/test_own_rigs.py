"""Rigs of users that raise, answer nonsense or declare nonsense, at each place: one line that names rig and place."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from test_loop import sine

from stickslip import cli
from stickslip.control.controller import Controller
from stickslip.control.linear import pd
from stickslip.core.errors import InputError, RigError
from stickslip.core.record import Record
from stickslip.rigs.loop import Loop
from stickslip.rigs.procedures.base import perform
from stickslip.rigs.procedures.presliding import Presliding
from stickslip.rigs.procedures.sliding import Sliding
from stickslip.rigs.replay import Replay
from stickslip.rigs.rig import setpoints
from support.axis_rig import LIMITS, AxisRig

PD = Controller(pd(19.7612, 0.1747), torque_limit=0.95)


def broken(place: str, value: object) -> AxisRig:
    """The axis, of which one place gives the value, or raises it; methods from their third call on."""

    def method(self, *arguments):
        self.calls = getattr(self, "calls", 0) + 1
        if place == "exchange" and self.calls < 30:
            return AxisRig.exchange(self, *arguments)
        if isinstance(value, Exception):
            raise value
        return value

    found = method if place in ("open", "exchange", "pause", "close") else property(lambda self: method(self))
    return type("Mine", (AxisRig,), {place: found})(blocks=False)


def run(rig: AxisRig) -> None:
    with Loop(rig) as loop:
        loop.run(sine(60), PD)
        loop.pause(0.1)


@pytest.mark.parametrize("place", ["name", "sample_time", "limits", "capabilities"])
@pytest.mark.parametrize("value", [ZeroDivisionError("mine"), None, "0.001", math.nan, 1e-15, -1.0])
def test_what_a_rig_says_of_itself(place, value):
    if place == "name" and value == "0.001":
        return
    with pytest.raises(InputError, match=place):
        run(broken(place, value))


@pytest.mark.parametrize("place", ["open", "exchange", "pause"])
@pytest.mark.parametrize(
    "value", [KeyError("mine"), None, 0.0, (0.0,), (0.0, 0.0), ("a", 0, 0, 0, 0, 0), [1.0] * 7]
)
def test_what_a_rig_answers(place, value):
    rig = broken(place, value)
    with pytest.raises(RigError):
        run(rig)
    assert not rig.torques or rig.torques[-1] == 0.0 or place == "exchange"
    assert not rig.open_now


@pytest.mark.parametrize(
    "value", [None, 0.5, np.zeros(6), (1.0, 2.0)], ids=["none", "number", "array", "pair"]
)
def test_an_answer_that_is_no_measurement_is_named(value):
    rig = AxisRig(blocks=False)
    usual = rig.exchange
    rig.exchange = lambda torque: value if len(rig.torques) == 20 else usual(torque)  # type: ignore[method-assign]
    with pytest.raises(RigError, match=r"exchange gave .*; it must give a Measurement"), Loop(rig) as loop:
        loop.run(setpoints(100, torque=0.1))


def test_a_rig_that_cannot_be_closed(tmp_path):
    rig = broken("close", OSError("cable"))
    with pytest.raises(RigError, match="close raised OSError: cable"):
        run(rig)
    with pytest.raises(RigError, match="ZeroDivisionError"), Loop(rig, path=tmp_path / "a.stream") as loop:
        loop.run(sine(60), lambda y, w: 1 / 0)
    assert Record.load(tmp_path / "a.stream").meta["complete"] is True


def test_a_procedure_reports_a_rig_that_cannot_be_closed():
    with pytest.raises(RigError, match="close raised OSError: cable"):
        perform(Presliding(frequency=5.0, amplitude=0.1), broken("close", OSError("cable")))


MINE = """
from stickslip.rigs.files import limits_in
from stickslip.rigs.virtual import virtual_rig
from stickslip.rigs.rig import RigKind
{before}
def build(table):
    {build}
RIG = {rig}
"""


@pytest.mark.parametrize(
    ("before", "build", "rig", "said"),
    [
        ("1 / 0", "pass", "None", "ZeroDivisionError"),
        ("", "pass", "None", "no rig"),
        ("", "pass", "3", "no `RigKind"),
        ("", "1 / 0", "RigKind('mine', build, '')", "build raised ZeroDivisionError"),
        ("", "return None", "RigKind('mine', build, '')", "name raised"),
        ("def", "", "", "SyntaxError"),
    ],
)
def test_a_file_of_a_rig(before, build, rig, said, tmp_path, capsys):
    (tmp_path / "mine.py").write_text(MINE.format(before=before, build=build, rig=rig))
    file = tmp_path / "mine.toml"
    file.write_text('[rig]\nkind = "mine.py"\n[rig.limits]\ntorque = 1.0\nspeed = 9.0\n')
    code = cli.main(
        ["rig", "run", "presliding", "--rig", str(file), "--allow-code", "--out", str(tmp_path / "a.npz")]
    )
    error = capsys.readouterr().err
    assert code == 2
    first, last = error.splitlines()
    assert "runs" in first  # the file's code, which was allowed
    assert said in last


# ---- what is asked of a rig --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "option", "said"),
    [
        ("presliding", "frequency=1e-9", "days"),
        ("presliding", "frequency=0", "frequency = 0"),
        ("presliding", "frequency=1e-300", "days"),
        ("presliding", "cycles=1e-9", "no row was recorded"),
        ("breakaway", "rate=1e-9", "days"),
        ("breakaway", "rate=1e-320", "days"),
        ("breakaway", "interval=1e-9", "days"),
        ("sliding", "velocities=1e-9", "days"),
        ("sliding", "velocities=0", "velocities"),
        ("sliding", "degrees=1e300", "days"),
        ("sliding", "bandwidth=1e300", "bandwidth = 1e+300"),
        ("inertia", "duration=1e9", "days"),
        ("track", "duration=1e9", "memory"),
        ("repeat", "interval=1e300", "days"),
        ("stickslip", "average=" + 26 * "9", "no row was recorded"),
    ],
)
def test_a_size_beyond_memory_or_patience_is_told_before(name, option, said, tmp_path, capsys):
    out = tmp_path / "a.npz"
    code = cli.main(["rig", "run", name, "--rig", "ideal", "--set", option, "--out", str(out)])
    error = capsys.readouterr().err
    assert code == 2
    assert said in error
    assert error.count("\n") == 1
    assert not out.exists()


def test_memory_is_told_with_its_numbers(monkeypatch):
    monkeypatch.setattr("stickslip.core.resources.free_memory", lambda: 2e7)
    with pytest.raises(InputError, match=r"1.51e\+05 samples at once need .* of memory, 20 MB are free"):
        perform(Presliding(frequency=0.02), AxisRig())
    # One velocity after the other is in memory: a long run of many fits.
    Sliding(velocities=(2.0,) * 200, degrees=90.0).plan(AxisRig()).within(AxisRig())


@pytest.mark.parametrize("content", [b"", b"my notes", b"PK\x03\x04 of another program"])
def test_a_file_that_is_not_ours_is_kept(content, tmp_path, capsys):
    out = tmp_path / "keep.npz"
    out.write_bytes(content)
    call = ["rig", "run", "presliding", "--rig", "ideal", "--set", "frequency=5", "--out", str(out)]
    assert cli.main(call) == 2
    assert "--force" in capsys.readouterr().err
    assert out.read_bytes() == content
    assert cli.main([*call, "--force"]) in (0, 1)
    assert len(Record.load(out)) > 0
    # What it wrote itself it writes again.
    assert cli.main(call) in (0, 1)


def test_record_and_stream_are_two_files(tmp_path, capsys):
    out = str(tmp_path / "a.npz")
    assert cli.main(["rig", "run", "presliding", "--rig", "ideal", "--out", out, "--stream", out]) == 2
    assert "--stream" in capsys.readouterr().err
    assert not Path(out).exists()


# ---- replayed records ----------------------------------------------------------------------------------------

T = 1e-3 * np.arange(200.0)
TIMES = {
    "backwards": -T,
    "standing": 0.0 * T,
    "one step back": np.where(np.arange(200) == 50, T - 0.1, T),
    "twice": np.where(np.arange(200) == 50, T - 1e-3, T),
    "not a number": np.where(np.arange(200) == 50, math.nan, T),
    "infinite": np.where(np.arange(200) == 199, math.inf, T),
    "too dense": 1e-12 * T,
    "jittering, then far away": np.where(np.arange(200) > 100, T + 1e12, T + 2e-4 * (np.arange(200) % 2)),
}


def recorded(time: np.ndarray) -> Record:
    return Record(time, {"position": np.sin(T)}, {"position": "rad"})


@pytest.mark.parametrize("name", TIMES)
def test_times_of_a_replayed_record(name):
    with pytest.raises(InputError, match="replay: "):
        Replay(recorded(TIMES[name]))


@pytest.mark.parametrize("sample_time", [1e-15, 0.0, -1e-3, math.nan, math.inf, 1e-320])
def test_sample_time_of_a_replay(sample_time):
    with pytest.raises(InputError, match="sample_time"):
        Replay(recorded(T), sample_time=sample_time)


def test_a_jump_in_time_is_a_pause():
    rig = Replay(recorded(np.where(np.arange(200) > 100, T + 1e6, T)))
    with pytest.raises(RigError, match="ended"), Loop(rig) as loop:
        loop.run(setpoints(300))
    assert rig.sample_time == pytest.approx(1e-3)
    assert LIMITS.torque == 1.0
