"""Tuning steps: short and strongly accelerated, so that filters take much of them and a late torque turns power."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stickslip.cli import main
from stickslip.core.record import Record
from stickslip.identification.doctor import examine

INERTIA, LEVEL = 2e-2, 0.1
UNITS = {"position": "rad", "velocity": "rad/s", "motor_torque": "N·m"}


def steps(rise: float, late: int, rate: float, sign: float = 1.0) -> Record:
    """Steps there and back of `rise` s each, and a torque that acts `late` rows after its row."""
    t = np.arange(round(8.0 * rate)).astype(np.float64) / rate
    phase = np.clip((t % 0.25) / rise, 0.0, 1.0)
    shape = 10.0 * phase**3 - 15.0 * phase**4 + 6.0 * phase**5
    back = (t // 0.25) % 2 == 1
    q: Any = 0.05 * np.where(back, 1.0 - shape, shape)
    v: Any = np.gradient(q, t)
    torque: Any = INERTIA * np.gradient(v, t) + LEVEL * np.tanh(v / 1e-3)
    velocity: Any = np.concatenate([[0.0], np.diff(q)]) * rate
    noise = 0.02 * np.random.default_rng(1).standard_normal(t.size)
    return Record(
        t, {"position": q, "velocity": velocity, "motor_torque": sign * np.roll(torque, -late) + noise}, UNITS
    )


def codes(record: Record) -> set[str]:
    return {f.code for f in examine(record).findings if f.level != "note"}


@pytest.mark.parametrize("rate", [250.0, 500.0])
def test_a_velocity_of_short_steps_is_filtered_as_the_position_is(rate: float) -> None:
    """It was 1.4 to 1.5 times the change of a position that a filter had taken a third of, and the log refused."""
    record = steps(0.03, 0, rate)
    assert not {c for c in codes(record) if c.startswith("velocity")}
    doubled = Record(record.time, {**record.channels, "velocity": 2.0 * record.channels["velocity"]}, UNITS)
    assert {c for c in codes(doubled) if c.startswith("velocity")}


def test_a_torque_that_acts_late_is_not_turned() -> None:
    """Its power at the velocity of its row is negative where it accelerates much; its inertia is not."""
    assert "torque-sign" not in codes(steps(0.06, 4, 1000.0))
    assert "torque-sign" in codes(steps(0.06, 0, 1000.0, sign=-1.0))


@pytest.mark.parametrize(
    ("apart", "unit"), [(1.0, "ms"), (4.0, "ms"), (1000.0, "us"), (250.0, "us"), (1e6, "ns")]
)
def test_a_time_without_a_unit_is_in_the_one_that_makes_it_a_drives(
    apart: float, unit: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Microseconds were said to be milliseconds."""
    record = steps(0.06, 0, 1000.0)
    table = np.column_stack([apart * np.arange(len(record)), record["position"], record["motor_torque"]])
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header="time,position_rad,torque_Nm", comments="")
    assert main(["doctor", str(tmp_path / "log.csv")]) == 2
    said = capsys.readouterr().out
    assert f"that is {unit} rather than s" in said
    assert f"--map time=time:{unit}" in said
