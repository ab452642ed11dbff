"""LuGre as a controller steps it at a held velocity: the step itself, in fewer operations."""

from __future__ import annotations

import math

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.spec import Surroundings

VALUES = {"sigma0": 3.5e4, "sigma2": 0.018, "fs": 0.335, "fc": 0.285, "vs": 0.01}
FORMS = {
    "no damping": ss.Model("lugre", sigma1=0.0, **VALUES),
    "damping": ss.Model("lugre", sigma1=0.1, **VALUES),
    "fading damping": ss.Model("lugre", {"damping": "fading"}, sigma1=0.1, vd=1e-3, **VALUES),
    "asymmetric": ss.Model("lugre", {"symmetry": "asymmetric"}, sigma1=0.1, **VALUES, fc_negative=0.2),
    "ripple": ss.Model(
        "lugre", {"position_dependence": "spectrum"}, sigma1=0.1, **VALUES, ripple=[0.2], order=[1.0],
        ripple_phase=[0.0],
    ),
}  # fmt: skip
U = Surroundings(position=0.3)


def velocities():
    """From where the bristle moves by 1e-11 of its way in a sample to 1,000 times its way, and where a branch ends."""
    rng = np.random.default_rng(8)
    ends = [x * 0.335 / 35.0 for x in (0.7, 40.0, 750.0)]
    spread = rng.choice([-1.0, 1.0], 4000) * 10.0 ** rng.uniform(-13.0, 1.0, 4000)
    return [0.0, *spread.tolist(), *np.linspace(0.9 * ends[0], 1.1 * ends[0], 200), *ends]


@pytest.mark.parametrize("model", FORMS.values(), ids=FORMS)
def test_a_held_velocity_gives_the_torque_of_the_step(model):
    law, p = model.law, model.parameters
    one, other = law.state(p), law.state(p)
    for v in velocities():
        torque = law.sampled(v, v, 1e-3, one, p, U)
        assert torque == pytest.approx(law.step(v, v, 1e-3, other, p, U), rel=0.0, abs=4e-15 * (1.0 + abs(v)))
        assert one.z == pytest.approx(other.z, rel=0.0, abs=1e-19)
        one.z = other.z


def test_a_velocity_that_runs_over_the_sample_is_stepped():
    model = FORMS["damping"]
    one, other = model.law.state(model.parameters), model.law.state(model.parameters)
    for v0, v1 in ((0.0, 0.01), (0.01, 0.2), (0.2, -0.05)):
        torque = model.law.sampled(v0, v1, 1e-3, one, model.parameters, U)
        assert torque == model.law.step(v0, v1, 1e-3, other, model.parameters, U)
        assert one.z == other.z


def test_nothing_but_nan_comes_of_nan():
    model = FORMS["no damping"]
    assert math.isnan(
        model.law.sampled(math.nan, math.nan, 1e-3, model.law.state(model.parameters), model.parameters, U)
    )
