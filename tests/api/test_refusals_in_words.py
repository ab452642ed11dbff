"""Refusals speak of what the user gave: in the order of the call, with units, with names that are public."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import stickslip as ss
from stickslip.identification.estimate import Estimate, Identification

LAW = ss.Model("coulomb", fc=0.3)
AXIS, SINE = ss.RigidAxis(1e-3, LAW), ss.Reference("sine", amplitude=0.1, frequency=1.0)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: ss.pid(1.0, 0.1), "its arguments are kp, ki, kd"),
        (lambda: ss.place("PD", 1e-3, -1.0), "bandwidth = -1 Hz must"),
        (lambda: ss.place("pd", 1e-3, 1.0), "'pd'; did you mean 'PD'?"),
        (lambda: ss.compare(LAW, LAW), "must be a path or what `identify` returned"),
        (lambda: ss.recommend(LAW, bandwidth=20.0), "give inertia in kg·m², or a RigidAxis"),
        (
            lambda: ss.simulate(AXIS, ss.Controller(ss.pd(1.0, 0.1)), SINE, 0.1, initial=1.0),
            "such as (0.0, 0.0), position (rad) and velocity (rad/s)",
        ),
        (
            lambda: ss.identify(t=[0.0, 1.0], position=[0.0, 1.0], torque=[0.0, 1.0], delay=-1.0),
            "(below 0 where its column lies behind it)",
        ),
    ],
)
def test_a_refusal_says_what_helps(call: Callable[[], object], said: str) -> None:
    with pytest.raises(ss.InputError) as told:
        call()
    assert said in str(told.value)
    assert "Identified" not in str(told.value)


def test_a_frame_has_no_numbers_that_the_table_has_not() -> None:
    """A value within [2e-28, 2e37] was called not determined where it was printed, and 1.0 in the frame."""
    told = Estimate("fc", "N·m", "F_C", 0.3, 0.01, 0.28, 0.32, True)
    wide = replace(told, name="k", value=1.0, lower=2e-28, upper=2e37, identified=False)
    assert wide.undetermined
    found = Identification("axis", None, (told, wide), np.eye(2), {})
    frame = ss.IdentificationResult(found, ()).to_pandas()
    assert frame.loc["fc", "value"] == 0.3
    assert math.isnan(frame.loc["k", "value"])
    assert (frame.loc["k", "lower"], frame.loc["k", "upper"]) == (0.0, math.inf)
