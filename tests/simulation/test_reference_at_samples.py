"""A sampled controller reads its reference at the instants of its samples, as `Reference.sample` gives it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.machines.contact import Contact
from stickslip.machines.machine import Machine

FRICTION = ss.Model("coulomb", fc=0.1, sigma2=0.0)
REFERENCES = {
    "sine": ss.Reference("sine", amplitude=0.2, frequency=2.0),
    "ramp": ss.Reference("ramp", velocity=0.5, end=0.3),
    "staircase": ss.Reference("staircase", height=0.05, dwell=0.1, steps=4),
    "table": ss.Reference.table([0.0, 0.1, 0.1001, 0.4], [0.0, 0.0, 0.3, 0.3]),
}
AXES = {
    "axis": ss.RigidAxis(1e-3, FRICTION),
    "machine": Machine("own", 1e-3, Contact(FRICTION), sample_time=1e-3),
}


def controller() -> ss.Controller:
    return ss.Controller(ss.place("PD", 1e-3, 8.0), ss.Feedforward(FRICTION), sample_time=1e-3)


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("name", REFERENCES)
def test_the_exported_controller_does_what_was_simulated(axis: str, name: str) -> None:
    r = ss.simulate(AXES[axis], controller(), REFERENCES[name], 0.45)
    grid = r["event"] == 0.0 if "event" in r.channels else np.full(len(r.time), True)
    k = np.rint(r.time[grid] / 1e-3)
    motion = REFERENCES[name].sample(k * 1e-3)
    assert np.array_equal(r["position_reference"][grid], motion[:, 0])
    assert np.array_equal(r["velocity_reference"][grid], motion[:, 1])
    code: dict[str, Any] = {"__name__": "exported"}
    exec(ss.export(controller(), to="python", name="own").files["own.py"], code)
    exported = code["Controller"]()
    torques = [
        exported.sample(q, *(float(x) for x in row))
        for q, row in zip(r["position"][grid], motion, strict=True)
    ]
    shown = r["torque_command" if axis == "machine" else "motor_torque"][grid]
    assert shown[:-1] == pytest.approx(np.array(torques)[:-1], abs=1e-12)


def test_a_reference_at_rest_moves_no_feedforward() -> None:
    """A Coulomb feedforward jumps with the sign of a velocity that is 0 at the first sample."""
    r = ss.simulate(AXES["axis"], controller(), REFERENCES["sine"], 0.01)
    assert r["velocity_reference"][0] == r["compensation_torque"][0] == r["motor_torque"][0] == 0.0


@pytest.mark.parametrize("name", ["ramp", "staircase"])
def test_a_sample_on_a_jump_sees_what_comes_behind(name: str) -> None:
    """However the time of the sample was rounded: 300 times 1 ms is 0.3 s, and three times 0.1 s is more."""
    here, beside = REFERENCES[name].sample([0.3, 300 * 1e-3, 3 * 0.1, 0.3 + 1e-9, np.nextafter(0.3, 0.0)]), 3
    assert np.allclose(here, here[beside], atol=1e-8)
    assert not np.allclose(REFERENCES[name].sample([0.3 - 1e-11]), here[beside], atol=1e-8)
