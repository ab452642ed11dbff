"""Hunting of an integral action against static friction: every engine measures it as its record shows it."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.machines.contact import Contact
from stickslip.machines.machine import Machine
from stickslip.simulation.closed_loop import prepare
from stickslip.simulation.many import batch

INERTIA, DURATION = 4e-3, 120.0
LUGRE = ss.Model("lugre", sigma0=2e3, sigma1=1.0, sigma2=0.02, fs=0.5, fc=0.3, vs=0.02)
REFERENCE = ss.Reference.table([0.0, 0.5, DURATION], [0.0, 0.1, 0.1])
GAINS = ss.pid(10.0, 40.0, 0.3)
PLANTS = {"rigid": ss.RigidAxis(INERTIA, LUGRE), "machine": Machine("ideal", INERTIA, Contact(LUGRE))}


def shown(time: Any, position: Any) -> tuple[float, float]:
    """Half the swing and the period of what a record shows in its last 40 %: from one slip upwards to the next."""
    late = time > 0.6 * DURATION
    t, x = time[late], position[late]
    up = np.flatnonzero((x[:-1] < 0.1) & (x[1:] >= 0.1))
    swings = [np.ptp(x[a:b]) for a, b in pairwise(up)]
    return 0.5 * float(np.mean(swings)), float(np.mean(np.diff(t[up])))


@pytest.mark.parametrize(("plant", "sample_time"), [("rigid", 0.0), ("rigid", 1e-3), ("machine", 1e-3)])
def test_hunting_of_a_contact_that_springs_back_has_the_swing_and_period_of_its_record(plant, sample_time):
    """Bristles ring where the axis stops: their small turns hid the period."""
    controller = ss.Controller(GAINS, sample_time=sample_time)
    record = ss.simulate(PLANTS[plant], controller, REFERENCE, DURATION)
    found = record.meta["metrics"]
    amplitude, period = shown(record.time, record["position"])
    assert found["limit_cycle_amplitude_rad"] == pytest.approx(amplitude, rel=0.02)
    assert found["limit_cycle_period_s"] == pytest.approx(period, rel=0.01)


def test_a_batch_finds_the_hunting_of_each_of_its_loops():
    controllers = [ss.Controller(ss.pid(10.0, ki, 0.3)) for ki in (40.0, 37.0)]
    cases = [prepare(PLANTS["rigid"], c, REFERENCE, DURATION, output=DURATION) for c in controllers]
    found = batch.prepare(cases[0], {"ki": np.array([40.0, 37.0])}).run().metrics
    for i, controller in enumerate(controllers):
        record = ss.simulate(PLANTS["rigid"], controller, REFERENCE, DURATION)
        amplitude, period = shown(record.time, record["position"])
        assert found["limit_cycle_amplitude_rad"][i] == pytest.approx(amplitude, rel=0.02)
        assert found["limit_cycle_period_s"][i] == pytest.approx(period, rel=0.01)
