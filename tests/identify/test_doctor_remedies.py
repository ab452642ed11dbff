"""What the doctor says to do can be done, once, and in the words of who asked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip import Record
from stickslip.core.errors import InputError
from stickslip.identification.doctor import examine

J, FC, COUNTS, RATED = 1e-3, 0.3, 8192, 1.3
UNITS = {"position": "rad", "motor_torque": "N·m"}


def log(rows: int = 3000, offset: float = 0.0) -> dict[str, np.ndarray]:
    """An axis that turns to and fro, with Coulomb friction."""
    t = np.arange(rows) * 2e-3
    v = 9.0 * np.sin(2.0 * np.pi * 0.7 * t) + 4.0 * np.sin(2.0 * np.pi * 0.2 * t)
    noise = np.random.default_rng(3).normal(0.0, 2e-3, rows)
    torque = J * np.gradient(v, t) + FC * np.sign(v) + 0.005 * v + offset + noise
    return {"t": t, "q": np.cumsum(v) * 2e-3, "v": v, "tau": torque}


def written(path: Path, **columns: np.ndarray) -> Path:
    table = np.stack(list(columns.values()), axis=1)
    np.savetxt(path, table, "%.9g", ",", header=",".join(columns), comments="")
    return path


def in_counts(path: Path) -> Path:
    x = log()
    counts, share = np.round(x["q"] / (2.0 * np.pi) * COUNTS), np.round(1000.0 * x["tau"] / RATED)
    return written(path, **{"Time [s]": x["t"], "0x6064": counts, "0x6077": share})


def test_the_numbers_of_the_drive_tell_the_units_of_cia_402(tmp_path):
    path = in_counts(tmp_path / "log.csv")
    said = ss.doctor(path, counts_per_rev=COUNTS, rated_torque=RATED)
    assert said.errors == ()
    assert np.allclose(said.record["position"], log()["q"], atol=2.0 * np.pi / COUNTS)
    assert np.allclose(said.record["motor_torque"], log()["tau"], atol=1e-3 * RATED)


def test_counts_have_one_remedy_that_asks_for_nothing_given(tmp_path):
    path = in_counts(tmp_path / "log.csv")
    bare = ss.doctor(path).errors
    assert sorted(f.code for f in bare) == ["position-unit", "torque-unit"]
    assert 'map={"position": "0x6064:counts"} and counts_per_rev=N' in bare[0].remedy
    x = log()
    shares = np.round(1000.0 * x["tau"] / RATED)
    path = written(
        tmp_path / "named.csv", **{"time [s]": x["t"], "position [rad]": x["q"], "ActTorque": shares}
    )
    (found,) = ss.doctor(path, rated_torque=RATED).errors
    assert "permille" in found.remedy
    assert "rated_torque" not in found.remedy
    assert ss.doctor(path, map={"torque": "ActTorque:permille"}, rated_torque=RATED).errors == ()


def test_counts_beside_a_velocity_have_one_remedy(tmp_path):
    x = log()
    columns = {
        "Time": x["t"],
        "r61[0]": x["v"] * 30.0 / np.pi,
        "r80[0]": x["tau"],
        "r2521": np.round(1e4 * x["q"]),
    }
    (found,) = ss.doctor(written(tmp_path / "log.csv", **columns)).errors
    assert 'map={"position": "r2521:counts"} and counts_per_rev=N' in found.remedy


def test_time_that_runs_backwards_has_a_remedy_that_helps(tmp_path):
    x = log()
    path = written(tmp_path / "log.csv", time=x["t"][::-1], position=x["q"], torque=x["tau"])
    found = next(f for f in ss.doctor(path).errors if f.code == "backward-time")
    assert "rows=" not in found.remedy
    assert "sample_time=SECONDS" in found.remedy
    assert ss.doctor(path, sample_time=2e-3).errors == ()


def test_of_several_records_the_longest_is_named(tmp_path):
    x = log()
    time = np.concatenate([x["t"][:5], x["t"][:2000], x["t"][:995]])
    path = written(tmp_path / "log.csv", time=time, position=x["q"], torque=x["tau"])
    (found,) = ss.doctor(path).errors
    assert 'rows="6:2005"' in found.remedy
    assert ss.doctor(path, rows="6:2005").errors == ()


def test_a_velocity_without_a_position_is_said(tmp_path):
    x = log()
    path = written(
        tmp_path / "log.csv", **{"t [s]": x["t"], "n [rpm]": 30.0 / np.pi * x["v"], "M [Nm]": x["tau"]}
    )
    said = next(f for f in ss.doctor(path).findings if f.code == "missing-column")
    assert "no position" in said.message
    assert 'map={"position": "COLUMN:rad"}' in said.remedy


def test_an_axis_is_identified_from_velocity_and_torque_alone(tmp_path):
    """Traces of drives often hold no more."""
    x = log()
    rpm = np.round(30.0 / np.pi * x["v"], 1)
    path = written(tmp_path / "log.csv", **{"t [s]": x["t"], "n [rpm]": rpm, "M [Nm]": x["tau"]})
    found = ss.identify(path, law="coulomb")
    assert found["inertia"].value == pytest.approx(J, rel=0.01)
    assert found["fc"].value == pytest.approx(FC, rel=0.01)
    assert found["fc"].identified
    assert any(f.code == "missing-column" for f in found.sources[0].findings)
    with pytest.raises(InputError, match="at which angle a pendulum hangs"):
        ss.identify(path, law="coulomb", pendulum=True)


def test_a_refusal_names_the_call_that_says_more(tmp_path):
    x = log()
    with pytest.raises(InputError, match=r'torque-sign"\] if you know.*see `ss\.doctor\(\.\.\.\)`$'):
        ss.identify(t=x["t"], position=x["q"], torque=-x["tau"])
    path = written(tmp_path / "log.csv", time=x["t"], position=x["q"], torque=-x["tau"])
    with pytest.raises(InputError, match=r"see `stickslip doctor .*log\.csv`$"):
        ss.identify(path)


def test_where_spikes_leave_nothing_they_are_named():
    x = log(1200)
    q = x["q"].copy()
    q[[150, 333, 555, 700, 901, 1044]] += 4.0
    arrays = {"t": x["t"], "position": q, "torque": x["tau"]}
    with pytest.raises(InputError, match=r'position has 6 spikes.*leave_out=\["spikes"\]'):
        ss.identify(**arrays, law="coulomb")
    assert ss.doctor(**arrays, leave_out=["spikes"]).errors == ()


@pytest.mark.parametrize("offset", [0.03, 0.15])
def test_a_constant_torque_is_set_against_a_known_coulomb_torque(offset):
    x = log(offset=offset)
    found = [f for f in examine(Record(x["t"], {"position": x["q"], "motor_torque": x["tau"]}, UNITS)).findings
             if f.code == "offset"]  # fmt: skip
    assert len(found) == (offset > 0.3 * FC)
    assert all(f", {100 * offset / FC:.0f} % of Coulomb friction" in f.message for f in found)


def test_a_coulomb_torque_that_does_not_show_is_not_quoted():
    """Swings within presliding: a spring, for which the plain line finds hardly any friction."""
    t = np.arange(4000) * 1e-3
    q = 0.004 * np.sin(2.0 * np.pi * t)
    torque = 40.0 * q + 0.02 + np.random.default_rng(3).normal(0.0, 5e-4, t.size)
    found = examine(Record(t, {"position": q, "motor_torque": torque}, UNITS)).findings
    assert not any("Coulomb" in f.message for f in found if f.code == "offset")


@pytest.mark.parametrize("unit", ["1/s", "Units", "user units"])
def test_a_unit_that_is_stated_and_not_known_is_asked_for(tmp_path, unit):
    """Revolutions a second were taken as radians: inertia and viscous friction 6.28 times too large, identified."""
    x = log()
    velocity = np.gradient(x["q"], x["t"])
    path = written(
        tmp_path / "log.csv", **{"Time [s]": x["t"], f"Speed act [{unit}]": velocity, "Torque [Nm]": x["tau"]}
    )
    (found,) = ss.doctor(path).errors
    assert found.code == "unknown-unit"
    assert f'"velocity": "Speed act [{unit}]:rev/s"' in found.remedy
    assert not ss.doctor(path, map={"velocity": f"Speed act [{unit}]:rad/s"}).errors


def test_an_axis_in_brackets_is_no_unit(tmp_path):
    x = log()
    path = written(tmp_path / "log.csv", **{"t": x["t"], "position[0]": x["q"], "effort[0]": x["tau"]})
    assert not ss.doctor(path).errors
