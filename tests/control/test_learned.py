"""What a controller has learned is kept while the power is off, and is the same controller after it."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.errors import InputError, ParameterError
from stickslip.core.spec import Surroundings
from support.golden_rows import INERTIA, ROWS

DATA = np.load(f"{__file__.rpartition('/control/')[0]}/data/control_golden.npz")
INPUTS = np.column_stack([DATA[name] for name in ("qm", "qd", "vd", "ad")])
LEARNING = {
    "PD + FF LuGre .9 scale adapted + DOB 200 residual": "feedforward_scale",
    "PD + FF LuGre .9 RLS + DOB 200 residual": "feedforward_coulomb",
    "PD + FF LuGre gradient gain": "feedforward_learnt",
    "PD + Makkar adaptive": "observer_weight",
    "Lee-Kim delta .5": "loop_level",
    "PD + Friedland-Park 200 on v_f": "observer_level",
}


def ran(controller, z, inputs):
    n, m, p = controller.settings, controller.memory(), controller.parameters
    u, sample = SimpleNamespace(**Surroundings()._asdict()), controller.functions["sample"]
    return np.array([sample(*map(float, x), n, m, z, p, u) for x in inputs])


@pytest.mark.parametrize(("row", "name"), LEARNING.items())
def test_learned_values_go_through_a_file_and_come_back(row, name):
    controller = ROWS[row]
    z = controller.state()
    ran(controller, z, INPUTS)
    kept = controller.learned(z)
    assert np.any(np.array(kept[name]) != np.array(controller.learned(controller.state())[name]))
    again = controller.state(json.loads(json.dumps(kept)))
    assert controller.learned(again) == kept
    # At rest after the power came back nothing is forgotten, and the start values do not come back either.
    still = np.tile([0.0, 0.0, 0.0, 0.0], (50, 1))
    ran(controller, again, still)
    if row != "Lee-Kim delta .5":  # whose levels leak
        assert controller.learned(again)[name] == kept[name]


def test_a_learned_scale_is_given_from_the_first_sample_on():
    controller = ROWS["PD + FF LuGre .9 scale adapted + DOB 200 residual"]
    start = [[0.0, 0.0, 0.5, 0.0]]
    fresh = ran(controller, controller.state(), start)
    learned = {**controller.learned(controller.state()), "feedforward_scale": 0.5, "feedforward_known": 1.0}
    half = ran(controller, controller.state(learned), start)
    f = 0.285 * 0.9 * 0.5  # gain times F_C: half of the Coulomb torque is left out
    assert fresh - half == pytest.approx(f, rel=1e-6)


def test_what_does_not_fit_is_refused():
    controller = ROWS["PD + Makkar adaptive"]
    for learned, said in (
        ({"observer_wait": [0.0] * 3}, "nothing learned is called 'observer_wait'"),
        ({"observer_weight": [0.0] * 2}, "does not fit its law"),
        ({"observer_weight": 1.0}, "does not fit its law"),
        ({"observer_weight": [float("nan"), 0.0, 0.0]}, "does not fit its law"),
    ):
        with pytest.raises(ParameterError, match=said):
            controller.state(learned)


def test_what_does_not_learn_has_nothing_to_keep():
    assert ROWS["PD + DOB 400"].learned(ROWS["PD + DOB 400"].state()) == {}


def test_only_integrators_that_sample_run_what_learns():
    plant, motion = (
        ss.RigidAxis(INERTIA, ss.Model("coulomb", fc=0.285)),
        ss.Reference("sine", amplitude=0.05, frequency=4.0),
    )
    controller = ROWS["PD + FF LuGre .9 scale adapted + DOB 200 residual"]
    for integrator in ("exact", "adaptive", "fixed"):
        with pytest.raises(InputError, match=r"sampled|sample time"):
            ss.simulate(plant, controller, motion, 0.3, integrator=integrator)
    found = ss.simulate(plant, controller, motion, 0.3, integrator="sampled").meta["learned"]
    assert found["feedforward_scale"]["uncertainty"] > 0.0
