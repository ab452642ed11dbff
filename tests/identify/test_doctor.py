"""The doctor: good records get no error, real ones what is wrong with them; what is left out, and the command line."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import numpy as np
import pytest

import stickslip
from stickslip import Controller, Model, Record, Reference, RigidAxis, place, simulate
from stickslip.cli import main
from stickslip.core.errors import InputError
from stickslip.identification.doctor import ERRORS, examine
from stickslip.readers import Drive, read
from stickslip.readers.cut import Cut, cut
from support.doctor_logs import (
    BARE,
    DEG,
    GOOD,
    HEADER,
    INERTIA,
    UNITS,
    made,
    put,
    turned,
    with_,
    write,
)
from support.places import DATA, needs_data


@pytest.mark.parametrize("name", GOOD)
def test_good_records_have_no_errors(name, tmp_path):
    good = made(name)
    diagnosis = examine(read(write(tmp_path / "a.csv", good, HEADER)))
    assert diagnosis.errors == ()
    assert diagnosis.warnings == ()
    diagnosis.raise_for_errors()
    assert len(diagnosis.record) == good["time"].size
    # Without units there is one more warning, and still no error.
    bare = examine(read(write(tmp_path / "b.csv", good, BARE)))
    assert bare.errors == ()
    assert "assumed-unit" in {f.code for f in bare.warnings}


def test_a_log_with_a_velocity_and_no_position_is_looked_at_as_far_as_it_goes(tmp_path, capsys):
    table = turned()
    path = tmp_path / "log.csv"
    data = np.column_stack([table["time"], 60.0 / (2.0 * np.pi) * table["velocity"], table["torque"]])
    np.savetxt(path, data, delimiter=",", header="time_s,speed_rpm,torque_Nm", comments="")
    assert main(["doctor", str(path)]) == 0
    assert "0 errors" in capsys.readouterr().out


def test_simulated_records_with_events_have_no_errors():
    axis = RigidAxis(INERTIA, Model("coulomb", fc=0.2, sigma2=0.01))
    record = simulate(
        axis,
        Controller(place("PD", INERTIA, 20.0, 1.0)),
        Reference("sine", amplitude=8.0, frequency=0.5),
        4.0,
    )
    diagnosis = examine(record)
    assert diagnosis.errors == ()
    assert "duplicate-time" not in {f.code for f in diagnosis.findings}
    assert len(diagnosis.record) == len(record)


def test_an_axis_that_turns_round_at_the_end_of_a_revolution_has_no_spikes():
    """Where it crosses zero and comes back at once, the counter jumps there and back."""
    t = np.arange(0.0, 8.0, 1e-3)
    v = 20.0 * np.sin(2.0 * np.pi * 0.3 * t)
    torque = 0.2 * np.tanh(v / 0.05) + 1e-3 * np.gradient(v, t)
    channels = {"position": (np.cumsum(v) * 1e-3) % (2.0 * np.pi), "motor_torque": torque}
    said = examine(Record(t, channels, {"position": "rad", "motor_torque": "N·m"})).findings
    assert [f.code for f in said] == ["position-wrap"]


def test_what_only_follows_from_a_wrap_or_a_coarse_clock_is_not_said_beside_it():
    """The work of friction was negative for the jumps alone; a velocity did not fit the rows that were left."""
    t = np.arange(0.0, 8.0, 1e-3)
    v = 1.5 * np.cos(1.1 * t)
    q = np.cumsum(v) * 1e-3
    torque = 1e-3 * np.gradient(v, t) + 0.2 * np.tanh(v / 0.01)
    units = {"position": "rad", "velocity": "rad/s", "motor_torque": "N·m"}
    channels = {"velocity": v, "motor_torque": torque}
    wrapped = examine(
        Record(t, {**channels, "position": (3.0 * q) % (2.0 * np.pi), "velocity": 3.0 * v}, units)
    )
    assert [f.code for f in wrapped.errors] == ["position-wrap"]
    assert not {f.code for f in wrapped.findings} & {
        "torque-sign",
        "offset",
        "gravity",
        "less-than-a-revolution",
    }
    coarse = examine(
        Record(np.floor(t / 4e-3) * 4e-3, {**channels, "position": q, "velocity": 1.4 * v}, units)
    )
    assert [f.code for f in coarse.errors] == ["duplicate-time"]
    accepted = examine(
        Record(np.floor(t / 4e-3) * 4e-3, {**channels, "position": q, "velocity": 1.4 * v}, units),
        accept=["duplicate-time"],
    )
    assert [f.code for f in accepted.errors] == ["velocity-mismatch"]


# ---- real data ----------------------------------------------------------------------------------------------

REAL: list[tuple[str, list[str], set[str]]] = [
    ("emps/DATA_EMPS.mat",
     ["position=qm:m", "position_reference=qg:m", "torque=vir:35.15065188248547N"], {"assumed-unit"}),
    ("tribometer/tribometer.txt", [], {"torque-sign", "irregular-sampling"}),
    ("tribometer/tribometer.txt", ["friction=Friction [uN]:-uN"], {"irregular-sampling"}),
    ("xl330_pendulum/kp100_sin_sin.json", [], {"missing-column", "assumed-unit"}),
    ("xl330_pendulum/kp800_lift_and_drop.json", [], {"missing-column", "assumed-unit"}),
    ("double_pendulum/20220812-055640-PM_measured.csv", [],
     {"ambiguous-column", "assumed-unit", "irregular-sampling", "gravity"}),
]  # fmt: skip


@pytest.mark.parametrize(
    ("file", "mapping", "warned"),
    [
        pytest.param(*case, marks=needs_data(case[0]), id=f"{case[0].split('/')[0]} {len(case[1])}")
        for case in REAL
    ],
)
def test_real_records(file, mapping, warned):
    diagnosis = examine(read(DATA / file, mapping))
    assert diagnosis.errors == ()
    assert {f.code for f in diagnosis.warnings} == warned


@needs_data("tribometer")
def test_the_tribometers_labels_are_right():
    """Its description says 5 N and +-0.114 mm: "uN" and "mm" as labelled give just that."""
    record = read(DATA / "tribometer" / "tribometer.txt")
    assert record.units == {"position": "m", "friction_torque": "N", "load": "N"}
    assert np.median(record["load"]) == pytest.approx(5.0, rel=0.01)
    assert np.ptp(record["position"]) == pytest.approx(2 * 0.114e-3, rel=0.1)


# ---- what is left out, and the command line ------------------------------------------------------------------


def test_trimming_is_listed():
    table = made("turned")
    spoiled = put(table["position"], [4, 5, 6, 99], np.nan)
    record = Record(table["time"], {"position": spoiled, "motor_torque": table["torque"]}, UNITS)
    diagnosis = examine(record)
    assert len(diagnosis.record) == len(record) - 4
    assert np.isfinite(diagnosis.record["position"]).all()
    (finding,) = [f for f in diagnosis.findings if f.code == "trimmed"]
    assert "5:7, 100" in finding.message
    assert diagnosis.record.meta["trimmed"] == "5:7, 100"


def test_raise_for_errors_names_the_first():
    table = made("turned")
    record = Record(table["time"], {"position": table["position"], "motor_torque": -table["torque"]},
                    {"position": "rad", "motor_torque": "N·m"})  # fmt: skip
    with pytest.raises(
        InputError, match=r'log.csv: friction would drive the axis.*map={"motor_torque": "motor_torque:-N·m"}'
    ):
        examine(record).raise_for_errors("log.csv")


def test_the_remedy_of_a_turned_current_works(tmp_path):
    """The torque has no column of its own then: the remedy names the current's."""
    table = made("turned")
    log = write(
        tmp_path / "a.csv", with_(table, torque=-20.0 * table["torque"]), HEADER | {"torque": "I_q [A]"}
    )
    drive = Drive(torque_constant=0.05)
    (finding,) = examine(read(log, drive=drive)).errors
    (said,) = re.findall(r'map=\{"current": "(.*?)"\}', finding.remedy)
    assert said == "I_q [A]:-A"
    assert examine(read(log, {"current": said}, drive=drive)).errors == ()


def test_a_slow_speed_can_be_asked_for():
    table = made("turned")
    record = Record(
        table["time"],
        {"position": table["position"], "motor_torque": table["torque"]},
        {"position": "rad", "motor_torque": "N·m"},
    )
    assert "no-slow-motion" in {f.code for f in examine(record, stribeck_velocity=1e-4).findings}
    assert "no-slow-motion" not in {f.code for f in examine(record, stribeck_velocity=1.0).findings}


def test_the_mapping_is_kept_for_the_next_file(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("STICKSLIP_CONFIG", str(tmp_path / "config"))
    table = made("turned")
    names = {"time": "t", "position": "a1", "velocity": "b1", "torque": "c1"}
    log = write(
        tmp_path / "a.csv",
        with_(table, position=table["position"] * DEG, torque=table["torque"] * 1e3),
        names,
    )
    mapping = ["position=a1:deg", "velocity=b1:rad/s", "torque=c1:mNm", "time=t:s"]
    assert main(["doctor", str(log), *(x for m in mapping for x in ("--map", m))]) == 0
    out = capsys.readouterr().out
    assert "profile written" in out
    assert "0 errors, 0 warnings" in out
    other = write(
        tmp_path / "b.csv",
        with_(table, position=table["position"] * DEG, torque=table["torque"] * 1e3),
        names,
    )
    assert main(["doctor", str(other)]) == 0
    assert "profile: " in capsys.readouterr().out
    # A profile in a file of one's own, and what is said now comes first.
    mine = tmp_path / "mine.toml"
    assert (
        main(
            [
                "doctor",
                str(log),
                "--profile",
                str(mine),
                "--map",
                "torque=c1:uNm",
                "--map",
                "position=a1:deg",
                "--map",
                "time=t:s",
            ]
        )
        == 0
    )
    assert read(other, profile=mine)["motor_torque"] == pytest.approx(table["torque"] * 1e-3)
    assert read(other, ["torque=c1:Nm"], profile=mine)["motor_torque"] == pytest.approx(table["torque"] * 1e3)


def test_errors_stop_with_exit_code_2(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("STICKSLIP_CONFIG", str(tmp_path / "config"))
    table = made("turned")
    log = write(tmp_path / "a.csv", with_(table, velocity=-table["velocity"]), HEADER)
    assert main(["doctor", str(log)]) == 2
    assert "velocity-sign" in capsys.readouterr().out
    for argv, said in (
        (["--map", "postion=x"], "'position'"),
        (["--map", "position=x"], "no column 'x'"),
        (["--map", "position"], "must be CHANNEL"),
        (["--map", "position=position [rad]:Nm"], "unit of torque"),
        (["--gear-ratio", "0"], "--gear-ratio 0"),
        (["--profile", str(tmp_path)], "cannot be read"),
        (["--sample-time", "-1"], "--sample-time -1"),
        (["--stribeck-velocity", "0"], "greater than 0"),
    ):
        assert main(["doctor", str(log), *argv]) == 2
        error = capsys.readouterr().err
        assert said in error
        assert error.count("\n") == 1


def one_way(load: float, seed: int = 0) -> Record:
    """An axis that turns one way but for a short return, speed-controlled, so that torque falls with the speed."""
    t = np.arange(0.0, 10.0, 1e-3)
    v = 6.0 + 0.5 * np.sin(2.0 * np.pi * 0.3 * t) + 2.0 * np.sin(2.0 * np.pi * t)
    v[(t > 4.0) & (t < 4.02)] = -1.0
    v = np.convolve(v, np.ones(9) / 9.0, "same")
    noise = 0.02 * np.random.default_rng(seed).standard_normal(t.size)
    torque = 0.3 * np.sign(v) + load - 0.02 * (v - 6.0) + noise
    units = {"position": "rad", "motor_torque": "N·m"}
    return Record(t, {"position": np.cumsum(v) * 1e-3, "motor_torque": torque}, units)


@pytest.mark.parametrize("seed", range(4))
def test_one_direction_is_no_turned_sign(seed):
    assert "torque-sign" not in {f.code for f in examine(one_way(0.0, seed)).findings}
    lowered = [f for f in examine(one_way(-2.0, seed)).findings if f.code == "torque-sign"]
    assert [f.level for f in lowered] == ["warning"]
    assert "a load drives it" in lowered[0].message


@pytest.mark.parametrize("seed", range(2))
def test_in_one_direction_no_constant_torque_is_told_from_friction(seed):
    """Half of both was told as the torque's constant part."""
    back = one_way(0.4, seed)
    assert "offset" not in {f.code for f in examine(back).findings}
    forth = cut(back, Cut(end=3.9))
    found = {f.code: f.message for f in examine(forth).findings}
    assert "offset" not in found
    assert "friction cannot be distinguished from a constant torque" in found["no-reversal"]


def test_who_knows_better_says_accept(tmp_path, capsys):
    table = made("turned")
    table["torque"] = -table["torque"]
    path = str(write(tmp_path / "log.csv", table, HEADER))
    assert main(["doctor", path]) == 2
    assert "--accept torque-sign" in capsys.readouterr().out
    assert main(["doctor", path, "--accept", "torque-sign"]) == 0
    assert "warning torque-sign" in capsys.readouterr().out
    for verb in ("doctor", "identify"):
        for code, known in (
            ("torque_sing", "did you mean 'torque-sign'"),
            ("all", "choose from ambiguous-column, "),
        ):
            assert main([verb, path, "--accept", code]) == 2
            complaint = capsys.readouterr().err
            assert f"unknown error of the doctor {code!r}; {known}" in complaint
            assert complaint.count("\n") == 1


def test_every_error_may_be_accepted_by_its_code():
    """The codes beside "error", or beside a level that is chosen, in the source; made of a channel's name: not here."""
    root = Path(stickslip.__file__).parent
    codes = set()
    for file in (*(root / "identification" / "doctor").glob("*.py"), *(root / "readers").glob("*.py")):
        for call in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if (
                isinstance(call, ast.Call)
                and getattr(call.func, "id", "") == "Finding"
                and len(call.args) > 1
            ):
                level, code = call.args[:2]
                if getattr(level, "value", "error") == "error" and isinstance(code, ast.Constant):
                    codes.add(code.value)
    made = {f"{channel}-unit" for channel in ("position", "position-reference", "velocity", "time")}
    assert codes | made == set(ERRORS)
