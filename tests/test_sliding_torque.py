"""The torque at constant velocity of a model: any number of velocities, in either direction."""

from __future__ import annotations

import math

import numpy as np
import pytest

import stickslip as ss
from stickslip.identification.monte_carlo import resisting_torque

MOVING = np.array([[-2.0, -0.1, -1e-6], [1e-6, 0.05, 3.0]])
MODELS = [ss.Model(ss.law(name), **ss.law(name).example) for name in ss.law_names() if ss.law(name).steady]


@pytest.mark.parametrize("model", MODELS, ids=lambda m: m.law.name)
def test_it_is_the_torque_that_curves_are_fitted_to(model: ss.Model) -> None:
    said = model.sliding_torque(MOVING)
    assert said.shape == MOVING.shape
    assert np.allclose(said.reshape(-1), resisting_torque(model, MOVING.reshape(-1)), rtol=1e-9)
    one = model.sliding_torque(3.0)
    assert isinstance(one, float)
    assert one == said[1, 2]
    assert model.sliding_torque(0.0) == 0.0
    assert model.sliding_torque([]).shape == (0,)


def test_what_has_no_such_torque_is_refused() -> None:
    made = {name: ss.law(name) for name in ss.law_names()}
    without = next(law for law in made.values() if law.steady is None)
    with pytest.raises(ss.InputError, match="says no torque at constant velocity"):
        ss.Model(without, **without.example).sliding_torque(1.0)
    with pytest.raises(ss.InputError, match="velocity = nan rad/s must be finite"):
        MODELS[0].sliding_torque([1.0, math.nan])
