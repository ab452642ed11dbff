"""GMS as a controller steps it: at a held velocity that jumps, against the reference's discrete definition."""

from __future__ import annotations

import math

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.spec import Surroundings
from stickslip.laws.gms import LAW

K, C, TIME = [12896.0, 8141.0, 4273.0], 23.8782, 1e-3
VALUES = {"k": K, "alpha": [1 / 3] * 3, "c": C, "fs": 0.335, "fc": 0.285, "vs": 0.01, "sigma2": 0.018}
U = Surroundings()


def defined(v, force, slips, way):
    """A sample as the reference defines it: an element beyond the curve is clamped to it, whether v jumped or not."""
    s = 0.285 + 0.05 * math.exp(-((v / 0.01) ** 2))
    if math.copysign(1.0, v) != way:
        way, slips = math.copysign(1.0, v), [False] * 3
    for i in range(3):
        level = way * s / 3.0
        if slips[i]:
            force[i] = level + (force[i] - level) * math.exp(-C * TIME / s)
            continue
        force[i] += K[i] * v * TIME
        if way * force[i] >= s / 3.0:
            force[i], slips[i] = level, True
    return force, slips, way


def test_samples_at_a_held_velocity_are_those_of_the_reference():
    rng, t = np.random.default_rng(3), TIME * np.arange(1, 3000)
    speed = (0.03 * np.sin(31.0 * t) + 0.02 * np.sin(67.0 * t)) * rng.uniform(0.2, 3.0, t.size)
    p, z = LAW.parameters(VALUES), LAW.state(LAW.parameters(VALUES))
    force, slips, way = [0.0] * 3, [False] * 3, 0.0
    for v in speed.tolist():
        force, slips, way = defined(v, force, slips, way)
        assert LAW.sampled(v, v, TIME, z, p, U) == pytest.approx(sum(force) + 0.018 * v, abs=1e-12)


def loaded(model, share):
    """Its state, where the first element sticks with that share of its static torque, in the direction of the sign."""
    z = model.law.state(model.parameters)
    z.force[0] = share * 0.335 / 3.0
    return z


@pytest.mark.parametrize("v", [0.1, -0.1])
def test_an_element_beyond_the_curve_is_put_on_it_where_the_velocity_is_held_and_relaxes_where_it_moves(v):
    model, way = ss.Model("gms", **VALUES), math.copysign(1.0, v)
    held, moving, turned = loaded(model, 0.95 * way), loaded(model, 0.95 * way), loaded(model, -0.95 * way)
    model.law.sampled(v, v, 1e-6, held, model.parameters, U)
    assert way * held.force[0] == pytest.approx(0.285 / 3.0, abs=1e-9)
    model.law.sampled(v, 1.0001 * v, 1e-6, moving, model.parameters, U)
    assert way * moving.force[0] == pytest.approx(0.95 * 0.335 / 3.0, rel=1e-4)
    # A load against the motion is none that resists it.
    model.law.sampled(v, v, 1e-6, turned, model.parameters, U)
    assert way * turned.force[0] == pytest.approx(K[0] * 1e-7 - 0.95 * 0.335 / 3.0, abs=1e-9)


def test_the_torque_now_moves_no_element():
    model = ss.Model("gms", **VALUES)
    z = loaded(model, 0.95)
    assert model.law.sampled(0.1, 0.1, 0.0, z, model.parameters, U) == pytest.approx(
        0.95 * 0.335 / 3.0 + 0.0018
    )
    assert z.force[0] == 0.95 * 0.335 / 3.0


def test_elements_that_slip_together_are_each_as_if_alone():
    shares = [0.2, 0.3, 0.5]
    together = ss.Model("gms", **(VALUES | {"k": [K[0]] * 3, "alpha": shares}))
    z = together.law.state(together.parameters)
    # One slips on, one breaks away inside the step, one slips on after it.
    z.force[0], z.force[1], z.force[2], z.mode[0], z.mode[2] = 0.06, 0.08, 0.15, 1.0, 1.0
    before = list(z.force), list(z.mode)
    together.law.step(0.01, 0.012, TIME, z, together.parameters, U)
    assert list(z.mode) == [1.0] * 3
    for i, share in enumerate(shares):
        alone = together.parameters._replace(k=(K[0],), alpha=(share,))
        y = together.law.state(alone)
        y.force[0], y.mode[0] = before[0][i], before[1][i]
        together.law.step(0.01, 0.012, TIME, y, alone, U)
        assert y.force[0] == z.force[i]


def test_options_wrap_it_as_they_wrap_the_step():
    ripple = ss.Model(
        "gms", {"position_dependence": "spectrum"}, **VALUES, ripple=[0.2], order=[1.0], ripple_phase=[0.0]
    )
    plain = ss.Model("gms", **VALUES)
    by = [m.law.sampled(0.1, 0.1, TIME, loaded(m, 0.95), m.parameters, U) for m in (ripple, plain)]
    assert by[0] == pytest.approx(1.2 * by[1])
    sides = ss.Model("gms", {"symmetry": "asymmetric"}, **VALUES, fc_negative=0.15)
    z = loaded(sides, -0.95)
    sides.law.sampled(-0.1, -0.1, 1e-6, z, sides.parameters, U)
    assert z.force[0] == pytest.approx(-0.15 / 3.0, abs=1e-9)
