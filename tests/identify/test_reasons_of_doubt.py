"""Why numbers are not believed: the reason that is printed is the one that applies."""

import math

import numpy as np
import pytest

from stickslip.errors import InputError
from stickslip.identify.experiment import Experiment
from stickslip.identify.fit.uncertainty import too_wide
from stickslip.identify.regression.regression import regress_axis
from stickslip.machines.servo import ServoAxis

AXIS = ServoAxis(drive_side="load")
PERIOD = 0.004


def stair(speeds: tuple[tuple[float, float], ...]) -> tuple[np.ndarray, np.ndarray]:
    """Time and velocity of constant speeds (rad/s, s) with smooth changes between them."""
    steps = np.concatenate([np.full(int(seconds / PERIOD), speed) for speed, seconds in speeds])
    window = np.hanning(51) / np.sum(np.hanning(51))
    v = np.convolve(np.pad(steps, 25, mode="edge"), window, "valid")
    return np.asarray(PERIOD * np.arange(v.size), dtype=np.float64), v


def test_cogging_is_named_where_it_is_the_reason() -> None:
    """ "It does not follow its torque as one inertia does" was printed two lines below the cogging."""
    rng = np.random.default_rng(2)
    t = np.asarray(PERIOD * np.arange(3000), dtype=np.float64)
    q = 1.2 * np.sin(2.0 * math.pi * t) + 0.12 * np.sin(4.6 * math.pi * t)
    v = np.gradient(q, t)
    torque = 0.0005 * np.gradient(v, t) + 0.02 * np.tanh(v / 1e-3) + 0.001 * v + 0.2 * np.sin(7.0 * q + 0.3)
    found = regress_axis([Experiment("log", t, q, torque + 0.005 * rng.standard_normal(t.size))], AXIS)
    assert found.doubt.startswith("the torque over the position (cogging, unbalance) is ")
    assert "one inertia" not in found.doubt


def test_friction_of_an_axis_that_runs_backward_is_positive() -> None:
    """The median of the signed speeds made friction of -0.5 N·m of it, and intervals were compared with that."""
    t, v = stair(((0.0, 0.5), (4.0, 2.0), (-9.0, 3.0), (0.0, 0.3), (-12.0, 3.0), (-15.0, 3.0), (0.0, 1.0)))
    noise = 0.3 * np.random.default_rng(0).standard_normal(t.size)
    torque = 0.02 * np.gradient(v, PERIOD) + 0.02 * np.tanh(v / 1e-3) + 0.05 * v + noise
    found = regress_axis([Experiment("log", t, np.cumsum(v) * PERIOD, torque)], AXIS)
    assert not found.numbers["fc"].told_to_two
    assert found.friction == pytest.approx(0.02 + 0.05 * 9.0, rel=0.5)


@pytest.mark.parametrize("level", [-1.07, 0.0, math.nan, math.inf])
def test_a_level_that_is_none_is_not_called_friction(level: float) -> None:
    said = too_wide(0.2, "N·m", level)
    assert (
        said == "no level of friction above 0 was found with which its half-width of 0.2 N·m can be compared"
    )
    assert too_wide(0.2, "N·m", 1.07).endswith("exceeds 10 % of friction, 1.07 N·m")
    assert too_wide(0.1, "N·m", 1.07) == ""


def test_sliding_that_is_too_short_is_stated_with_its_length() -> None:
    """2.6 s at 25 rad/s were called 0 s of gross sliding."""
    t, v = stair(((0.0, 0.5), (0.65, 10.0), (0.0, 0.5), (-25.0, 2.6), (0.0, 1.0)))
    rows = np.arange(0.0, t[-1], 0.04)
    noise = 0.1 * np.random.default_rng(0).standard_normal(rows.size)
    q, torque = (np.interp(rows, t, x) for x in (np.cumsum(v) * PERIOD, 0.3 * np.tanh(v / 1e-3) + 0.05 * v))
    with pytest.raises(
        InputError, match=r"it lasts [2-9]\.\d+ s at a time at most.* for a window of \d\.\d+ s"
    ):
        regress_axis([Experiment("log", rows, q + noise, torque)], AXIS)
