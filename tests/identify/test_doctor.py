"""The doctor: good records get no error, spoiled ones the right finding, none a traceback."""

from __future__ import annotations

import ast
import json
import os
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import stickslip
from stickslip import Controller, Model, Record, Reference, RigidAxis, place, simulate
from stickslip.cli import main
from stickslip.errors import InputError
from stickslip.identify.doctor import ERRORS, examine
from stickslip.readers import Drive, read

DATA = Path(os.environ.get("STICKSLIP_DATA", Path(__file__).parents[3] / "shared" / "data"))
INERTIA = 1e-3
Table = dict[str, np.ndarray]


def run(law: str, amplitude: float, frequency: float, duration: float, **parameters: float) -> Table:
    """A closed loop with a friction law, as a log: time, position, velocity, torque."""
    axis = RigidAxis(INERTIA, Model(law, **parameters))
    controller = Controller(place("PD", INERTIA, 20.0, 1.0))
    reference = Reference("sine", amplitude=amplitude, frequency=frequency)
    record = simulate(axis, controller, reference, duration)
    grid = record["event"] == 0.0
    return {"time": record.time[grid], "position": record["position"][grid], "velocity": record["velocity"][grid],
            "torque": record["motor_torque"][grid]}  # fmt: skip


def turned(seed: int = 0) -> Table:
    """Four turns to and fro against Stribeck friction, with an encoder of 2^20 counts and some noise of the torque."""
    time = np.arange(0.0, 8.0, 1e-3)
    rng = np.random.default_rng(seed)
    velocity = 12.0 * np.sin(2 * np.pi * 0.25 * time) * np.abs(np.sin(2 * np.pi * 0.25 * time))
    position = np.cumsum(velocity) * 1e-3
    friction = np.tanh(velocity / 0.01) * (0.28 + 0.1 * np.exp(-np.abs(velocity) / 0.3)) + 0.01 * velocity
    torque = INERTIA * np.gradient(velocity, time) + friction + 2e-3 * rng.standard_normal(time.size)
    count = 2 * np.pi / 2**20
    return {
        "time": time,
        "position": count * np.round(position / count),
        "velocity": velocity,
        "torque": torque,
    }


GOOD: dict[str, Callable[[], Table]] = {
    "turned": turned,
    "lugre": lambda: run(
        "lugre", 8.0, 0.5, 4.0, sigma0=3.5e4, sigma1=0.1, sigma2=0.018, fs=0.335, fc=0.285, vs=0.01
    ),
    "coulomb": lambda: run("coulomb", 5.0, 1.0, 3.0, fc=0.2, sigma2=0.01),
    "stribeck": lambda: run("stribeck", 6.0, 0.4, 5.0, k=500.0, fc=0.2, fs=0.3, vs=0.1, sigma2=0.01),
}
ONCE: dict[str, Table] = {}


def made(name: str) -> Table:
    if name not in ONCE:
        ONCE[name] = GOOD[name]()
    return {k: v.copy() for k, v in ONCE[name].items()}


HEADER = {
    "time": "time [s]",
    "position": "position [rad]",
    "velocity": "velocity [rad/s]",
    "torque": "torque [Nm]",
}
BARE = {"time": "time", "position": "position", "velocity": "velocity", "torque": "torque"}


def write(path: Path, table: Table, names: dict[str, str]) -> Path:
    columns = [(names.get(k, k), v) for k, v in table.items()]
    lines = [",".join(n for n, _ in columns)]
    lines += [",".join(f"{x:.12g}" for x in row) for row in np.stack([v for _, v in columns], axis=1)]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("name", GOOD)
def test_good_records_have_no_errors(name, tmp_path):
    good = made(name)
    diagnosis = examine(read(write(tmp_path / "a.csv", good, HEADER)))
    assert diagnosis.errors == ()
    assert [f.code for f in diagnosis.warnings if f.code != "less-than-a-revolution"] == []
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


# ---- spoiled records: what is done, what must be found ------------------------------------------------------


def rows(table: Table, keep: np.ndarray) -> Table:
    return {k: v[keep] for k, v in table.items()}


def with_(table: Table, **changed: np.ndarray) -> Table:
    return {**table, **changed}


def put(values: np.ndarray, where: object, what: float) -> np.ndarray:
    out = values.copy()
    out[where] = what
    return out


def n(table: Table) -> int:
    return table["time"].size


def every(table: Table, k: int) -> np.ndarray:
    return np.arange(n(table)) % k != 0


def clip(values: np.ndarray, share: float) -> np.ndarray:
    top = share * np.max(np.abs(values))
    return np.clip(values, -top, top)


def delayed(values: np.ndarray, k: int) -> np.ndarray:
    return (
        np.concatenate([np.full(k, values[0]), values[:-k]])
        if k > 0
        else np.concatenate([values[-k:], np.full(-k, values[-1])])
    )


def steps(values: np.ndarray, size: float) -> np.ndarray:
    return size * np.round(values / size)


def moving_up(table: Table) -> Table:
    """Only the rows that move forward, put together to a motion that never reverses."""
    velocity = np.abs(table["velocity"])
    position = np.cumsum(velocity) * np.median(np.diff(table["time"]))
    return with_(
        table, velocity=velocity, position=position, torque=table["torque"] * np.sign(table["velocity"])
    )


def rng() -> np.random.Generator:
    return np.random.default_rng(5)


UNITS = {"position": "rad", "motor_torque": "N·m"}
DEG = 180.0 / np.pi
HELD = dict[str, np.ndarray]
# (what is wrong, how a good table is spoiled, names of the columns, the code that must be found, its level)
SPOILED: list[tuple[str, Callable[[Table], Table], dict[str, str], str, str]] = [
    # Columns
    ("no time", lambda t: {k: v for k, v in t.items() if k != "time"}, HEADER, "refused", "column of times"),
    (
        "no position and velocity",
        lambda t: {k: t[k] for k in ("time", "torque")},
        HEADER,
        "missing-column",
        "error",
    ),
    (
        "no torque",
        lambda t: {k: v for k, v in t.items() if k != "torque"},
        HEADER,
        "missing-column",
        "warning",
    ),
    ("current for torque", lambda t: t, HEADER | {"torque": "I_q [A]"}, "missing-column", "error"),
    (
        "torque in mA",
        lambda t: with_(t, torque=t["torque"] * 2e4),
        HEADER | {"torque": "torque [mA]"},
        "missing-column",
        "error",
    ),
    (
        "two positions",
        lambda t: {**t, "other": t["position"] * 1.1},
        HEADER | {"position": "pos a [rad]", "other": "pos b [rad]"},
        "ambiguous-column",
        "error",
    ),
    (
        "two torques",
        lambda t: {**t, "other": t["torque"]},
        HEADER | {"torque": "torque a", "other": "torque b"},
        "ambiguous-column",
        "error",
    ),
    (
        "several axes",
        lambda t: {**t, "p2": t["position"]},
        HEADER | {"position": "pos1", "p2": "pos2"},
        "ambiguous-column",
        "warning",
    ),
    (
        "nothing is named",
        lambda t: t,
        {"time": "a1x", "position": "b1x", "velocity": "c1x", "torque": "d1x"},
        "refused",
        "no column",
    ),
    (
        "percent without rating",
        lambda t: with_(t, torque=t["torque"] * 50),
        HEADER | {"torque": "torque [%]"},
        "refused",
        "--rated-torque",
    ),
    (
        "counts without resolution",
        lambda t: with_(t, position=np.round(t["position"] * 1000)),
        HEADER | {"position": "position [counts]"},
        "refused",
        "--counts-per-rev",
    ),
    # Missing values
    (
        "NaN in position",
        lambda t: with_(t, position=put(t["position"], slice(100, 110), np.nan)),
        HEADER,
        "nan",
        "warning",
    ),
    ("NaN in torque", lambda t: with_(t, torque=put(t["torque"], 500, np.nan)), HEADER, "nan", "warning"),
    ("NaN in time", lambda t: with_(t, time=put(t["time"], [7, 900], np.nan)), HEADER, "nan", "warning"),
    (
        "infinite velocity",
        lambda t: with_(t, velocity=put(t["velocity"], 50, np.inf)),
        HEADER,
        "nan",
        "warning",
    ),
    (
        "half is NaN",
        lambda t: with_(t, torque=put(t["torque"], slice(0, None, 2), np.nan)),
        HEADER,
        "nan",
        "error",
    ),
    ("everything is NaN", lambda t: with_(t, torque=np.full(n(t), np.nan)), HEADER, "nan", "error"),
    # Time
    (
        "a gap",
        lambda t: rows(t, (np.arange(n(t)) < 1000) | (np.arange(n(t)) > 1100)),
        HEADER,
        "gap",
        "warning",
    ),
    ("many gaps", lambda t: rows(t, np.arange(n(t)) % 500 > 20), HEADER, "gap", "warning"),
    (
        "duplicate times",
        lambda t: with_(t, time=put(t["time"], 200, t["time"][199])),
        HEADER,
        "duplicate-time",
        "warning",
    ),
    (
        "duplicate rows",
        lambda t: {k: np.insert(v, [300, 600], v[[300, 600]]) for k, v in t.items()},
        HEADER,
        "duplicate-time",
        "warning",
    ),
    (
        "coarse clock",
        lambda t: with_(t, time=np.floor(t["time"] * 100) / 100),
        HEADER,
        "duplicate-time",
        "error",
    ),
    (
        "time goes back",
        lambda t: with_(t, time=t["time"] - 0.5 * (t["time"] > 1.5)),
        HEADER,
        "backward-time",
        "error",
    ),
    (
        "two records in one",
        lambda t: {k: np.concatenate([v, v]) for k, v in t.items()},
        HEADER,
        "backward-time",
        "error",
    ),
    ("rows shuffled", lambda t: rows(t, rng().permutation(n(t))), HEADER, "backward-time", "error"),
    (
        "two rows swapped",
        lambda t: rows(t, np.r_[0:700, 701, 700, 702 : n(t)]),
        HEADER,
        "backward-time",
        "error",
    ),
    ("lost samples", lambda t: rows(t, rng().random(n(t)) > 0.2), HEADER, "irregular-sampling", "warning"),
    (
        "jitter of 30 %",
        lambda t: with_(t, time=t["time"] + 3e-4 * rng().random(n(t))),
        HEADER,
        "irregular-sampling",
        "warning",
    ),
    (
        "jitter of 5 %",
        lambda t: with_(t, time=t["time"] + 5e-5 * rng().random(n(t))),
        HEADER,
        "jitter",
        "note",
    ),
    ("ms, no unit", lambda t: with_(t, time=t["time"] * 1e3), BARE, "time-unit", "error"),
    (
        "ms, velocity named",
        lambda t: with_(t, time=t["time"] * 1e3),
        HEADER | {"time": "time"},
        "time-unit",
        "error",
    ),
    ("us, no unit", lambda t: with_(t, time=t["time"] * 1e6), BARE, "time-unit", "error"),
    ("ms called s", lambda t: with_(t, time=t["time"] * 1e3), HEADER, "time-unit", "error"),
    ("s called ms", lambda t: t, HEADER | {"time": "time [ms]"}, "time-unit", "warning"),
    ("too few rows", lambda t: rows(t, np.arange(n(t)) < 12), HEADER, "too-short", "error"),
    # Units
    (
        "degrees called rad",
        lambda t: with_(t, position=t["position"] * DEG),
        HEADER,
        "position-unit",
        "error",
    ),
    ("degrees, no unit", lambda t: with_(t, position=t["position"] * DEG), BARE, "position-unit", "error"),
    (
        "degrees by the encoder",
        lambda t: {
            "time": t["time"],
            "position": steps(t["position"] * DEG, 360 / 2**14),
            "torque": t["torque"],
        },
        BARE,
        "position-unit",
        "error",
    ),
    (
        "turns for rad",
        lambda t: with_(t, position=t["position"] / (2 * np.pi)),
        BARE,
        "position-unit",
        "error",
    ),
    (
        "counts for rad",
        lambda t: with_(t, position=np.round(t["position"] * 65536 / (2 * np.pi))),
        BARE,
        "position-unit",
        "error",
    ),
    (
        "counts, no velocity",
        lambda t: {"time": t["time"], "position": np.round(t["position"] * 1304), "torque": t["torque"]},
        BARE,
        "position-unit",
        "error",
    ),
    (
        "counts called rad",
        lambda t: {"time": t["time"], "position": np.round(t["position"] * 1304), "torque": t["torque"]},
        HEADER,
        "position-unit",
        "warning",
    ),
    (
        "rpm called rad/s",
        lambda t: with_(t, velocity=t["velocity"] * 30 / np.pi),
        HEADER,
        "velocity-unit",
        "error",
    ),
    ("rpm, no unit", lambda t: with_(t, velocity=t["velocity"] * 30 / np.pi), BARE, "velocity-unit", "error"),
    ("deg/s, no unit", lambda t: with_(t, velocity=t["velocity"] * DEG), BARE, "velocity-unit", "error"),
    (
        "rev/s, no unit",
        lambda t: with_(t, velocity=t["velocity"] / (2 * np.pi)),
        BARE,
        "velocity-unit",
        "error",
    ),
    (
        "degrees and rpm",
        lambda t: with_(t, velocity=t["velocity"] * 30 / np.pi, position=t["position"] * DEG),
        BARE,
        "position-unit",
        "error",
    ),
    (
        "velocity behind a gear",
        lambda t: with_(t, velocity=t["velocity"] * 3.7),
        HEADER,
        "velocity-mismatch",
        "error",
    ),
    (
        "velocity of another axis",
        lambda t: with_(t, velocity=np.sin(7.3 * t["time"])),
        HEADER,
        "velocity-mismatch",
        "warning",
    ),
    ("no units at all", lambda t: t, BARE, "assumed-unit", "warning"),
    (
        "per mille for torque",
        lambda t: with_(t, torque=np.round(t["torque"] * 700)),
        BARE,
        "torque-unit",
        "error",
    ),
    (
        "percent for torque",
        lambda t: with_(t, torque=steps(t["torque"] * 90, 0.1)),
        BARE,
        "torque-unit",
        "error",
    ),
    (
        "absurd speed",
        lambda t: with_(t, position=t["position"] * 5e3, velocity=t["velocity"] * 5e3),
        BARE,
        "position-unit",
        "error",
    ),
    # Signs, delays, loads
    ("torque turned", lambda t: with_(t, torque=-t["torque"]), HEADER, "torque-sign", "error"),
    (
        "torque turned, no velocity",
        lambda t: {"time": t["time"], "position": t["position"], "torque": -t["torque"]},
        HEADER,
        "torque-sign",
        "error",
    ),
    (
        "position and velocity turned",
        lambda t: with_(t, position=-t["position"], velocity=-t["velocity"]),
        HEADER,
        "torque-sign",
        "error",
    ),
    ("velocity turned", lambda t: with_(t, velocity=-t["velocity"]), HEADER, "velocity-sign", "error"),
    (
        "torque late by 20 ms",
        lambda t: with_(t, torque=delayed(t["torque"], 20)),
        HEADER,
        "time-skew",
        "warning",
    ),
    (
        "torque early by 15 ms",
        lambda t: with_(t, torque=delayed(t["torque"], -15)),
        HEADER,
        "time-skew",
        "warning",
    ),
    (
        "gravity",
        lambda t: with_(t, torque=t["torque"] + 0.4 * np.sin(t["position"])),
        HEADER,
        "gravity",
        "warning",
    ),
    (
        "gravity from another zero",
        lambda t: with_(t, torque=t["torque"] + 0.3 * np.cos(t["position"] + 0.4)),
        HEADER,
        "gravity",
        "warning",
    ),
    ("a weight", lambda t: with_(t, torque=t["torque"] + 0.2), HEADER, "offset", "note"),
    # Signals
    ("torque limit", lambda t: with_(t, torque=clip(t["torque"], 0.7)), HEADER, "saturation", "warning"),
    (
        "torque limit, one side",
        lambda t: with_(t, torque=np.minimum(t["torque"], 0.75 * t["torque"].max())),
        HEADER,
        "saturation",
        "warning",
    ),
    (
        "velocity limit",
        lambda t: with_(t, velocity=clip(t["velocity"], 0.8)),
        HEADER,
        "saturation",
        "warning",
    ),
    (
        "coarse encoder",
        lambda t: {
            "time": t["time"],
            "position": steps(t["position"], 2 * np.pi / 64),
            "torque": t["torque"],
        },
        HEADER,
        "quantisation",
        "warning",
    ),
    (
        "encoder of 2^14",
        lambda t: with_(t, position=steps(t["position"], 2 * np.pi / 2**14)),
        HEADER,
        "quantisation",
        "note",
    ),
    (
        "angle within a turn",
        lambda t: with_(t, position=np.mod(t["position"], 2 * np.pi)),
        HEADER,
        "position-wrap",
        "error",
    ),
    (
        "degrees within a turn",
        lambda t: with_(t, position=np.mod(t["position"] * DEG, 360.0)),
        HEADER | {"position": "position [deg]"},
        "position-wrap",
        "error",
    ),
    (
        "a jump of the encoder",
        lambda t: with_(t, position=t["position"] + 0.7 * (t["time"] > 1.234)),
        HEADER,
        "position-jump",
        "warning",
    ),
    # Excitation
    (
        "never moved",
        lambda t: with_(t, position=np.full(n(t), 0.3), velocity=np.zeros(n(t))),
        HEADER,
        "never-moved",
        "error",
    ),
    (
        "a flickering count",
        lambda t: with_(t, position=1e-4 * (rng().random(n(t)) > 0.5), velocity=np.zeros(n(t))),
        HEADER,
        "never-moved",
        "error",
    ),
    (
        "only noise",
        lambda t: with_(
            t, position=1e-5 * rng().standard_normal(n(t)), velocity=1e-3 * rng().standard_normal(n(t))
        ),
        HEADER,
        "never-moved",
        "error",
    ),
    ("torque not logged", lambda t: with_(t, torque=np.zeros(n(t))), HEADER, "no-torque", "error"),
    ("no reversal", moving_up, HEADER, "no-reversal", "warning"),
    (
        "less than a turn",
        lambda t: with_(t, position=t["position"] / 20, velocity=t["velocity"] / 20),
        HEADER,
        "less-than-a-revolution",
        "warning",
    ),
]


@pytest.mark.parametrize(("what", "spoil", "names", "code", "level"), SPOILED, ids=[s[0] for s in SPOILED])
@pytest.mark.parametrize("base", ["turned", "lugre"])
def test_spoiled(base, tmp_path, capsys, monkeypatch, what, spoil, names, code, level):
    monkeypatch.setenv("STICKSLIP_CONFIG", str(tmp_path / "config"))
    path = write(tmp_path / "log.csv", spoil(made(base)), names)
    exit_code = main(["doctor", str(path), "--json"])
    streams = capsys.readouterr()
    assert "Traceback" not in streams.err
    if code == "refused":
        assert exit_code == 2
        assert level in streams.err
        assert streams.err.count("\n") == 1
        return
    findings = json.loads(streams.out)["findings"]
    assert (code, level) in {(f["code"], f["level"]) for f in findings}, findings
    assert exit_code == (2 if any(f["level"] == "error" for f in findings) else 0)
    found = next(f for f in findings if f["code"] == code)
    assert found["remedy"] or level == "note"
    assert "\n" not in found["message"]


@pytest.mark.parametrize("counts", [1024, 4096, 65536])
def test_a_coarse_encoder_is_no_delay_of_the_torque(counts):
    """A turning point is known to the time in which the axis moves by a count, no better."""
    slow = run("lugre", 0.5, 0.5, 4.0, sigma0=3.5e4, sigma1=0.1, sigma2=0.018, fs=0.335, fc=0.285, vs=0.01)
    for lag in (0, 2):
        channels = {
            "position": steps(slow["position"], 2 * np.pi / counts),
            "motor_torque": delayed(slow["torque"], lag or 1),
        }
        record = Record(slow["time"], channels, UNITS)
        assert "time-skew" not in {f.code for f in examine(record).findings}


def test_a_delay_is_told_with_a_coarse_encoder_too():
    fast = run("coulomb", 0.3, 2.0, 3.0, fc=0.2, sigma2=0.01)
    channels = {
        "position": steps(fast["position"], 2 * np.pi / 4096),
        "motor_torque": delayed(fast["torque"], 10),
    }
    found = {f.code: f.message for f in examine(Record(fast["time"], channels, UNITS)).findings}
    assert re.search(r"shifted by (9|10|11) ms: torque comes after", found["time-skew"])


@pytest.mark.parametrize("counts", [2**16, 4000])
@pytest.mark.parametrize("unit", ["deg", "rad"])
def test_degrees_under_a_header_that_says_rad_are_doubted(tmp_path, counts, unit):
    table = made("turned")
    table = with_(table, position=steps(table["position"], 2 * np.pi / counts))
    if unit == "deg":
        table = {k: v * DEG if k in ("position", "velocity") else v for k, v in table.items()}
    found = examine(read(write(tmp_path / "a.csv", table, HEADER)))
    doubted = [f for f in found.warnings if f.code == "position-unit"]
    assert len(doubted) == (unit == "deg")
    assert found.errors == ()
    assert all("position=position [rad]:deg" in f.remedy.replace("'", "") for f in doubted)


@pytest.mark.parametrize(
    ("way", "doubted"), [(90.0, True), (2.0 * np.pi, False), (40.0, False), (45.01, False)]
)
def test_a_reference_over_eighths_of_a_turn_in_degrees_is_no_reference_in_rad(way, doubted):
    table = made("lugre")
    shape = table["position"] / np.ptp(table["position"])
    channels = {"position": way * shape, "position_reference": way * shape, "motor_torque": table["torque"]}
    units = {**UNITS, "position_reference": "rad"}
    codes = {f.code for f in examine(Record(table["time"], channels, units)).warnings}
    assert ("position-unit" in codes) == doubted


@pytest.mark.parametrize(
    ("position", "reference", "unit", "found"),
    [
        (DEG, 1.0, "rad", ("position-unit", "position in deg")),
        (1.0, DEG, "rad", ("position-reference-unit", "position_reference in deg")),
        (1e3, 1.0, "m", ("position-unit", "position in mm")),
        (1.0, 1e3, "m", ("position-reference-unit", "position_reference in mm")),
        (10.0, 1.0, "rad", ("reference-scale", "10 times as far")),
        (60.0, 1.0, "rad", ("reference-scale", "60 times as far")),
        (6.0, 1.0, "rad", ("reference-scale", "6 times as far")),
        (1.0, 60.0, "rad", ("reference-scale", "60 times as little")),
        (1.0, 1.0, "rad", None),
        (1.4, 1.0, "rad", None),
        (0.0, 1.0, "rad", None),
    ],
)
def test_a_reference_of_another_size_than_the_position_is_told(position, reference, unit, found):
    table = made("turned")
    late = np.roll(table["position"], 20)
    channels = {"position": position * late + 0.1, "position_reference": reference * table["position"]}
    record = Record(
        table["time"], {**channels, "motor_torque": table["torque"]},
        {"position": unit, "position_reference": unit, "motor_torque": "N·m" if unit == "rad" else "N"},
    )  # fmt: skip
    told = [f for f in examine(record).findings if "follows its reference" in f.message]
    assert len(told) == (found is not None)
    for finding in told:
        assert (finding.level, finding.code) == ("warning", found[0])
        assert found[1] in finding.message


@pytest.mark.parametrize(
    ("unit", "twist"), [("deg", "gravity"), ("rad", "gravity"), ("deg", "spring"), ("rad", "warm")]
)
def test_a_pendulum_in_degrees_under_rad_is_known_by_its_gravity(unit, twist):
    """Without an encoder's step; a spring, or friction that falls while the axis warms up, is none."""
    t = np.arange(0.0, 8.0, 1e-3)
    q = (1.4 if unit == "deg" else 80.0) * np.sin(2.0 * np.pi * 0.5 * t)
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    torque = 1e-3 * a + 0.1 * np.sign(v) * (1.0 - 0.05 * t * (twist == "warm"))
    torque += {"gravity": 0.4 * np.sin(q), "spring": 0.1 * q, "warm": 0.0}[twist]
    size = DEG if unit == "deg" else 1.0
    noise = 1e-3 * rng().standard_normal((2, t.size))
    record = Record(t, {"position": size * (q + 1e-3 * noise[0]), "motor_torque": torque + noise[1]}, UNITS)
    codes = {f.code for f in examine(record).warnings}
    assert ("position-unit" in codes) == (unit == "deg" and twist == "gravity")


# ---- real data ----------------------------------------------------------------------------------------------

REAL: list[tuple[str, list[str], set[str]]] = [
    ("emps/DATA_EMPS.mat",
     ["position=qm:m", "position_reference=qg:m", "torque=vir:35.15065188248547N"], {"assumed-unit"}),
    ("tribometer/tribometer.txt", [], {"torque-sign", "irregular-sampling"}),
    ("tribometer/tribometer.txt", ["friction=Friction [uN]:-uN"], {"irregular-sampling"}),
    ("xl330_pendulum/kp100_sin_sin.json", [], {"missing-column", "assumed-unit", "less-than-a-revolution"}),
    ("xl330_pendulum/kp800_lift_and_drop.json", [], {"missing-column", "assumed-unit", "less-than-a-revolution"}),
    ("double_pendulum/20220812-055640-PM_measured.csv", [],
     {"ambiguous-column", "assumed-unit", "irregular-sampling", "gravity", "less-than-a-revolution"}),
]  # fmt: skip


@pytest.mark.parametrize(
    ("file", "mapping", "warned"), REAL, ids=[f"{f.split('/')[0]} {len(m)}" for f, m, _ in REAL]
)
def test_real_records(file, mapping, warned):
    if not (DATA / file).exists():
        pytest.skip(f"no {DATA / file}; set STICKSLIP_DATA")
    diagnosis = examine(read(DATA / file, mapping))
    assert diagnosis.errors == ()
    assert {f.code for f in diagnosis.warnings} == warned


def test_the_tribometers_labels_are_right():
    """Its description says 5 N and +-0.114 mm: "uN" and "mm" as labelled give just that."""
    if not (DATA / "tribometer").exists():
        pytest.skip(f"no {DATA / 'tribometer'}; set STICKSLIP_DATA")
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
        InputError, match=r"log.csv: friction would drive the axis.*--map 'motor_torque=motor_torque:-N·m'"
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
    (said,) = re.findall(r"--map '(.*?)'", finding.remedy)
    assert said == "current=I_q [A]:-A"
    assert examine(read(log, [said], drive=drive)).errors == ()


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
        (["--gear-ratio", "0"], "gear_ratio = 0"),
        (["--profile", str(tmp_path)], "cannot be read"),
        (["--sample-time", "-1"], "sample_time = -1"),
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
    for file in (*(root / "identify" / "doctor").glob("*.py"), *(root / "readers").glob("*.py")):
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
