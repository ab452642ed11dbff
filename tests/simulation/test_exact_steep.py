"""Commands that change within milliseconds or less: the exact integrator follows them, or says that it cannot."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.errors import StepFailure

STEP = ss.Reference("step", amplitude=0.175, tau=1.43e-5)
LIGHT = ss.RigidAxis(3.78e-4, ss.Model("coulomb", fc=0.14, sigma2=0.0028))
PD = ss.Controller(ss.place("PD", 3.78e-4, 3.4, 1.0))


def end(axis: ss.RigidAxis, controller: ss.Controller, motion: ss.Reference, integrator: str) -> float:
    """Where the axis stands after 0.5 s, rad."""
    return float(ss.simulate(axis, controller, motion, 0.5, integrator=integrator)["position"][-1])


@pytest.mark.parametrize("law", ["coulomb", "gms"])
@pytest.mark.parametrize(
    ("fc", "bandwidth", "rise", "height"),
    [(0.8, 5.0, 1e-3, 1.0), (0.8, 5.0, 2e-3, 1.0), (0.8, 3.0, 5e-3, 3.0), (3.9, 6.0, 1e-3, 5.0)],
)
def test_a_recorded_rise_within_milliseconds_is_followed(
    law: str, fc: float, bandwidth: float, rise: float, height: float
) -> None:
    """Its cubic was taken for a straight line, and the error of that for the cubic's: off by up to a fifth."""
    level = {"fc": fc, "sigma2": 0.04}
    if law == "gms":
        level |= {"k": [4e3 * fc, 2e3 * fc], "alpha": [0.5, 0.5], "c": 50.0 * fc, "fs": 1.2 * fc, "vs": 0.01}
    axis = ss.RigidAxis(1.6e-3, ss.Model(law, **level))
    controller = ss.Controller(ss.place("PD", 1.6e-3, bandwidth, 1.0))
    motion = ss.Reference.table([0.0, 0.1, 0.1 + rise, 2.0], [0.0, 0.0, height, height])
    wanted = end(axis, controller, motion, "adaptive")
    assert abs(wanted) > 0.1
    assert end(axis, controller, motion, "auto") == pytest.approx(wanted, abs=1e-7 * height)


def test_a_step_of_microseconds_moves_the_axis_or_is_refused() -> None:
    """At rest its torque passed between two looks; in motion rounding took more than the tolerance."""
    found = ss.simulate(LIGHT, PD, STEP, 0.4)
    assert found.meta["integrator"] == "adaptive"
    assert "no step that meets the tolerance" in found.meta["refused"]["exact"]
    assert found["position"][-1] == pytest.approx(0.0518945911, abs=1e-9)
    with pytest.raises(StepFailure, match='integrator="adaptive"'):
        ss.simulate(LIGHT, PD, STEP, 0.4, integrator="exact")


@pytest.mark.parametrize("frequency", [500.0, 1000.0, 3000.0])
@pytest.mark.parametrize("gains", [ss.Gains(3.0, 0.0, 0.02, 0.0), ss.Gains(3.0, 20.0, 0.02, 0.0)])
def test_a_torque_that_swings_between_two_looks_breaks_away(frequency: float, gains: ss.Gains) -> None:
    """Looked at every millisecond it was 0 each time."""
    axis, controller = ss.RigidAxis(1e-3, ss.Model("coulomb", fc=0.25)), ss.Controller(gains)
    motion = ss.Reference("sine", amplitude=0.1, frequency=frequency)
    paths = [
        ss.simulate(axis, controller, motion, 0.05, integrator=name)["position"]
        for name in ("exact", "adaptive")
    ]
    assert np.ptp(paths[1]) > 1e-7
    assert paths[0][-1] == pytest.approx(paths[1][-1], abs=1e-8)


def test_a_step_ends_where_its_velocity_is_no_number() -> None:
    """A feedforward of its sign ends there, for every integrator."""
    motion = ss.Reference("step", amplitude=0.5, tau=1e-4)
    (last,) = motion.breaks(1.0)
    before, after = motion.sample([np.nextafter(last, 0.0) - 1e-12, last])
    assert before[1] > 0.0
    assert after[1] == 0.0
    assert not list(motion.breaks(0.07))
    axis = ss.RigidAxis(1e-3, ss.Model("coulomb", fc=0.3, sigma2=0.003))
    controller = ss.Controller(ss.place("PD", 1e-3, 5.0, 1.0), ss.Feedforward(axis.friction, gain=0.8))
    wanted = end(axis, controller, motion, "adaptive")
    assert end(axis, controller, motion, "exact") == pytest.approx(wanted, abs=1e-7)
