"""The doctor on an axis that is slow in one direction and fast in the other, and on motion at constant speed."""

from typing import Any

import numpy as np
import pytest

from stickslip.core.errors import InputError
from stickslip.core.record import Record, encoder_step
from stickslip.identification.doctor import examine

PERIOD = 0.002
CREEP_AND_RUN = ((0.0, 0.5), (0.65, 10.0), (0.0, 0.5), (-25.0, 2.6), (0.0, 0.5))
"""Speeds, rad/s, and their times, s: 6.5 rad forward, 65 rad back."""


def no_regression(*_: Any, **__: Any) -> Any:
    """Leave the regression on gross sliding out: it takes seconds and nothing here needs it."""
    raise InputError("left out")


def times(count: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.asarray(PERIOD * np.arange(count), dtype=np.float64)


def record(speeds: tuple[tuple[float, float], ...], sign: float = 1.0, ripple: float = 0.0) -> Record:
    """Speeds with smooth changes between them; J = 0.02 kg·m², F_C = 0.3 N·m, sigma2 = 0.05 N·m·s/rad."""
    steps = np.concatenate([np.full(int(seconds / PERIOD), speed) for speed, seconds in speeds])
    window = np.hanning(101) / np.sum(np.hanning(101))
    v = np.convolve(np.pad(steps, 50, mode="edge"), window, "valid")
    q = np.cumsum(v) * PERIOD
    noise = 0.01 * np.random.default_rng(1).standard_normal(v.size)
    torque = (
        0.02 * np.gradient(v, PERIOD) + 0.3 * np.tanh(v / 1e-3) + 0.05 * v + ripple * np.sin(7.0 * q) + noise
    )
    channels: dict[str, Any] = {"position": q, "motor_torque": sign * torque}
    return Record(times(v.size), channels, {"position": "rad", "motor_torque": "N·m"})


def findings(examined: Record) -> dict[str, str]:
    return {f.code: f.message for f in examine(examined, estimate=no_regression).findings}


@pytest.mark.parametrize("ripple", [0.0, 0.2])
def test_an_axis_that_creeps_forward_and_runs_back_reverses(ripple: float) -> None:
    found = findings(record(CREEP_AND_RUN, ripple=ripple))
    assert "no-reversal" not in found
    assert "torque-sign" not in found


@pytest.mark.parametrize("ripple", [0.0, 0.2])
def test_an_inverted_torque_is_found_there(ripple: float) -> None:
    assert "friction would drive the axis" in findings(record(CREEP_AND_RUN, -1.0, ripple))["torque-sign"]


def test_a_short_return_is_stated_with_its_travel() -> None:
    found = findings(record(((0.0, 0.5), (0.2, 2.0), (0.0, 0.5), (-25.0, 2.6), (0.0, 0.5))))
    assert found["no-reversal"].startswith(
        "the axis moves 65 rad in one direction and at most 0.4 rad in the other"
    )


def test_one_direction_never_reverses() -> None:
    found = findings(record(((0.0, 0.5), (2.0, 3.0), (8.0, 3.0), (0.0, 0.5))))
    assert found["no-reversal"].startswith("the axis never reverses")


def test_constant_speed_is_no_encoder_step() -> None:
    """Equal changes from row to row were reported as a position that moves in steps of 0.01 rad."""
    assert "quantisation" not in findings(record(((5.0, 10.0),)))
    t = times(5000)
    for exact in (5.0 * t, np.minimum(5.0 * t, 50.0 - 5.0 * t)):
        assert encoder_step(np.asarray(exact, dtype=np.float64)) == 0.0
    assert encoder_step(np.asarray(np.round(0.5 * t / 0.004) * 0.004, dtype=np.float64)) == pytest.approx(
        0.004
    )


def test_two_values_are_no_motion_within_their_distance() -> None:
    flips = np.sign(np.sin(np.arange(4000) * 0.002) + 1e-9)
    channels: dict[str, Any] = {"position": flips, "motor_torque": np.cos(np.arange(4000) * 0.002)}
    found = findings(Record(times(4000), channels, {"position": "rad", "motor_torque": "N·m"}))
    assert found["never-moved"].startswith("position has only 2 values, over 2 rad")
