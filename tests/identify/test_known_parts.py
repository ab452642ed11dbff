"""What is known of an axis is not fitted, and everything else is fitted beside it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.errors import InputError
from stickslip.identification.axis import identify_axis
from stickslip.identify.estimate import Estimate, Identification
from stickslip.identify.experiment import Experiment
from stickslip.machines.servo import ServoAxis

AXIS = ServoAxis(drive_side="load")
TRUE = {"inertia": 4e-3, "fc": 0.3, "sigma2": 0.02, "offset": 0.01}


@pytest.fixture(scope="module")
def record() -> Experiment:
    """Two sines, the torque about its row, with noise."""
    t = np.arange(8000) * 1e-3
    w = 2.0 * np.pi * np.array([0.5, 0.8])
    v = 6.0 * np.sin(w[0] * t) + 3.0 * np.sin(w[1] * t)
    a = 6.0 * w[0] * np.cos(w[0] * t) + 3.0 * w[1] * np.cos(w[1] * t)
    torque = TRUE["inertia"] * a + TRUE["fc"] * np.sign(v) + TRUE["sigma2"] * v + TRUE["offset"]
    noise = np.random.default_rng(2).normal(0.0, 0.02, t.size)
    return Experiment("log", t, np.round(np.cumsum(v) * 1e-3, 6), torque + noise)


def identified(record: Experiment, **known: float) -> tuple[Identification, dict[str, Estimate]]:
    found = identify_axis([record], AXIS, ["coulomb"], frozen=tuple(known), values=known)
    return found, {e.name: e for e in found.estimates}


@pytest.mark.parametrize("name", sorted(TRUE))
def test_beside_a_true_value_the_others_hold_and_are_no_less_sure(record: Experiment, name: str) -> None:
    _, free = identified(record)
    found, others = identified(record, **{name: TRUE[name]})
    assert others.keys() == free.keys() - {name}
    for n, e in others.items():
        assert e.identified
        assert e.lower <= TRUE[n] <= e.upper
        assert e.upper - e.lower <= 1.1 * (free[n].upper - free[n].lower)
    sliding = found.details["sliding"].numbers[name]
    assert sliding.interval == pytest.approx((TRUE[name], TRUE[name]), rel=1e-6)


@pytest.mark.parametrize(
    ("name", "times", "other", "way"),
    [("fc", 1.05, "sigma2", -1.0), ("fc", 0.9, "sigma2", 1.0), ("sigma2", 1.5, "fc", -1.0), ("sigma2", 0.5, "fc", 1.0)],
)  # fmt: skip
def test_beside_another_value_the_others_are_those_that_go_with_it(
    record: Experiment, name: str, times: float, other: str, way: float
) -> None:
    """They stayed those of the free fit to every digit, and were called identified."""
    _, free = identified(record)
    _, others = identified(record, **{name: times * TRUE[name]})
    assert way * (others[other].value - free[other].value) > 0.02 * free[other].value


def test_least_squares_of_everything_hold_nothing(record: Experiment) -> None:
    """The value that was given was fitted in silence."""
    with pytest.raises(InputError, match=r"inverse=True\) fits every number: inertia cannot be held"):
        ss.identify(
            t=record.time,
            position=record.position,
            torque=record.signal(),
            inverse=True,
            inertia=TRUE["inertia"],
        )


def test_the_command_takes_a_known_inertia(
    record: Experiment, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    columns = np.column_stack([record.time, record.position, record.signal()])
    np.savetxt(
        tmp_path / "log.csv",
        columns,
        delimiter=",",
        header="time [s],position [rad],torque [N·m]",
        comments="",
    )
    out = ["--out", str(tmp_path / "model.toml")]
    command = ["identify", str(tmp_path / "log.csv"), *out, "--law", "coulomb", "--json", "--inertia"]
    assert main([*command, "0.004"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {e["name"] for e in found["estimates"]} == {"fc", "sigma2", "offset"}
    assert "Known, not fitted: inertia = 0.004 kg·m²." in found["notes"]
    assert main([*command, "-1"]) == 2
    assert capsys.readouterr().err == "stickslip: --inertia -1 kg·m² must be greater than 0\n"
