"""Events of the exact integrator that are easily passed: at a reversal, and late in a long step."""

from __future__ import annotations

import numpy as np
import pytest

from stickslip.control.compensator import Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model
from stickslip.simulation.adaptive import engine as adaptive
from stickslip.simulation.case_arrays import lay_out
from stickslip.simulation.exact import engine as exact
from support.thesis_loops import CASES, PARAMETERS, PLANT

SINE = CASES["low"][0]
PD = place("PD", 3.8623e-4, 36.0, 1.0)


def loop(inertia, friction, helper, duration, tolerance):
    axis = RigidAxis(inertia, Model("gms", **{**PLANT, **friction}))
    grid = np.linspace(0.0, duration, 201)
    return lay_out(
        axis, Controller(PD, helper), SINE, duration, tolerance=tolerance, grid=grid, metered=False
    )


@pytest.mark.parametrize("tolerance", [1e-7, 1e-9])
def test_an_element_breaks_away_in_the_moment_of_a_reversal(tolerance):
    """With F_S below F_C the limit is lowest at rest; just after a reversal it rises again within a microsecond."""
    friction = {"c": 23.46429596138045, "fs": 0.2376874191531307, "fc": 0.2955181283300668, "vs": 0.007227483836175297,
                "sigma2": 0.022796000043157655}  # fmt: skip
    helper = Feedforward(Model("stribeck", **PARAMETERS["stribeck"]), gain=0.7445183794427862)
    found = exact.run(loop(0.00042202570980577836, friction, helper, 0.02, tolerance)).rows
    sure = adaptive.run(loop(0.00042202570980577836, friction, helper, 0.02, 1e-10)).rows
    positions = [rows[rows[:, 8] == 0.0, 3] for rows in (found, sure)]
    assert np.max(np.abs(positions[0] - positions[1])) < 2.0 * tolerance + 1e-9


def test_an_event_is_located_whatever_the_tolerance():
    """A break-away while the axis creeps, somewhere in a step of 64 ms."""
    friction = {"c": 30.833571527425867, "fs": 0.4183193981633159, "fc": 0.33817775842553843, "vs": 0.00758895032695474,
                "sigma2": 0.017701651726044525}  # fmt: skip
    times = []
    for tolerance in (1e-9, 6.31e-9, 1e-8, 1.26e-8, 1.58e-8, 2e-8, 1e-7):
        rows = exact.run(loop(0.00031985605567152347, friction, None, 1.0, tolerance)).rows
        events = rows[rows[:, 8] == 1.0, 0]
        times.append(events[(events > 0.8) & (events < 1.0)])
    assert all(t.size == 1 for t in times)
    assert np.ptp(np.concatenate(times)) < 2e-6
