"""The sampled engine's general steps, which laws without a located flow take."""

from __future__ import annotations

import math

import numpy as np
import pytest

import stickslip as ss
from stickslip.models import plugins
from stickslip.simulation.case_arrays import DONE
from stickslip.simulation.sampled import engine as sampled
from support.sampled_loops import CONTROLLERS, FAST, TIME, J, apart, case_of, on_grid, up_to_a_turn


def rests_or_slides(torques, law, p):
    """Positions of an axis on a contact without memory that holds at rest."""
    out, velocity = [0.0], 0.0
    for u in torques:
        t, y = 0.0, [out[-1], velocity]
        while t < TIME:
            side = math.copysign(1.0, y[1] if y[1] != 0.0 else u)
            if y[1] == 0.0 and abs(u) <= law.holding(side, None, p, None):
                break

            def rate(_, y, u=u, side=side):
                return [y[1], (u - law.steady(side * max(side * y[1], 1e-12), p)) / J]

            t, y = up_to_a_turn(rate, t, y, side)
        velocity = y[1]
        out.append(y[0])
    return np.array(out)


OTHERS = {
    name: ss.Model(name, **law.example)
    for name, law in ((name, plugins.law(name)) for name in plugins.law_names())
    if law.modes is None
}
"""Every registered law that gives no modes."""
TOLERANCES = (1e-7, 1e-9, 1e-11)


@pytest.mark.parametrize("name", OTHERS)
def test_every_other_law_takes_the_general_step(name):
    record = ss.simulate(ss.RigidAxis(J, OTHERS[name]), CONTROLLERS["PD"], FAST, 0.05)
    assert record.meta["integrator"] == "sampled"
    assert "gives no `modes`" in record.meta["general_step"]
    energy = record.meta["energy"]
    assert abs(energy["residual"]) < 1e-3 * energy["motor_work"]


@pytest.mark.parametrize("name", OTHERS)
def test_errors_fall_with_the_tolerance(name):
    runs = {
        t: sampled.run(case_of(OTHERS[name], CONTROLLERS["PD"], duration=0.15, tolerance=t))
        for t in TOLERANCES
    }
    assert all(run.code == DONE for run in runs.values())
    assert np.ptp(on_grid(runs[1e-11])[:, 3]) > 1e-3
    coarse, fine = (apart(runs[1e-11], runs[t]) for t in TOLERANCES[:2])
    assert fine < 0.3 * coarse
    assert fine < 5e-6


def test_a_viscous_axis_moves_as_its_equation_says():
    law = ss.Model("viscous", sigma2=0.018)
    rows = on_grid(sampled.run(case_of(law, CONTROLLERS["PD"], tolerance=1e-10)))
    rate, position, v = 0.018 / J, [0.0], 0.0
    faded = -math.expm1(-rate * TIME)
    for u in rows[:-1, 5]:
        position.append(position[-1] + u / 0.018 * TIME + (v - u / 0.018) * faded / rate)
        v += (u / 0.018 - v) * faded
    assert np.abs(rows[:, 3] - position).max() < 1e-9
    assert np.ptp(position) > 1e-3


@pytest.mark.parametrize("name", ["static", "stribeck_plain"])
def test_what_holds_is_that_of_a_general_solver_with_events(name):
    model = OTHERS[name]
    rows = on_grid(sampled.run(case_of(model, CONTROLLERS["PD"], duration=0.3, tolerance=1e-11)))
    expected = rests_or_slides(rows[:-1, 5], model.law, model.parameters)
    assert np.abs(rows[:, 3] - expected).max() < 1e-7
    assert np.ptp(expected) > 1e-3
    assert np.any(rows[20:, 4] == 0.0)


@pytest.mark.parametrize("name", ["static", "stribeck_plain", "karnopp"])
def test_what_holds_does_not_creep(name):
    step = ss.Reference("step", amplitude=0.01)
    rows = on_grid(sampled.run(case_of(OTHERS[name], CONTROLLERS["PD"], step, 60.0, output=0.1)))
    assert np.ptp(rows[300:, 3]) == 0.0
    assert abs(rows[-1, 5]) > 1e-3
    assert rows[-1, 6] == rows[-1, 5]


@pytest.mark.parametrize(("amplitude", "kp"), [(0.0545, 7.914), (0.115, 4.776)])
def test_sliding_that_dies_away_slowly_takes_no_more_steps(amplitude, kp):
    # The loop lets the torque fall to that of sliding, below which the contact at rest holds: the slower it moves,
    # the shorter a step would have to be that tells the one from the other.
    controller = ss.Controller(ss.Gains(kp=kp, kd=0.097), torque_limit=1.0, sample_time=TIME)
    case = case_of(OTHERS["static"], controller, ss.Reference("step", amplitude=amplitude, tau=0.02), 2.0)
    run = sampled.run(case)
    assert run.code == DONE
    assert run.counts["steps"] < 20_000
    rows = on_grid(run)
    assert rows[-1, 4] == 0.0
    assert 0.2 < rows[-1, 5] < 0.335
