"""The constant torque that certain sliding tells, where friction is not the same in both directions."""

from __future__ import annotations

import numpy as np
import pytest

from stickslip.identify.experiment import Experiment
from stickslip.identify.regression.regression import regress_axis
from stickslip.machines.servo import ServoAxis

AXIS = ServoAxis(drive_side="load")


def uneven(share: float, seed: int) -> Experiment:
    """Coulomb torque of 0.3 N·m and a fall of 0.12 from rest to it, both so much larger forwards, less backwards."""
    t = np.arange(15_000) * 1e-3
    q = 3.0 * np.sin(1.5 * t) + 0.4 * np.sin(7.0 * t)
    v = 4.5 * np.cos(1.5 * t) + 2.8 * np.cos(7.0 * t)
    a = -6.75 * np.sin(1.5 * t) - 19.6 * np.sin(7.0 * t)
    level = 0.3 + 0.12 * np.exp(-(v**2))
    torque = 0.01 * a + 0.02 * v + level * (np.sign(v) + share) + 0.05
    noise = 1e-3 * np.random.default_rng(seed).standard_normal(t.size)
    return Experiment("uneven", t, q, torque + noise)


@pytest.mark.parametrize("share", [-0.05, 0.05])
def test_the_offset_holds_where_the_fall_of_friction_differs_by_direction(share: float) -> None:
    """Slow rows lie higher in one direction than the level does: of 72 production moves so, 82 % held."""
    found = regress_axis([uneven(share, 1)], AXIS)
    low, high = found.interval("offset")
    assert low <= 0.05 + share * 0.3 <= high
    assert high - low < 0.02 * 0.3
