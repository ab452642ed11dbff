"""Spoiled records: what was done to them must be found; and what looks alike, but is none."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

import stickslip as ss
from stickslip import Record
from stickslip.cli import main
from stickslip.identification.doctor import examine
from stickslip.identification.doctor.units import _binary_counts
from stickslip.readers import read
from support.doctor_logs import (
    DEG,
    HEADER,
    UNITS,
    delayed,
    made,
    rng,
    run,
    steps,
    with_,
    write,
)
from support.spoiled_logs import SPOILED


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
    assert re.search(r"shifted by (9|10|11) ms \(±1\): torque comes after", found["time-skew"])


UNSEEN = pytest.mark.xfail(
    strict=True, reason="a torque 15 rows early shows neither in sliding nor at reversals here"
)


@pytest.mark.parametrize(("base", "rows"), [
    ("lugre", 20), ("coulomb", 20), ("stribeck", 20), ("coulomb", -15),
    pytest.param("lugre", -15, marks=UNSEEN), pytest.param("stribeck", -15, marks=UNSEEN),
])  # fmt: skip
def test_a_torque_of_another_clock_is_told_with_its_interval(base, rows):
    table = made(base)
    channels = {"position": table["position"], "motor_torque": delayed(table["torque"], rows)}
    found = {f.code: f.message for f in examine(Record(table["time"], channels, UNITS)).findings}
    said = re.search(r"shifted by ([\d.]+) ms \(±([\d.]+)\): (torque|motion) comes", found["time-skew"])
    assert said is not None
    assert abs(float(said[1]) - abs(rows)) <= float(said[2])
    assert said[3] == ("torque" if rows > 0 else "motion")


def test_an_axis_that_stands_at_its_reversals_turns_its_torque_late():
    """Another program's slow sine, which sticks for 0.2 s at every end: "shifted by 26 ms", where it was 0.4 ms."""
    t, stroke, wait, builds_up = np.arange(0.0, 10.0, 1e-3), 1.5, 0.1, 0.056
    after = t % (stroke + wait)
    side = np.where(t // (stroke + wait) % 2.0, -1.0, 1.0)
    v = 0.2 * side * np.sin(np.pi * np.minimum(after / stroke, 1.0))
    turned = (t - stroke) / (stroke + wait)
    ramp = np.clip(2.0 * (turned % 1.0) * (stroke + wait) / (wait + builds_up) - 1.0, -1.0, 1.0)
    torque = 0.07 * np.where(np.floor(turned) % 2.0, 1.0, -1.0) * ramp + 5e-4 * rng().standard_normal(t.size)
    record = Record(t, {"position": np.cumsum(v) * 1e-3, "motor_torque": torque}, UNITS)
    assert "time-skew" not in {f.code for f in examine(record).findings}


def test_reversals_that_friction_rounds_tell_no_delay():
    """Most of the torque is friction without a sharp edge: logs of that kind whose torque is in time look alike."""
    table = made("turned")
    channels = {"position": table["position"], "motor_torque": delayed(table["torque"], 20)}
    assert "time-skew" not in {f.code for f in examine(Record(table["time"], channels, UNITS)).findings}


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
    assert all('map={"position": "position [rad]:deg"}' in f.remedy for f in doubted)


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


@pytest.mark.parametrize(("turn", "unit"), [(360.0, "deg"), (1.0, "rev"), (2.0 * np.pi, "rad")])
@pytest.mark.parametrize(("bits", "digits"), [(12, 6), (16, 6), (17, 7)])
@pytest.mark.parametrize("place", [0.0, 3.0])
def test_the_grid_of_an_encoder_tells_degrees_and_turns_in_a_rounded_file(turn, unit, bits, digits, place):
    """The steps from row to row, which are of rounded numbers, did not tell fine encoders; turns nothing told."""
    t = np.arange(0.0, 6.0, 1e-3)
    count = 2.0 * np.pi / 2**bits
    q = count * np.round((place + 2.0 * np.sin(3.1 * t)) / count)
    torque = 0.3 * np.tanh(np.gradient(q, t) / 0.01)
    columns = {"time": t, "position [rad]": np.round(q * turn / (2.0 * np.pi), digits), "torque [Nm]": torque}
    found = [f for f in ss.doctor(columns).findings if f.code == "position-unit"]
    assert len(found) == (unit != "rad")
    for finding in found:
        assert finding.level == "warning"
        assert f"{2**bits} counts" in finding.message
        assert f'"position": "position [rad]:{unit}"' in finding.remedy


def test_no_grid_of_degrees_or_turns_is_seen_in_positions_in_rad():
    """Of any encoder and gear, rounded or not, and stored as floats of 32 bits."""
    rng, t = np.random.default_rng(0), np.arange(0.0, 6.0, 1e-3)
    for _ in range(200):
        counts = rng.choice([500, 2000, 4096, 10000, 65536, 2**20, int(rng.integers(300, 10**6))])
        count = 2.0 * np.pi / (counts * rng.choice([1.0, 5.0, 100.0, 0.1]))
        way = 10 ** rng.uniform(-1.5, 1.8) * np.sin(rng.uniform(0.5, 20.0) * t) + rng.uniform(-5.0, 5.0)
        q = count * np.round(way / count)
        for stored in (q, np.round(q, int(rng.integers(3, 8))), q.astype(np.float32).astype(float)):
            assert not _binary_counts(stored, 360.0)
            assert not _binary_counts(stored, 1.0)
